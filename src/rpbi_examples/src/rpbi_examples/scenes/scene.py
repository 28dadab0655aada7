"""The base class of scenes. A scene observes and changes a world, in this process or in a running simulator."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from itertools import chain
from typing import ClassVar, NamedTuple

import numpy as np

from custom_ros_tools.errors import InterfaceError
from robot_model.geometry import ZERO, Pose, Vector, normalized

from .sensing import SensedPoses

MEASURE_S = 0.5
"""Time in which the noisy poses of resting objects are averaged at the start of an episode [s]."""
TAG_DIGITS = 6
"""Decimal digits to which poses of tags are rounded [m]. The noise of detectors is far larger."""


class Watched(NamedTuple):
    """Names of the robots, bodies and sensors that a scene observes.

    The rates in the YAML files of bodies and sensors must equal the rate of the scene's cycles.

    Attributes:
        robots: Robots whose joint positions are observed.
        bodies: Bodies whose poses are observed, at the rate `base_state_hz` in YAML.
        wrenches: Names of force-torque sensors, as `ROBOT/JOINT`.
        contacts: Bodies whose contact forces are observed, at the rate `contacts: {hz: ...}` in YAML.
        tags: AprilTag detectors without latency, observed at the rate `hz` in YAML. A detector is named by its `topic`.
    """

    robots: tuple[str, ...]
    bodies: tuple[str, ...] = ()
    wrenches: tuple[str, ...] = ()
    contacts: tuple[str, ...] = ()
    tags: tuple[str, ...] = ()


class SeenWrench(NamedTuple):
    """Force [N] and torque [N m] of a force-torque sensor."""

    force: Vector = ZERO
    torque: Vector = ZERO


class Touch(NamedTuple):
    """A contact point of a body.

    Attributes:
        other: Name of the other body in the contact.
        other_link: Link of the other body.
        position: Position of the contact in the world [m].
        normal: Unit vector of the contact's normal, towards the body.
        normal_force: Force along the normal [N].
        force: Total force on the body, including friction [N].
    """

    other: str
    other_link: str
    position: Vector
    normal: Vector
    normal_force: float
    force: Vector = ZERO


class Seen(NamedTuple):
    """Observation of the world at the end of a cycle.

    Attributes:
        time_s: Time since the start of the episode [s].
        joints: Joint positions [rad or m], indexed by robot and then by joint name.
        poses: Poses of the bodies' URDF frames in the world, indexed by body.
        wrenches: Wrenches in the axes of the joint's child link, indexed by `ROBOT/JOINT`.
        contacts: Contact points, indexed by body.
        tags: Poses of the detected AprilTags in the world, indexed by tag number. z points out of the tag.
    """

    time_s: float = 0.0
    joints: Mapping[str, Mapping[str, float]] = {}
    poses: Mapping[str, Pose] = {}
    wrenches: Mapping[str, SeenWrench] = {}
    contacts: Mapping[str, tuple[Touch, ...]] = {}
    tags: Mapping[int, Pose] = {}


class InputValue(NamedTuple):
    """Value for an input of the world at the next tick; see `World.put`.

    The value is a pose, or numbers indexed by name, such as joint targets.
    """

    slot: str
    value: Mapping[str, float] | Pose


class Teleport(NamedTuple):
    """Moves a body to a pose in one step, and sets the body's velocity to 0."""

    name: str
    pose: Pose


class Shove(NamedTuple):
    """Applies a force to the origin of a link for some time.

    Attributes:
        target: The link, as `NAME` (base link) or `NAME/LINK`.
        force: Force in the axes of the world [N].
        duration_s: Duration [s].
    """

    target: str
    force: Vector
    duration_s: float


class Change(NamedTuple):
    """Changes dynamics parameters of a body or a link.

    Attributes:
        target: `NAME` or `NAME/LINK`.
        values: New values, indexed by the keys of `changeDynamics`, such as `mass`.
    """

    target: str
    values: Mapping[str, float]


class Switch(NamedTuple):
    """Stops and starts controllers of a robot, all at the same tick."""

    robot: str
    start: tuple[str, ...]
    stop: tuple[str, ...]


class GainChange(NamedTuple):
    """Changes configuration values of a controller `ROBOT/CONTROLLER`, like the controller's service `set_gains`."""

    target: str
    values: Mapping[str, float | Vector]


class Removal(NamedTuple):
    """Removes a body from the world."""

    name: str


WorldChange = InputValue | Teleport | Shove | Change | Switch | GainChange | Removal
"""A change that a scene requests for its world."""


class SceneFailedError(InterfaceError):
    """Ends the episode as failed: the robots cannot continue, for instance because a target is out of reach."""


class Scene(ABC):
    """A task of robots in a world. A scene prepares the episode, moves the robots, and decides on success.

    In each cycle, the scene observes the world and requests changes; then the world advances by `cycle_ticks` ticks.
    All random numbers come from `random`, so that a seed leads to the same episode in every process.

    Args:
        random: Random generator of the episode.

    Attributes:
        world: Main YAML file of the world.
        watch: Robots, bodies and sensors that the scene observes.
        hands: Links that a controller moves to poses, indexed by `ROBOT/CONTROLLER`. Robots without such a controller
            are moved by joint targets.
        others: Robots that policies do not control, such as a person; `beside` moves these robots.
        of: Number of parts of the task.
        cycle_ticks: Number of ticks in a cycle.
        longest_s: Duration after which an episode ends [s].
        seen: Latest observation, without noise; empty before the first cycle. Success is determined from `seen`.
        sensed: Latest observation for policies. If `is_noisy`, poses and tags have noise and delay.
        landmarks: Additional poses in the world for `sensed.poses`, such as the pose of a palm, indexed by name.
        is_noisy: Whether sensors have noise and delay, see the module `sensing`. Must be set before `prepare`.
        goal_numbers: Numbers that a policy needs in addition to observations, such as a goal position [m].
    """

    world: ClassVar[str]
    watch: ClassVar[Watched]
    hands: ClassVar[Mapping[str, str]] = {}
    others: ClassVar[tuple[str, ...]] = ()
    of: ClassVar[int] = 1
    cycle_ticks: ClassVar[int] = 20
    longest_s: ClassVar[float] = 30.0

    def __init__(self, random: np.random.Generator) -> None:
        self.random = random
        self.seen = self.sensed = Seen()
        self.landmarks: dict[str, Pose] = {}
        self.is_noisy = False
        self._noise = random.spawn(3)  # of bodies, of tags, of robots; spawning changes no other random numbers
        self._bodies, self._tags = SensedPoses[str](self._noise[0]), SensedPoses[int](self._noise[1])
        self.goal_numbers: tuple[float, ...] = ()
        self._changes: list[WorldChange] = []

    # --- For subclasses

    def prepare(self) -> None:  # noqa: B027 (some scenes start as their files say)
        """Prepares an episode before the first tick, for instance with `place`."""

    @abstractmethod
    def act(self) -> Iterator[None]:
        """Moves the robots through the whole task. Each `yield` waits for the next cycle.

        Before the first call, the scene has observed the world once.

        Raises:
            SceneFailedError: If the robots cannot continue.
        """

    def beside(self) -> Iterator[None]:
        """Moves the robots in `others` while a policy moves the other robots. Does nothing by default.

        With a policy, this method runs instead of `act`.

        Raises:
            SceneFailedError: If the task can no longer succeed.
        """
        yield from ()

    def note(self) -> None:  # noqa: B027 (some scenes look at the end alone)
        """Records events of the present cycle, for `figures` and `has_succeeded`."""

    @abstractmethod
    def has_succeeded(self) -> bool:
        """Returns whether the task has succeeded, from the present observation and the records of `note`."""

    def figures(self) -> dict[str, float]:
        """Returns measures of quality, indexed by name with unit, such as `error [mm]`."""
        return {}

    def score(self) -> tuple[int, int]:
        """Returns the number of completed parts of the task, and the number of all parts.

        By default, all parts count as completed after a success, and 0 parts otherwise.
        """
        return self.of * self.has_succeeded(), self.of

    def fault(self) -> str:
        """Returns the reason for a failure in a few words, from the state at the episode's end. Empty if unknown."""
        return ""

    # --- Changes of the world

    def put(self, slot: str, value: Mapping[str, float] | Pose) -> None:
        """Sets an input, such as `kuka_lwr/target`, at the next tick; see `InputValue`."""
        self._changes.append(InputValue(slot, value))

    def place(self, name: str, pose: Pose) -> None:
        """Moves a body to a pose in the world in one step, and sets the body's velocity to 0."""
        self._changes.append(Teleport(name, pose))

    def shove(self, target: str, force: Vector, duration_s: float) -> None:
        """Applies a force [N] to a link for a duration [s]; see `Shove`."""
        self._changes.append(Shove(target, force, duration_s))

    def change(self, target: str, **values: float) -> None:
        """Changes dynamics parameters of a body or a link, such as `mass` [kg] or `lateralFriction`; see `Change`."""
        self._changes.append(Change(target, values))

    def switch(self, robot: str, start: tuple[str, ...] = (), stop: tuple[str, ...] = ()) -> None:
        """Stops and starts controllers of a robot, all at the same tick."""
        self._changes.append(Switch(robot, start, stop))

    def tune(self, target: str, **values: float | Vector) -> None:
        """Changes configuration values of a controller, such as `force` [N]. An active controller restarts from the
        robot's present pose.
        """
        self._changes.append(GainChange(target, values))

    def vanish(self, name: str) -> None:
        """Removes a body from the world."""
        self._changes.append(Removal(name))

    def look(self, seen: Seen) -> None:
        """Stores the observation at the end of a cycle in `seen`, calls `note`, and computes `sensed`."""
        self.seen = seen
        self.note()
        poses, tags = {**seen.poses, **self.landmarks}, seen.tags
        if self.is_noisy:
            poses, tags = self._bodies.track(seen.time_s, poses), self._tags.track(seen.time_s, tags)
        self.sensed = seen._replace(poses=poses, tags=tags)

    def take_changes(self) -> list[WorldChange]:
        """Returns the changes that were requested since the last call, in the order of the requests."""
        changes, self._changes = self._changes, []
        return changes

    def measure(self) -> Iterator[None]:
        """If `is_noisy`, waits until the poses of resting objects are averages of many measurements.

        Use: `yield from self.measure()`. `run_scene` calls this method at the start of every episode.
        """
        if self.is_noisy:
            yield from self.wait(MEASURE_S)

    def wait(self, duration_s: float) -> Iterator[None]:
        """Waits for a duration of simulated time [s]. Use: `yield from self.wait(0.5)`."""
        end_s = self.seen.time_s + duration_s
        while self.seen.time_s < end_s - 1e-9:
            yield


class Stage(ABC):
    """Connection of a scene to its world: a world in this process, or a simulator on a ROS master."""

    @abstractmethod
    def do(self, change: WorldChange) -> None:
        """Applies a change to the world, before the world's next tick.

        Raises:
            InterfaceError: If the world rejects the change.
        """

    @abstractmethod
    def cycle(self) -> None:
        """Advances the world by one cycle of ticks, and passes the observation to the scene."""


class SceneResult(NamedTuple):
    """Result of an episode.

    Attributes:
        success: Whether the task succeeded.
        done: Number of completed parts of the task.
        of: Number of all parts.
        time_s: Duration of the episode [s].
        figures: Measures of quality, indexed by name with unit.
        reason: Reason for a failure. Empty after a success, or if the reason is unknown.
    """

    success: bool
    done: int
    of: int
    time_s: float
    figures: dict[str, float]
    reason: str = ""


def tag_in_world(camera: Pose, tag: Pose) -> Pose:
    """Returns the pose of a tag in the world, rounded to `TAG_DIGITS` decimal digits.

    Due to the rounding, the result is the same with poses from ROS messages and with poses from this process.

    Args:
        camera: Pose of the camera's optical frame in the world.
        tag: Pose of the tag in the camera's optical frame.
    """
    position, (x, y, z, w) = camera @ tag
    along_x, along_y, along_z = (round(each, TAG_DIGITS) for each in position)
    return Pose((along_x, along_y, along_z), normalized([round(each, TAG_DIGITS) for each in (x, y, z, w)]))


def run_scene(scene: Scene, stage: Stage) -> SceneResult:
    """Runs an episode of a prepared scene until the scene's actions end, or until `longest_s`. Returns the result.

    Raises:
        InterfaceError: If the world fails, or rejects a change.
    """
    reason = ""

    def cycle() -> None:
        for change in scene.take_changes():
            stage.do(change)
        stage.cycle()

    cycle()
    try:
        for _ in chain(scene.measure(), scene.act()):
            cycle()
            if scene.seen.time_s >= scene.longest_s:
                reason = f"not done after {scene.longest_s:g} s"
                break
    except SceneFailedError as error:
        reason = str(error)
    success = scene.has_succeeded() and not reason
    reason = reason or ("" if success else scene.fault())
    return SceneResult(success, *scene.score(), scene.seen.time_s, scene.figures(), reason)


def broken_off(scene: Scene, error: InterfaceError) -> SceneResult:
    """Returns the result of an episode that ended because the world raised `error`, whose message is the reason."""
    return SceneResult(False, 0, scene.of, scene.seen.time_s, {}, " ".join(str(error).split()))
