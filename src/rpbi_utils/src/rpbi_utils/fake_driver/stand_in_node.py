"""`stand_in_node.py`: emulates a robot's driver for a robot that a simulator in the same namespace simulates."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence

import rospy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Header
from std_srvs.srv import Trigger, TriggerRequest, TriggerResponse

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.joint_values import JointValues
from custom_ros_tools.ros.joint_states import joint_state, values_in
from custom_ros_tools.ros.lifecycle.parameters import private_config
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning, WallRate
from rpbi_utils.msg import DriverState

from .config import FakeDriverConfig
from .controller import Reflex, RobotController
from .measurement import Measurement

QUEUE_SIZE = 1000
STATE_HZ = 20.0
"""Rate at which an unchanged driver state is published [Hz]. Changes are published at once."""


class FakeDriver:
    """Offers the topics of a robot's driver, and emulates the controller between these topics and a simulated robot.

    Raises:
        ConfigError: If the configuration is wrong.
    """

    def __init__(self) -> None:
        self._config = private_config(FakeDriverConfig)
        self._limits = self._config.load_limits()
        conversions = [each.conversion() for each in self._config.driver.joints]
        self._to_driver, self._to_simulator = conversions, [each.inverse() for each in conversions]
        names = {each.joint: each.name for each in conversions}
        self._driver_names = {name: names.get(name, name) for name in self._limits}
        self._measurement = Measurement(self._config.noise)
        self._controller: RobotController | None = None
        self._position: Sequence[float] = ()
        self._reported: tuple[object, ...] = ()
        self._rate = WallRate(STATE_HZ)
        self._warn = ThrottledWarning()
        self._lock = threading.Lock()
        robot = f"rpbi/{self._config.robot}/joint_states"
        self._target = rospy.Publisher(f"{robot}/target", JointState, queue_size=QUEUE_SIZE, tcp_nodelay=True)
        self._states = rospy.Publisher("joint_states", JointState, queue_size=QUEUE_SIZE, tcp_nodelay=True)
        self._state = rospy.Publisher("driver_state", DriverState, queue_size=QUEUE_SIZE)
        self._subscribe(robot, JointState, self._cycle)
        self._subscribe("joint_states/command", JointState, self._on_joint_state)
        self._subscribe("joint_group_position_controller/command", Float64MultiArray, self._on_array)
        rospy.Service("recover", Trigger, self._recover)

    def _subscribe(self, topic: str, message_type: type, on_message: Callable) -> None:
        rospy.Subscriber(topic, message_type, on_message, queue_size=QUEUE_SIZE, tcp_nodelay=True)

    def _on_joint_state(self, message: JointState) -> None:
        self._command(lambda: values_in(message))

    def _on_array(self, message: Float64MultiArray) -> None:
        self._command(lambda: JointValues.of(self._driver_names.values(), message.data))

    def _command(self, read: Callable[[], JointValues]) -> None:
        """Passes a command to the controller. `read` returns the command with the driver's joint names and units."""
        with self._lock:
            if self._controller is None:
                self._warn("command", "ignored: the robot in the simulator has not said where it is")
                return
            try:
                values = read().converted(self._to_simulator).in_order(tuple(self._limits))
                if not values.position:
                    raise ValueError("expected positions, got none")
            except (InterfaceError, ValueError) as error:
                self._controller.refuse_command(str(error))
            else:
                self._controller.command(time.monotonic(), values.position)
            self._report_changes()

    def _cycle(self, message: JointState) -> None:
        """Runs a controller cycle with the simulated robot's joint state. Publishes targets and measured states."""
        try:
            values = values_in(message).in_order(tuple(self._limits))
        except (InterfaceError, ValueError) as error:
            self._warn("robot in the simulator", str(error))
            return
        with self._lock:
            now_s, self._position = time.monotonic(), values.position
            if self._controller is None:
                self._controller = RobotController(self._config, self._limits, values.position)
            now = rospy.Time.now()
            for time_s, position in self._controller.cycle(now_s, values.position, values.effort):
                header = Header(stamp=now + rospy.Duration.from_sec(time_s - now_s))
                self._target.publish(joint_state(JointValues(tuple(self._limits), position), header))
            measured = self._measurement.observe(now_s, values)
            if measured is not None:
                self._states.publish(joint_state(measured.converted(self._to_driver), message.header))
            self._report_changes()
            if self._rate.is_due():
                self._publish_state()

    def _recover(self, _: TriggerRequest) -> TriggerResponse:
        """Service callback that ends a reflex stop. The next command has to begin at the robot's present position."""
        with self._lock:
            if self._controller is None:
                return TriggerResponse(False, "the robot in the simulator has not said where it is")
            refused = self._controller.recover(self._position)
            self._report_changes()
            return TriggerResponse(refused is None, refused or "recovered: commands begin where the robot stands")

    def _report_changes(self) -> None:
        assert self._controller is not None
        controller = self._controller
        news = controller.mode, controller.is_braking, controller.counters.reflexes
        if news == self._reported:
            return
        reflexes_reported = self._reported[-1] if self._reported else 0
        self._reported = news
        if controller.counters.reflexes != reflexes_reported:
            rospy.logwarn("reflex stop: %s", controller.reflex)
        self._publish_state()

    def _publish_state(self) -> None:
        assert self._controller is not None
        controller, counters = self._controller, self._controller.counters
        reflex = controller.reflex or Reflex("", "", 0.0, 0.0, "")
        self._state.publish(
            DriverState(
                header=Header(stamp=rospy.Time.now()),
                mode=int(controller.mode),
                braking=controller.is_braking,
                reflex=reflex.check,
                joint=self._driver_names.get(reflex.joint, ""),
                value=reflex.value,
                limit=reflex.limit,
                message=str(controller.reflex or ""),
                commands=counters.commands,
                ignored=counters.ignored,
                reflexes=counters.reflexes,
                recoveries=counters.recoveries,
                **{f"peak_{check}": share for check, share in counters.peaks.items()},
            )
        )


def main() -> None:
    """Runs the node."""
    run_node("stand_in", FakeDriver)
