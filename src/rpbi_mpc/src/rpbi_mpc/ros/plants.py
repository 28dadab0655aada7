"""Plants of the pushing node: a stepped simulator, and a robot or simulator that runs in real time."""

from __future__ import annotations

import contextlib
import time
from abc import abstractmethod

import numpy as np
import rospy
from sensor_msgs.msg import JointState

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.transforms import yaw_of
from ros_pybullet_interface.msg import PredictedBody
from rpbi.world.forks.prediction import PlannedInput
from rpbi_mpc.controller import Plant, Sensed
from rpbi_mpc.node_configs import PlantConfig
from rpbi_mpc.pushing.hand import PlanarHand
from rpbi_mpc.sampling.world import RolloutTicks

from .listener import SceneListener, TickSceneListener
from .simulator import SteppedSimulator

PATIENCE_S = 30.0
"""Timeout for the first joint states [s]."""
LATE_S = 5.0
"""Wall time after which a warning is logged if the messages of a tick are missing [s]."""


class HandPlant(Plant):
    """Moves a robot's hand in a plane. The commands are velocities x, y of the hand [m/s].

    `advance` integrates the velocity to target positions of the hand, and sends the corresponding joint targets.

    Args:
        config: Names of topics, rates and limits.
        hand: Inverse kinematics of the hand.
        listener: Receives the slider's poses and the robot's joint states.

    Raises:
        InterfaceError: If joint states do not arrive, or the hand cannot reach its plane.
    """

    def __init__(self, config: PlantConfig, hand: PlanarHand, listener: SceneListener) -> None:
        self._config, self._hand, self._listener = config, hand, listener
        self._velocity = np.zeros(2)
        self._place: np.ndarray | None = None
        """Target of the hand [m]; None before the first one."""
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
        """Makes the next target start from the hand's measured position, for instance after a stop of the robot."""
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
            rospy.logwarn_throttle(60.0, f"the hand stops: {error}")
        return JointState(name=list(self._hand.joint_names), position=self._joints.tolist())

    def _begin(self) -> None:
        """Waits for the first joint state. Then sets the hand's target to the hand's measured position.

        Raises:
            InterfaceError: If joint states do not arrive within `PATIENCE_S`, or the hand cannot reach its plane.
        """
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
        """Sends a joint target, and lets `step_s` [s] pass."""

    @abstractmethod
    def _wait_for_joints(self) -> None: ...


class SteppedPlant(HandPlant):
    """A plant in a simulator that is stepped by services, so that results do not depend on the computer's speed."""

    def __init__(self, config: PlantConfig, hand: PlanarHand) -> None:
        self._ticks = TickSceneListener(config, hand)
        super().__init__(config, hand, self._ticks)
        self._simulator = SteppedSimulator(config.robot)

    def sense(self) -> Sensed:
        """Waits for the messages of the last tick, and returns the newest measurement.

        Raises:
            InterfaceError: If the simulator does not answer any more.
        """
        while (late := self._ticks.wait_for_tick(self._simulator.time_s, LATE_S)) and not rospy.is_shutdown():
            rospy.logwarn(f"{late}: no message of the tick at {self._simulator.time_s:.3f} s yet, expected one")
            self._simulator.step(0)  # raises an error if it has ended
        return super().sense()

    def scenes(self, velocities: np.ndarray, period_s: float, delay_s: float) -> np.ndarray:
        """Simulates candidates with the service `rpbi/predict`, and returns the scenes; see `PushRollouts`.

        A candidate is not simulated if a position of the hand is out of reach.
        """
        robot, slider, cycles = self._config.robot, self._config.slider, velocities.shape[1]
        ticks = RolloutTicks.of(cycles, period_s, delay_s, self._simulator.dt_s)
        durations_s = np.array([delay_s, *[period_s] * cycles])
        found = np.full((len(velocities), cycles, 5), np.nan)
        candidates = {}
        for index, each in enumerate(velocities):
            with contextlib.suppress(InterfaceError):
                candidates[index] = self._targets(np.vstack([self._velocity, each]), durations_s)
        if candidates:
            chosen = list(candidates.values())
            predictions = self._simulator.predict(chosen, ticks.total, (slider, robot), ticks.every)
            for index, prediction in zip(candidates, predictions):
                if not prediction.fault:
                    bodies = {body.name: body for body in prediction.bodies}
                    found[index] = [self._scene(bodies[slider], bodies[robot], row) for row in ticks.rows]
        return found

    def _targets(self, velocities: np.ndarray, durations_s: np.ndarray) -> list[PlannedInput]:
        """Returns the joint targets for a sequence of hand velocities.

        Inverse kinematics are solved for the hand's position at the end of each velocity's duration. In between, joint
        positions change linearly.

        Args:
            velocities: Velocities x, y of the hand, shape (n, 2) [m/s].
            durations_s: Duration of each velocity, shape (n,) [s].

        Raises:
            InterfaceError: If a position of the hand is out of reach.
        """
        if self._place is None:
            self._begin()
        place, joints, targets, start_s = self._place, self._joints, [], 0.0
        for velocity, duration_s in zip(velocities, durations_s):
            place = place + duration_s * velocity
            before, joints = joints, self._hand.solve(joints, place)
            steps = round(duration_s * self._config.target_hz)
            for step in range(steps):
                tick = round((start_s + step / self._config.target_hz) / self._simulator.dt_s)
                positions = before + (step + 1) / steps * (joints - before)
                named = dict(zip(self._hand.joint_names, positions.tolist()))
                targets.append(PlannedInput(tick, f"{self._config.robot}/target", named))
            start_s += duration_s
        return targets

    def _scene(self, slider: PredictedBody, robot: PredictedBody, row: int) -> list[float]:
        pose, count = slider.poses[row], len(robot.joint_names)
        joints = dict(zip(robot.joint_names, robot.joints[row * count : (row + 1) * count]))
        x, y, _ = self._hand.position(np.array([joints[name] for name in self._hand.joint_names]))
        turn = pose.orientation
        return [pose.position.x, pose.position.y, yaw_of((turn.x, turn.y, turn.z, turn.w)), x, y]

    def _now_s(self) -> float:
        return self._simulator.time_s

    def _pass(self, step_s: float, target: JointState) -> None:
        self._simulator.set_target(target)
        self._simulator.step(round(step_s / self._simulator.dt_s))

    def _wait_for_joints(self) -> None:
        self._simulator.step(1)
        time.sleep(0.05)


class TimedPlant(HandPlant):
    """A plant that runs in real time: a real robot, an emulated robot, or a running simulator."""

    is_timed = True

    def __init__(self, config: PlantConfig, hand: PlanarHand) -> None:
        super().__init__(config, hand, SceneListener(config, hand))
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
