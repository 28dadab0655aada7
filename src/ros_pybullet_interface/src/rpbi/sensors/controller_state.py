"""How a controller does."""

from rpbi.control.controllers.manager import ControllerManager, ControllerSample

from .sensor import Sensor


class ControllerStateSensor(Sensor):
    """Whether a controller of a robot is active, and what it tells of itself."""

    sample_type = ControllerSample

    def __init__(self, robot: str, controllers: ControllerManager, name: str, hz: float) -> None:
        super().__init__(f"{robot}/{name}", hz)
        self._robot, self._controllers, self._name = robot, controllers, name

    def read(self, tick: int) -> ControllerSample:
        """Asks the controller."""
        return self._controllers.sample(self._robot, self._name)
