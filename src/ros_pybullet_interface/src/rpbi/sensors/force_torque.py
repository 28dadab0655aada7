"""Force-torque sensors in the joints of a robot."""

import math
import zlib
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from custom_ros_tools.errors import PhysicsError
from robot_model.geometry import Vector, cross, minus, plus, scaled
from rpbi.config.sensors import ForceTorqueConfig
from rpbi.geometry import LinkWrench, rotated_back
from rpbi.samples import WrenchSample
from rpbi.urdf.joints import Joint
from rpbi.urdf.subtree import LinkStates, Subtree

from .filters import LowPass, SeededNoise, Zeroing
from .sensor import SensedBody, SensedWorld, Sensor


class ForceTorqueSensor(Sensor):
    """Measures the force and the moment that a joint transmits; the moment is about the joint's origin.

    Force and moment are in the axes of the URDF frame of the joint's child link.

    PyBullet's own measurement lacks the motors' efforts (bullet3 issues 2966, 3204, 4451, 4604), and would still be
    wrong if they were added, see docs/force_torque.md. This sensor computes the wrench from an impulse balance
    (Newton-Euler) for all links below the joint. The wrench is the rate of change of these links' momentum during the
    last tick, minus their weight and minus all contact, attachment and external forces. The balance holds for all types
    of joints, control modes and limits.

    Args:
        default_hz: Rate [Hz] of the sensor if the configuration has no rate.
    """

    Config = ForceTorqueConfig
    sample_type = WrenchSample
    ros_topic = "rpbi.ros.publishers.sample_topics:WRENCH"

    def __init__(self, robot: SensedBody, joint: Joint, config: ForceTorqueConfig, default_hz: float) -> None:
        super().__init__(f"{robot.name}/{joint.name}", config.hz or default_hz)
        self.joint = joint
        self.frame_id = config.frame_id or f"rpbi/{robot.name}/{joint.link}"
        self._robot = robot
        self._subtree = Subtree(robot.pb, robot.body_id, joint.index)
        self._dynamics_changes = robot.dynamics_changes
        self._dt_s: float = robot.pb.getPhysicsEngineParameters()["fixedTimeStep"]
        self._gravity = robot.pb.gravity
        self._contact_factor = 1
        """PyBullet divides the impulse of the last sub-step by the whole time step."""
        self._sign = 1.0 if config.acting == "parent_on_child" else -1.0
        self._noise = SeededNoise(
            zlib.crc32(self.name.encode()) if config.seed is None else config.seed,
            config.noise_force_n + config.noise_torque_nm,
            config.bias_force_n + config.bias_torque_nm,
        )
        self._low_pass = LowPass(config.low_pass_hz, self._dt_s) if config.low_pass_hz else None
        self._offset: npt.NDArray[np.float64] = np.zeros(6)
        self._zeroing: Zeroing | None = None
        self._before: LinkStates | None = None
        self._sample: WrenchSample | None = None

    def enter(self, world: SensedWorld) -> None:
        """Stores the world's attachments."""
        self._attachments = world.attachments

    def before_step(self, tick: int) -> None:
        """Stores the states of the links, gravity and the number of sub-steps."""
        self._gravity, self._contact_factor = self._robot.pb.gravity, max(1, self._robot.pb.sub_steps)
        if self._dynamics_changes != self._robot.dynamics_changes:
            self._dynamics_changes = self._robot.dynamics_changes
            self._subtree.update_dynamics()
        self._before = self._subtree.states()
        self._sample = None

    def after_step(self, tick: int) -> None:
        """Updates the low-pass filter, at every tick regardless of the sensor's rate."""
        if self._low_pass is not None and self._before is not None:
            self._low_pass.step(self._wrench(self._before, tick))

    def read(self, tick: int) -> WrenchSample | None:
        """Returns the wrench of the last tick; None before the first tick."""
        if self._sample is None and self._before is not None:
            self._sample = self._measure(self._before, tick)
        return self._sample

    def _loads(self) -> Iterator[LinkWrench]:
        """Yields the wrenches that acted in the last tick on links below the joint.

        These are the wrenches that attachments exerted, and the external wrenches.
        """
        for load in (*self._attachments.loads_on(self._robot.name), *self._robot.external_wrenches.loads):
            if load.link in self._subtree.links:
                yield load

    def zero(self, count: int) -> Zeroing:
        """Starts and returns a `Zeroing` over the next `count` samples; if one is already running, returns that one."""
        if self._zeroing is None:
            self._zeroing = Zeroing(count)
        return self._zeroing

    def cancel_zeroing(self) -> None:
        """Cancels a running zeroing; the sensor keeps its old zero."""
        self._zeroing = None

    def _measure(self, before: LinkStates, tick: int) -> WrenchSample:
        filtered = None if self._low_pass is None else self._low_pass.output
        shown = (self._wrench(before, tick) if filtered is None else filtered) + self._noise.at(tick)
        if self._zeroing is not None:
            self._zeroing.add(shown)
            if self._zeroing.mean.done():
                self._offset = self._zeroing.mean.result()
                self._zeroing = None
        x, y, z, about_x, about_y, about_z = (shown - self._offset).tolist()
        return WrenchSample(self.name, self.frame_id, (x, y, z), (about_x, about_y, about_z))

    def _wrench(self, before: LinkStates, tick: int) -> npt.NDArray[np.float64]:
        """Returns force and moment as 6 numbers, averaged over the last tick.

        The formulas are F = dp/dt - m g - f and M = dL/dt + v x p - s x g - t. Here, p is the momentum of the links
        below the joint, L their angular momentum about the joint's origin, v the velocity of that origin, s the first
        moment of mass, m g the weight, and (f, t) are all other loads.

        Args:
            before: States of the links before the tick.
            tick: Number of the tick, for the error message.

        Raises:
            PhysicsError: If the result is not finite.
        """
        old, new = self._subtree.momentum(before), self._subtree.momentum(self._subtree.states())
        contact_force, contact_moment = self._subtree.contact_wrench(old.origin)
        weight = scaled(self._subtree.mass_kg, self._gravity)
        force = minus(scaled(1.0 / self._dt_s, minus(new.linear, old.linear)), weight)
        moment = scaled(1.0 / self._dt_s, minus(new.angular, old.angular))
        moment = plus(moment, cross(_mean(old.origin_velocity, new.origin_velocity), _mean(old.linear, new.linear)))
        moment = minus(moment, cross(_mean(old.mass_moment, new.mass_moment), self._gravity))
        force = minus(force, scaled(self._contact_factor, contact_force))
        moment = minus(moment, scaled(self._contact_factor, contact_moment))
        for load in self._loads():
            force = minus(force, load.force)
            moment = minus(moment, plus(load.torque, cross(minus(load.point, new.origin), load.force)))
        if not math.isfinite(sum(force) + sum(moment)):
            raise PhysicsError(f"{self.name}: wrench is not finite any more at tick {tick}: {force}, {moment}")
        quat = new.quat_xyzw
        return self._sign * np.array(rotated_back(quat, force) + rotated_back(quat, moment))


def _mean(a: Vector, b: Vector) -> Vector:
    return scaled(0.5, plus(a, b))
