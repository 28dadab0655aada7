"""State of a controller."""

from rpbi.control.controllers.manager import ControllerManager, ControllerStateSample

from .sensor import Sensor


class ControllerStateSensor(Sensor):
    """Reports whether a robot's controller is active, and the values that the controller publishes."""

    sample_type = ControllerStateSample
    ros_topic = "rpbi.ros.publishers.sample_topics:CONTROLLER_STATE"

    def __init__(self, robot: str, controllers: ControllerManager, name: str, hz: float) -> None:
        super().__init__(f"{robot}/{name}", hz)
        self._robot, self._controllers, self._name = robot, controllers, name

    def read(self, tick: int) -> ControllerStateSample:
        """Reads the state from the controller."""
        return self._controllers.sample(self._robot, self._name)
