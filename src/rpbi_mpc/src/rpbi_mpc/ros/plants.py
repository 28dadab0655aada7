"""The robot and the slider as plants: a world that is stepped by services, or one in which time passes by itself."""

from __future__ import annotations

import time
from abc import abstractmethod

import numpy as np
import rospy
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.services import get_srv_handler
from ros_pybullet_interface.srv import SetJointState, StepN
from rpbi_mpc.hand import PlanarHand
from rpbi_mpc.node_configs import PlantConfig
from rpbi_mpc.plant import Plant, Sensed

from .listener import SceneListener

PATIENCE_S = 30.0
"""Longest wait for the first joint states [s]."""
ARRIVAL_S = 0.5
"""Longest wait for the messages of a tick [s] by the wall clock; a slider that is hidden sends none."""


class HandPlant(Plant):
    """A hand whose velocity in the plane is commanded, by targets of the robot's joints.

    Args:
        config: Topics and rates.
        hand: Inverse kinematics of the hand.

    Raises:
        InterfaceError: If no joint states arrive, or the hand is not where its targets can begin.
    """

    def __init__(self, config: PlantConfig, hand: PlanarHand) -> None:
        self._config, self._hand = config, hand
        self._listener = SceneListener(config, hand)
        self._velocity = np.zeros(2)
        self._place: np.ndarray | None = None
        """Where the hand is sent [m]; None until it has been sent somewhere."""
        self._joints = hand.posture

    def sense(self) -> Sensed:
        now_s = self._now_s()
        scene = self._listener.scene()
        if scene is None:
            return Sensed(now_s, None, f"{self._listener.vicon}: no pose yet, expected one")
        age_s = now_s - scene.stamp_s
        if age_s > self._config.timeout_s:
            expected = f"expected one at least every {self._config.timeout_s:g} s"
            return Sensed(now_s, None, f"{self._listener.vicon}: no pose for {age_s:.2f} s, {expected}")
        lead = 0.0 if self._place is None else float(np.hypot(*(self._place - scene.values[3:])))
        if lead > self._config.max_lead:
            expected = f"expected at most {self._config.max_lead:g} m"
            return Sensed(
                now_s, None, f"{self._listener.joint_states}: the hand is {lead:.3f} m from its target, {expected}"
            )
        return Sensed(now_s, scene.values, age_s=max(age_s, 0.0))

    def act(self, command: np.ndarray) -> None:
        self._velocity = np.asarray(command, dtype=float)

    def stand(self) -> None:
        self._velocity = np.zeros(2)

    def begin_at_the_robot(self) -> None:
        """Has the next target begin where the robot is measured, for instance after it was halted."""
        self._place = None

    def advance(self, duration_s: float) -> None:
        step_s = 1.0 / self._config.target_hz
        for _ in range(round(duration_s / step_s)):
            self._pass(step_s, self._next_target(step_s))

    def _next_target(self, step_s: float) -> JointState:
        if self._place is None:
            self._begin()
        assert self._place is not None
        place = self._place + step_s * self._velocity
        try:
            self._joints, self._place = self._hand.solve(self._joints, place), place
        except InterfaceError as error:
            rospy.logwarn_throttle(60.0, f"the hand stands: {error}")
        return JointState(name=list(self._hand.joint_names), position=self._joints.tolist())

    def _begin(self) -> None:
        """Begins with the targets where the robot is."""
        end_s = time.monotonic() + PATIENCE_S
        while (joints := self._listener.joints()) is None and time.monotonic() < end_s and not rospy.is_shutdown():
            self._wait_for_joints()
        if joints is None:
            raise InterfaceError(
                f"{self._listener.joint_states}: expected joint states within {PATIENCE_S:g} s, got none"
            )
        self._place = self._hand.position(joints)[:2]
        self._joints = self._hand.solve(joints, self._place)

    @abstractmethod
    def _now_s(self) -> float: ...

    @abstractmethod
    def _pass(self, step_s: float, target: JointState) -> None:
        """Sets a target and lets a time pass [s]."""

    @abstractmethod
    def _wait_for_joints(self) -> None: ...


class SteppedPlant(HandPlant):
    """A simulator that stands still between the steps, so that no decision depends on the speed of the computer."""

    def __init__(self, config: PlantConfig, hand: PlanarHand) -> None:
        super().__init__(config, hand)
        self._step = get_srv_handler("rpbi/step_n", StepN, persistent=True)
        self._set_target = get_srv_handler(f"rpbi/{config.robot}/set_target", SetJointState, persistent=True)
        self._time_step_s = time_step_s(self._step)
        self._stamp_s = self._step_by(1)

    def sense(self) -> Sensed:
        self._listener.wait_for(self._stamp_s - self._config.latency_s, self._stamp_s, ARRIVAL_S)
        return super().sense()

    def _now_s(self) -> float:
        return self._stamp_s

    def _pass(self, step_s: float, target: JointState) -> None:
        answer = self._set_target(target)
        if not answer.success:
            raise InterfaceError(f"rpbi/{self._config.robot}/set_target: {answer.message}")
        self._stamp_s = self._step_by(round(step_s / self._time_step_s))

    def _step_by(self, ticks: int) -> float:
        answer = self._step(ticks)
        if not answer.success:
            raise InterfaceError(f"rpbi/step_n: {answer.message}")
        return float(answer.stamp.to_sec())

    def _wait_for_joints(self) -> None:
        self._step_by(1)
        time.sleep(0.05)


class TimedPlant(HandPlant):
    """A robot whose time passes by itself: hardware, its stand-in, or a world that runs."""

    is_timed = True

    def __init__(self, config: PlantConfig, hand: PlanarHand) -> None:
        super().__init__(config, hand)
        self._targets = rospy.Publisher(f"rpbi/{config.robot}/joint_states/target", JointState, queue_size=10)
        self._next_s = time.monotonic()
        if config.ready:
            rospy.loginfo(f"waiting for {rospy.resolve_name(config.ready)}, the commands of the robot")
            rospy.wait_for_message(config.ready, rospy.AnyMsg)

    def _now_s(self) -> float:
        return float(rospy.Time.now().to_sec())

    def _pass(self, step_s: float, target: JointState) -> None:
        target.header.stamp = rospy.Time.now()
        self._targets.publish(target)
        self._next_s = max(self._next_s + step_s, time.monotonic() - step_s)
        time.sleep(max(self._next_s - time.monotonic(), 0.0))

    def _wait_for_joints(self) -> None:
        time.sleep(0.05)


def time_step_s(step: rospy.ServiceProxy) -> float:
    """Stops the world, and returns the time of a tick [s], by the stamps of two."""
    get_srv_handler("rpbi/stop", Trigger)()  # it may stand already
    first, second = step(1), step(1)
    for answer in (first, second):
        if not answer.success:
            raise InterfaceError(f"rpbi/step_n: {answer.message}")
    return float((second.stamp - first.stamp).to_sec())
