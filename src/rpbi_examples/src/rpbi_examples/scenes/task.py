"""Runs scenes in this process: as tasks of Gymnasium environments, and as single episodes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from pydantic import Field

from custom_ros_tools import schema
from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.schema import Fraction, Position, Positive, Text
from robot_model.geometry import Pose
from rpbi.gym.actions import ActionPart, JointAction, PoseAction
from rpbi.gym.env import WorldEnv
from rpbi.gym.parts import FARTHEST, ObservationPart, pose_part, robot_of
from rpbi.gym.task import WorldTask, WorldTaskConfig
from rpbi.sensors.tracking.april_tags import AprilTagsSensor
from rpbi.world import World

from . import SCENES
from .scene import (
    Change,
    GainChange,
    InputValue,
    Scene,
    SceneFailedError,
    SceneResult,
    Seen,
    SeenWrench,
    Shove,
    Stage,
    Switch,
    Teleport,
    Touch,
    Watched,
    WorldChange,
    run_scene,
    tag_in_world,
)

TASK = "rpbi_examples.scenes.task:SceneTask"


class SceneTaskConfig(WorldTaskConfig):
    """Options of `SceneTask`."""

    scene: Text = Field(description="Scene: a name in `SCENES`, or `module:Class`.")
    noise: schema.Switch = Field(False, description="Whether measured poses have noise and delay.")
    low: Position = Field(
        (-2.0, -2.0, -1.0), description="Lower corner of the region in which bodies are observed, in the world frame."
    )
    high: Position = Field(
        (2.0, 2.0, 3.0), description="Upper corner of the region in which bodies are observed, in the world frame."
    )
    speed: Fraction = Field(0.5, description="Largest joint speed, as a fraction of the velocity limits in the URDF.")
    hand_speed: Positive = Field(0.25, description="Largest speed of a hand along each axis [m/s].")
    turn_speed: Positive = Field(1.0, description="Largest angular speed of a hand about each axis [rad/s].")


class SceneTask(WorldTask):
    """Task of a Gymnasium environment that runs a scene. An action moves the scene's robots.

    The action None moves no robot. `run_scene` steps the environment with None, and moves all robots with `Scene.act`.
    """

    Config = SceneTaskConfig
    needs_action = False

    def __init__(self, world: World, config: SceneTaskConfig) -> None:
        super().__init__(world, config)
        self._kind: type[Scene] = SCENES.find(config.scene)
        self.scene = self._kind(np.random.default_rng(0))
        """The scene of this episode."""
        self.seed: int | None = None
        """Seed of later scenes; without one, their random numbers are those of the environment."""
        self._start_tick = 0
        self._beside: Iterator[None] | None = None
        self._has_failed = False

    @property
    def max_actions(self) -> int:
        """Number of actions after which an episode is truncated: by default those of the scene's longest duration."""
        if "max_actions" in self.config.model_fields_set:
            return int(self.config.max_actions)
        return math.ceil(self._kind.longest_s / self.period_s)

    def actions(self) -> Sequence[ActionPart]:
        """Returns the parts of the action: a hand motion for each entry of `Scene.hands`, and joint motions for each
        robot without such a hand. Robots in `Scene.others` have no part.
        """
        config, period_s, hands = self.config, self.period_s, self._kind.hands
        led = {*self._kind.others, *(controller.partition("/")[0] for controller in hands)}
        step, turn = config.hand_speed * period_s, config.turn_speed * period_s
        moved = [robot for robot in self._kind.watch.robots if robot not in led]
        return [
            *(JointAction(self.world, each, (), config.speed, period_s) for each in moved),
            *(PoseAction(self.world, each, link, config.low, config.high, step, turn) for each, link in hands.items()),
        ]

    def parts(self) -> Iterator[ObservationPart]:
        """Yields the parts of an observation.

        These are the base class's parts, the poses of the scene's bodies, and `Scene.goal_numbers` as `goal`.
        """
        yield from super().parts()
        for name in self._kind.watch.bodies:
            yield pose_part(self.world, name, self.config.low, self.config.high)
        if count := len(self.scene.goal_numbers):
            yield ObservationPart("goal", (-FARTHEST,) * count, (FARTHEST,) * count, lambda: self.scene.goal_numbers)

    def reset(self, random: np.random.Generator) -> None:
        """Creates a new scene, and prepares the scene's episode. If `seed` is set, a generator with this seed replaces
        `random`.
        """
        self.scene = self._kind(random if self.seed is None else np.random.default_rng(self.seed))
        self._start_tick = self.world.clock.tick
        self._beside, self._has_failed = None, False
        self.scene.is_noisy = self.config.noise
        self.scene.prepare()
        self._do_all()
        self.scene.seen = self._see()
        super().reset(random)

    def act(self, action: np.ndarray | None) -> None:
        """Moves the robots that the action controls; `Scene.beside` moves the other robots. None commands nothing."""
        if action is not None:
            self._beside = self._beside or self.scene.beside()
            super().act(action)

    def reward(self) -> float:
        """Lets the scene observe the world after an action, and returns the newly completed share of the task."""
        before, _ = self.scene.score()
        self.scene.look(self._see())
        try:
            next(self._beside or iter(()), None)
        except SceneFailedError:
            self._has_failed = True
        self._do_all()
        done, of = self.scene.score()
        return (done - before) / of

    def has_succeeded(self) -> bool:
        """Returns whether the scene has succeeded."""
        return self.scene.has_succeeded()

    def has_ended(self) -> bool:
        """Returns True if the scene has succeeded, or if it can no longer succeed."""
        return self._has_failed or self.has_succeeded()

    def _see(self) -> Seen:
        time_s = (self.world.clock.tick - self._start_tick) * self.world.clock.dt_s
        return see(self.world, self._kind.watch, time_s)

    def _do_all(self) -> None:
        for change in self.scene.take_changes():
            do(self.world, change)


class EnvStage(Stage):
    """Connects a scene to the world of an environment in this process.

    Args:
        env: Environment with a `SceneTask`.
    """

    def __init__(self, env: WorldEnv) -> None:
        self._env = env

    def do(self, change: WorldChange) -> None:
        do(self._env.world, change)

    def cycle(self) -> None:
        self._env.step(None)


def make_env(scene: str, render_mode: str | None = None, noise: bool = False) -> WorldEnv:
    """Creates an environment for a scene.

    Args:
        scene: Name in `SCENES`, or `module:Class`.
        render_mode: Render mode of the environment, as in Gymnasium.
        noise: Whether poses are sensed with noise and delay.

    Raises:
        UnknownNameError: If the scene does not exist.
        MissingDependency: If an optional dependency of the scene is not installed.
    """
    kind = SCENES.find(scene)
    task = {"type": TASK, "scene": scene, "action_ticks": kind.cycle_ticks, "noise": noise}
    return WorldEnv(kind.world, task, render_mode=render_mode)


def run_episode(env: WorldEnv, seed: int) -> SceneResult:
    """Runs an episode of a scene in the scene's environment, and returns the result.

    The same seed leads to the same episode in the scene's launch file.

    Raises:
        InterfaceError: If the world fails, or rejects a change.
    """
    assert isinstance(env.task, SceneTask)
    env.task.seed = seed
    env.reset(seed=seed)
    return run_scene(env.task.scene, EnvStage(env))


def see(world: World, watch: Watched, time_s: float) -> Seen:
    """Observes a world in this process.

    Args:
        world: The world.
        watch: Robots, bodies and sensors to observe.
        time_s: Time since the start of the episode [s].
    """
    tick = world.clock.tick
    joints = {}
    for name in watch.robots:
        robot = robot_of(world, name)
        names = {joint.index: joint.name for joint in robot.model.moving}
        joints[name] = {names[index]: position for index, position in robot.joint_positions().items()}
    wrenches = {}
    for name in watch.wrenches:
        sensors = robot_of(world, name.partition("/")[0]).force_torque_sensors
        sample = next(sensor for sensor in sensors if sensor.name == name).read(tick)
        wrenches[name] = SeenWrench(sample.force, sample.torque) if sample else SeenWrench()
    contacts = {
        name: tuple(
            Touch(point.other_body, point.other_link, point.position, point.normal, point.normal_force, point.force)
            for point in world.contacts.sample(world.bodies[name], tick).points
        )
        for name in watch.contacts
    }
    poses = {name: world.bodies[name].base_pose() for name in watch.bodies if name in world.bodies}
    tags = dict(_tags(world, watch)) if watch.tags else {}
    return Seen(time_s, joints, {name: Pose(*pose) for name, pose in poses.items()}, wrenches, contacts, tags)


def _tags(world: World, watch: Watched) -> Iterator[tuple[int, Pose]]:
    """Yields number and world pose of each detected tag. Only uses cameras with a pose in `world.config.poses`."""
    frames = {each.tf_id: Pose(*each.pose) for each in world.config.poses}
    for sensor in (sensor for name in world.bodies for sensor in world.sensors_of(name)):
        if isinstance(sensor, AprilTagsSensor) and sensor.topic in watch.tags:
            sample = sensor.read(world.clock.tick)
            camera = frames.get(world.cameras[sensor.config.camera].config.object_tf.tf_id)
            if sample is not None and camera is not None:
                yield from ((tag.id, tag_in_world(camera, Pose(*tag.pose))) for tag in sample.tags)


def do(world: World, change: WorldChange) -> None:
    """Applies a change to a world in this process, before the world's next tick.

    Raises:
        InterfaceError: If the world rejects the change.
    """
    try:
        _do(world, change)
    except ValueError as error:
        raise InterfaceError(f"{type(change).__name__} {change[0]}: {error}") from None


def _do(world: World, change: WorldChange) -> None:
    if isinstance(change, InputValue):
        world.put(change.slot, change.value)
    elif isinstance(change, Teleport):
        world.act(change.name, "teleport", change.pose)
    elif isinstance(change, Shove):
        name, _, link = change.target.partition("/")
        world.act(name, "push", {"force": change.force, "link": link, "duration_s": change.duration_s})
    elif isinstance(change, Change):
        world.change_dynamics(change.target, change.values)
    elif isinstance(change, Switch):
        world.act(change.robot, "switch_controllers", {"start": change.start, "stop": change.stop})
    elif isinstance(change, GainChange):
        robot, _, name = change.target.partition("/")
        config = robot_of(world, robot).controllers.config(name)
        changed = type(config).parse({**config.model_dump(exclude_unset=True), **change.values}, change.target)
        world.act(robot, "set_controller_gains", {"name": name, "config": changed})
    else:
        world.remove(change.name)
