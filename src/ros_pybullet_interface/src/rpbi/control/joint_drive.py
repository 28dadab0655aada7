"""Drives the joints of one robot: motors follow streamed targets or a motion."""

from collections.abc import Callable, Iterable

import pybullet

from rpbi.engine.client import Client
from rpbi.urdf.joints import JointModel

from .motion import JointMotion, Motion
from .motors import POSITION_MODES, Motors, ResolvedCommand
from .target_stream import TargetStreams


class JointDrive:
    """Makes the joints of one robot follow streamed targets, and runs at most one motion at a time.

    A new motion replaces the present one.

    Args:
        interpolation: Interpolation between streamed position targets: `hold`, `linear` or `smooth`.
        buffer_s: Delay of the jitter buffer [s]; 0 plays targets as they come.

    Attributes:
        dt_s: Length of a tick [s].
        motion: The running motion; None if there is no motion.
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
        """Function that returns PyBullet's indices of the joints that a controller drives."""
        self._interpolates = interpolation != "hold"
        self._streams = TargetStreams(motors, name, self.dt_s, interpolation == "smooth", buffer_s)

    def follow(self, commands: Iterable[ResolvedCommand]) -> None:
        """Accepts new targets for the joints. Targets that were checked for an earlier control mode are ignored."""
        if self._interpolates and self.motors.mode in POSITION_MODES:
            self._streams.follow(commands)
        else:
            for command in commands:
                self.motors.follow(command)

    def drop_targets(self, joints: Iterable[int] | None = None) -> None:
        """Drops each target stream that contains one of `joints`; the other joints of these streams hold.

        Args:
            joints: Joint indices. None drops all streams and all waiting targets; all joints then hold.
        """
        if joints is None:
            self._streams.clear()
        else:
            self._streams.drop(joints)

    def measured(self) -> JointMotion:
        """Returns the measured position [rad or m] and velocity [rad/s or m/s] of each driven joint, keyed by index."""
        indices = [joint.index for joint in self.model.driven]
        states = self._pb.getJointStates(self._body_id, indices) if indices else ()
        return {index: (state[0], state[1]) for index, state in zip(indices, states)}

    def run(self, motion: Motion) -> None:
        """Starts a motion at the next tick, and halts the running motion, if there is one.

        Raises:
            ValueError: If the robot is under torque control, or a controller drives a joint of the motion.
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
        """Ends the running motion, if there is one; the motion's joints hold their positions.

        Args:
            reason: Why the motion ends; becomes part of the message in the motion's result.
        """
        if self.motion is not None:
            measured = self.measured()
            self.motion.halt(reason, measured)
            for index in self.motion.joints:
                self.motors.track(index, measured[index][0], 0.0)
            self._end(self.motion)

    @property
    def is_idle(self) -> bool:
        """Whether neither a target stream nor a motion changes the set points."""
        return self.motion is None and self._streams.rest

    def advance(self, tick: int) -> None:
        """Advances the target streams and the motion by a tick, and commands the motors accordingly."""
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
