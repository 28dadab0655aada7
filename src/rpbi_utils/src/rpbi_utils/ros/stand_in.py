"""`stand_in_node.py`: the driver of a robot that is not there; a simulator beside it is the robot."""

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
from rpbi_utils.stand_in.config import StandInConfig
from rpbi_utils.stand_in.controller import Reflex, RobotController
from rpbi_utils.stand_in.measurement import Measurement

QUEUE_SIZE = 100
STATE_HZ = 20.0
"""How often the driver's state is published while it stays the same [Hz]."""


class StandIn:
    """Plays the controller of the robot in the simulator of its namespace, by the topics of a driver.

    Raises:
        ConfigError: If the configuration is wrong.
    """

    def __init__(self) -> None:
        self._config = private_config(StandInConfig)
        self._limits = self._config.load_limits()
        conversions = [each.conversion() for each in self._config.driver.joints]
        self._to_driver, self._to_simulator = conversions, [each.inverse() for each in conversions]
        names = {each.joint: each.name for each in conversions}
        self._driver_names = {name: names.get(name, name) for name in self._limits}
        self._measurement = Measurement(self._config.noise)
        self._controller: RobotController | None = None
        self._position: Sequence[float] = ()
        self._told: tuple[object, ...] = ()
        self._rate = WallRate(STATE_HZ)
        self._warn = ThrottledWarning()
        self._lock = threading.Lock()
        robot = f"rpbi/{self._config.robot}/joint_states"
        self._target = rospy.Publisher(f"{robot}/target", JointState, queue_size=QUEUE_SIZE, tcp_nodelay=True)
        self._states = rospy.Publisher("joint_states", JointState, queue_size=QUEUE_SIZE, tcp_nodelay=True)
        self._state = rospy.Publisher("driver_state", DriverState, queue_size=QUEUE_SIZE)
        self._subscribe(robot, JointState, self._cycle)
        self._subscribe("joint_states/command", JointState, self._take_joint_state)
        self._subscribe("joint_group_position_controller/command", Float64MultiArray, self._take_array)
        rospy.Service("recover", Trigger, self._recover)

    def _subscribe(self, topic: str, message_type: type, take: Callable) -> None:
        rospy.Subscriber(topic, message_type, take, queue_size=QUEUE_SIZE, tcp_nodelay=True)

    def _take_joint_state(self, message: JointState) -> None:
        self._take(lambda: values_in(message))

    def _take_array(self, message: Float64MultiArray) -> None:
        self._take(lambda: JointValues.of(self._driver_names.values(), message.data))

    def _take(self, read: Callable[[], JointValues]) -> None:
        """Takes a command, in the driver's names and units."""
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
            self._tell_what_is_new()

    def _cycle(self, message: JointState) -> None:
        """Goes through a cycle with what the robot in the simulator says."""
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
            measured = self._measurement.take(now_s, values)
            if measured is not None:
                self._states.publish(joint_state(measured.converted(self._to_driver), message.header))
            self._tell_what_is_new()
            if self._rate.is_due():
                self._publish_state()

    def _recover(self, _: TriggerRequest) -> TriggerResponse:
        """Ends a reflex stop; the next command begins a motion where the robot stands."""
        with self._lock:
            if self._controller is None:
                return TriggerResponse(False, "the robot in the simulator has not said where it is")
            refused = self._controller.recover(self._position)
            self._tell_what_is_new()
            return TriggerResponse(refused is None, refused or "recovered: commands begin where the robot stands")

    def _tell_what_is_new(self) -> None:
        assert self._controller is not None
        controller = self._controller
        news = controller.mode, controller.is_braking, controller.counters.reflexes
        if news == self._told:
            return
        reflexes_told = self._told[-1] if self._told else 0
        self._told = news
        if controller.counters.reflexes != reflexes_told:
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
    run_node("stand_in", StandIn)
