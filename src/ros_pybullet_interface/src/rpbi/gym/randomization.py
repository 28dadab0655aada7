"""Varies a world randomly from episode to episode, as configured in YAML."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, Field

from custom_ros_tools.config import load_config
from custom_ros_tools.errors import ConfigError, InterfaceError, Problem
from custom_ros_tools.schema import ConfigModel, ListOf, Name, NonNegative, Text, Unit, Vec3
from rpbi.geometry import Pose
from rpbi.world import World

from .parts import robot_of


def _ordered(value: tuple[float, float]) -> tuple[float, float]:
    if value[0] > value[1]:
        raise ValueError(f"expected [lowest, highest], got {list(value)}")
    return value


Range = Annotated[tuple[float, float], Field(strict=False), AfterValidator(_ordered)]
PositiveRange = Annotated[
    tuple[NonNegative, NonNegative], Field(strict=False), AfterValidator(_ordered), Unit("lowest, highest")
]


class DynamicsVariation(ConfigModel):
    """Random dynamics of a body or a link; each number is drawn uniformly from its range once per episode."""

    object: Text = Field(description="Body, or one of its links as `NAME/LINK`.")
    mass: PositiveRange | None = Field(None, description="Range of the mass [kg]. By default, the mass is not changed.")
    mass_factor: PositiveRange | None = Field(None, description="Range of the factor by which the mass is multiplied.")
    lateralFriction: PositiveRange | None = Field(None, description="Range of the Coulomb friction coefficient.")
    spinningFriction: PositiveRange | None = Field(
        None, description="Range of the coefficient of friction against rotation about the contact normal."
    )
    rollingFriction: PositiveRange | None = Field(
        None, description="Range of the coefficient of friction against rolling."
    )
    restitution: PositiveRange | None = Field(None, description="Range of the coefficient of restitution.")
    linearDamping: PositiveRange | None = Field(
        None, description="Range of the fraction of the linear velocity that is lost per second."
    )
    angularDamping: PositiveRange | None = Field(
        None, description="Range of the fraction of the angular velocity that is lost per second."
    )
    jointDamping: PositiveRange | None = Field(None, description="Range of the joint's damping [N m s/rad or N s/m].")

    def apply(self, world: World, random: np.random.Generator) -> None:
        """Sets the dynamics to random values."""
        ranges = {key: each for key in type(self).model_fields if key != "object" and (each := getattr(self, key))}
        values = {key: float(random.uniform(*each)) for key, each in ranges.items()}
        if "mass_factor" in values:
            values["mass"] = values.pop("mass_factor") * world.dynamics(self.object).mass
        world.change_dynamics(self.object, values)


class PoseVariation(ConfigModel):
    """Random start pose of a body: offsets from the configured pose."""

    object: Name = Field(description="Name of the body.")
    position: Annotated[Vec3, Unit("m")] = Field(
        (0.0, 0.0, 0.0), description="Largest offsets along the world's x, y and z axes, in both directions."
    )
    yaw: Annotated[NonNegative, Unit("rad")] = Field(
        0.0, description="Largest rotation about the vertical, in both directions."
    )

    def apply(self, world: World, random: np.random.Generator) -> None:
        """Moves the body to a random pose."""
        pose = world.bodies[self.object].base_pose()
        offset, yaw = random.uniform(-1.0, 1.0, 3) * self.position, random.uniform(-self.yaw, self.yaw)
        turn = Pose((0.0, 0.0, 0.0), (0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)))
        position = tuple((np.array(pose.position) + offset).tolist())
        world.act(self.object, "teleport", Pose(position, (turn @ pose).quat_xyzw))


class JointVariation(ConfigModel):
    """Random start positions of a robot's driven joints: offsets from the configured positions, within the limits."""

    robot: Name = Field(description="Name of the robot.")
    offset: Annotated[NonNegative, Unit("rad or m")] = Field(
        description="Largest offset of a joint position, in both directions."
    )
    joints: ListOf[Text] = Field((), description="Names of the joints. By default, all joints with motors.")

    def apply(self, world: World, random: np.random.Generator) -> None:
        """Moves the joints to random positions."""
        body = robot_of(world, self.robot)
        starts = body.joint_positions()
        chosen = [body.model[name] for name in self.joints] or body.model.driven
        offsets = random.uniform(-self.offset, self.offset, len(chosen)).tolist()
        positions = {each.name: each.nearest_allowed(starts[each.index] + by) for each, by in zip(chosen, offsets)}
        world.act(self.robot, "set_joint_state", positions)


class CameraVariation(ConfigModel):
    """Random pose of a camera: offsets from the pose that the camera had when the environment was created."""

    camera: Name = Field(description="Name of the camera.")
    position: Annotated[Vec3, Unit("m")] = Field(
        (0.0, 0.0, 0.0), description="Largest offsets along the world's x, y and z axes, in both directions."
    )
    rotation: Annotated[NonNegative, Unit("rad")] = Field(0.0, description="Largest rotation, about a random axis.")

    def drawn(self, pose: Pose, random: np.random.Generator) -> Pose:
        """Returns a random pose near `pose`."""
        offset, angle = random.uniform(-1.0, 1.0, 3) * self.position, random.uniform(-self.rotation, self.rotation)
        axis = random.normal(size=3)
        axis *= math.sin(angle / 2) / np.linalg.norm(axis)
        quat = tuple([*axis.tolist(), math.cos(angle / 2)])
        position = tuple((np.array(pose.position) + offset).tolist())
        return Pose(position, (Pose((0.0, 0.0, 0.0), quat) @ pose).quat_xyzw)


class Delays(ConfigModel):
    """Random delays, rounded to ticks; each is drawn uniformly from its range once per episode."""

    observation_s: PositiveRange = Field((0.0, 0.0), description="Range of the age of observations [s].")
    action_s: PositiveRange = Field((0.0, 0.0), description="Range of the time until an action takes effect [s].")

    def drawn(self, random: np.random.Generator, tick_s: float) -> tuple[int, int]:
        """Draws the delays [ticks] of observations and of actions."""
        observation_s, action_s = (random.uniform(*each) for each in (self.observation_s, self.action_s))
        return round(observation_s / tick_s), round(action_s / tick_s)


class Randomization(ConfigModel):
    """Configuration of everything that varies from episode to episode."""

    dynamics: ListOf[DynamicsVariation] = Field((), description="Variations of the dynamics of bodies and links.")
    poses: ListOf[PoseVariation] = Field((), description="Variations of the start poses of bodies.")
    joints: ListOf[JointVariation] = Field((), description="Variations of the start positions of joints.")
    cameras: ListOf[CameraVariation] = Field((), description="Variations of the poses of cameras.")
    delays: Delays = Field(Delays(), description="Random delays of observations and actions.")

    @classmethod
    def read(cls, given: str | Mapping[str, Any] | None) -> Randomization:
        """Reads the configuration from a YAML file or a mapping; None means that nothing varies.

        Raises:
            ConfigError: If a key or value is not valid.
        """
        if given is None:
            return cls()
        if isinstance(given, str):
            return cls.parse(load_config(given), given)
        return cls.parse(given, "randomization")


class Randomizer:
    """Varies a world from episode to episode.

    Args:
        world: The world, before its first tick.
        config: Configuration of the variation.
        file: Name of the configuration file, for messages.

    Raises:
        ConfigError: If a configured object is not in the world, or cannot be varied as configured.
    """

    def __init__(self, world: World, config: Randomization, file: str) -> None:
        self._world, self._config = world, config
        self._check(file)
        self._camera_poses = {name: camera.pose for name, camera in world.cameras.items()}

    def apply(self, random: np.random.Generator) -> tuple[int, int]:
        """Varies the world, which was just reset.

        Returns:
            Delays [ticks] of observations and of actions.
        """
        for each in self._in_world():
            each.apply(self._world, random)
        for camera in self._config.cameras:
            pose = self._camera_poses[camera.camera]
            assert pose is not None
            self._world.put(f"{camera.camera}/pose", camera.drawn(pose, random))
        return self._config.delays.drawn(random, self._world.clock.dt_s)

    def _in_world(self) -> Sequence[DynamicsVariation | PoseVariation | JointVariation]:
        return (*self._config.dynamics, *self._config.poses, *self._config.joints)

    def _check(self, file: str) -> None:
        """Applies each variation of bodies once as a test, checks the names of cameras, and then resets the world."""
        problems = list(self._problems(file))
        self._world.reset()
        if problems:
            raise ConfigError(problems)

    def _problems(self, file: str) -> Iterator[Problem]:
        random = np.random.default_rng(0)
        for section in ("dynamics", "poses", "joints"):
            for index, each in enumerate(getattr(self._config, section)):
                key = "robot" if section == "joints" else "object"
                try:
                    name = getattr(each, key)
                    self._world.dynamics(name)
                    each.apply(self._world, random)
                except (InterfaceError, ValueError, AttributeError) as error:
                    yield Problem(file, f"{section}[{index}]", str(error))
        for index, camera in enumerate(self._config.cameras):
            known = [name for name, each in self._world.cameras.items() if each.pose is not None]
            if camera.camera not in known:
                message = f"expected one of {', '.join(known) or 'none with a pose'}; got '{camera.camera}'"
                yield Problem(file, f"cameras[{index}].camera", message)
