"""Drives the joints of one robot: its motors, and the targets or the motion that they follow."""

from collections.abc import Callable, Iterable

import pybullet

from rpbi.engine.client import Client
from rpbi.urdf.joints import JointModel

from .motion import JointMotion, Motion
from .motors import POSITION_MODES, Motors, ResolvedCommand
from .target_stream import TargetStreams


class JointDrive:
    """Follows targets, and runs at most one motion of a robot at a time; a newer one replaces it.

    Args:
        interpolation: Interpolation between position targets of a stream: `hold`, `linear` or `smooth`.
        buffer_s: Longest delay of targets by the jitter buffer [s].

    Attributes:
        dt_s: Length of a tick [s].
        motion: The motion that runs, if any.
    """

    def __init__(
        self,
        name: str,
        pb: Client,
        body_id: int,
        model: JointModel,
        motors: Motors,
        interpolation: str,
        buffer_s: float,
    ) -> None:
        self.name = name
        self.model = model
        self.motors = motors
        self.dt_s: float = pb.getPhysicsEngineParameters()["fixedTimeStep"]
        self.motion: Motion | None = None
        self._pb, self._body_id = pb, body_id
        self._has_begun = False
        self.controlled: Callable[[], frozenset[int]] = frozenset
        """Returns the joints that a controller drives."""
        self._interpolates = interpolation != "hold"
        self._streams = TargetStreams(motors, name, self.dt_s, interpolation == "smooth", buffer_s)

    def follow(self, commands: Iterable[ResolvedCommand]) -> None:
        """Follows targets from now on, unless the control mode has changed since they were checked."""
        if self._interpolates and self.motors.mode in POSITION_MODES:
            self._streams.follow(commands)
        else:
            for command in commands:
                self.motors.follow(command)

    def drop_targets(self, joints: Iterable[int] | None = None) -> None:
        """Drops the streams of targets of joints, or all targets."""
        if joints is None:
            self._streams.clear()
        else:
            self._streams.drop(joints)

    def measured(self) -> JointMotion:
        """Returns measured position [rad or m] and velocity [rad/s or m/s] of each driven joint by index."""
        indices = [joint.index for joint in self.model.driven]
        states = self._pb.getJointStates(self._body_id, indices) if indices else ()
        return {index: (state[0], state[1]) for index, state in zip(indices, states)}

    def run(self, motion: Motion) -> None:
        """Starts a motion; one that runs is ended with a reason.

        Raises:
            ValueError: If the robot is under torque control, or a controller drives one of its joints.
        """
        if self.motors.mode == pybullet.TORQUE_CONTROL:
            raise ValueError("the robot is under TORQUE_CONTROL, which cannot hold a position")
        if taken := self.controlled() & motion.joints:
            names = ", ".join(self.model.joints[index].name for index in sorted(taken))
            raise ValueError(f"a controller drives {names} until it is stopped")
        self.halt("a newer motion replaced it")
        self._streams.drop(motion.joints)
        self.motion, self._has_begun = motion, False

    def halt(self, reason: str) -> None:
        """Ends the motion that runs, if any; its joints hold where they are."""
        if self.motion is not None:
            measured = self.measured()
            self.motion.halt(reason, measured)
            for index in self.motion.joints:
                self.motors.track(index, measured[index][0], 0.0)
            self._end(self.motion)

    @property
    def is_idle(self) -> bool:
        """Whether neither a target nor a motion moves the set points."""
        return self.motion is None and self._streams.rest

    def advance(self, tick: int) -> None:
        """Sets the motors to the positions of targets and motion after this tick."""
        motion = self.motion
        self._streams.advance(tick, frozenset() if motion is None else motion.joints)
        if motion is None:
            return
        measured = self.measured()
        if not self._has_begun:
            motion.begin(tick * self.dt_s, measured)
            self._has_begun = True
        for index, (position, velocity) in motion.advance((tick + 1) * self.dt_s, measured).items():
            self.motors.track(index, position, velocity)
        if motion.is_over:
            self._end(motion)

    def _end(self, motion: Motion) -> None:
        self.motion = None
        self.motors.release(motion.joints)
