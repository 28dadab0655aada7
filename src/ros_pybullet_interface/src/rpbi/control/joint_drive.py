"""Drives the joints of one robot: its motors, and the motion that sets their targets."""

import pybullet

from rpbi.engine.client import Client
from rpbi.urdf.joints import JointModel

from .motion import JointMotion, Motion
from .motors import Motors


class JointDrive:
    """Runs at most one motion of a robot at a time; a newer one replaces it.

    Attributes:
        dt_s: Length of a tick [s].
        motion: The motion that runs, if any.
    """

    def __init__(self, name: str, pb: Client, body_id: int, model: JointModel, motors: Motors) -> None:
        self.name = name
        self.model = model
        self.motors = motors
        self.dt_s: float = pb.getPhysicsEngineParameters()["fixedTimeStep"]
        self.motion: Motion | None = None
        self._pb, self._body_id = pb, body_id
        self._has_begun = False

    def measured(self) -> JointMotion:
        """Returns measured position [rad or m] and velocity [rad/s or m/s] of each driven joint by index."""
        indices = [joint.index for joint in self.model.driven]
        states = self._pb.getJointStates(self._body_id, indices) if indices else ()
        return {index: (state[0], state[1]) for index, state in zip(indices, states)}

    def run(self, motion: Motion) -> None:
        """Starts a motion; one that runs is ended with a reason.

        Raises:
            ValueError: If the robot is under torque control.
        """
        if self.motors.mode == pybullet.TORQUE_CONTROL:
            raise ValueError("the robot is under TORQUE_CONTROL, where nothing holds it to a position")
        self.halt("a newer motion replaced it")
        self.motion, self._has_begun = motion, False

    def halt(self, reason: str) -> None:
        """Ends the motion that runs, if any; its joints hold where they are."""
        if self.motion is not None:
            measured = self.measured()
            self.motion.halt(reason, measured)
            for index in self.motion.joints:
                self.motors.track(index, measured[index][0], 0.0)
            self._end(self.motion)

    def advance(self, tick: int) -> None:
        """Sets the motors to where the motion is to be after this tick; does nothing without a motion."""
        motion = self.motion
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
