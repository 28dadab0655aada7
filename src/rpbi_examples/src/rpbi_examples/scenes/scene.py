"""The base class of scenes, which see a world and act in it without knowing whether it is in this process."""

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
"""Time in which things at rest are measured with noise [s]."""
TAG_DIGITS = 6
"""Decimal digits of poses of tags [m]; the noise of detectors is far larger."""


class Watched(NamedTuple):
    """Parts of its world that a scene observes.

    Attributes:
        robots: Robots whose joints it sees.
        bodies: Bodies whose poses it sees; in their YAML, `base_state_hz` is that of the cycles.
        wrenches: Force-torque sensors, as `ROBOT/JOINT`.
        contacts: Bodies whose contact forces it sees; in their YAML, `contacts: {hz: ...}` is that of the cycles.
        tags: Detectors of AprilTags, as their `topic`; in their YAML, `hz` is that of the cycles, without latency.
    """

    robots: tuple[str, ...]
    bodies: tuple[str, ...] = ()
    wrenches: tuple[str, ...] = ()
    contacts: tuple[str, ...] = ()
    tags: tuple[str, ...] = ()


class SeenWrench(NamedTuple):
    """Force [N] and torque [N m]."""

    force: Vector = ZERO
    torque: Vector = ZERO


class Touch(NamedTuple):
    """A contact point of a body.

    Attributes:
        other: The body that it touches.
        other_link: Link of the other body.
        position: Where [m].
        normal: Unit vector towards the body.
        normal_force: Force along it [N].
        force: The whole force on the body, with friction [N].
    """

    other: str
    other_link: str
    position: Vector
    normal: Vector
    normal_force: float
    force: Vector = ZERO


class Seen(NamedTuple):
    """Observation of a scene at the end of a cycle.

    Attributes:
        time_s: Time since the start of the scene [s].
        joints: Positions of joints [rad or m] by name, by robot.
        poses: Poses of the bodies' URDF frames in the world.
        wrenches: By force-torque sensor, in the axes of the joint's child link.
        contacts: By body.
        tags: Poses in the world of the AprilTags that detectors see, by number; z points out of the tag.
    """

    time_s: float = 0.0
    joints: Mapping[str, Mapping[str, float]] = {}
    poses: Mapping[str, Pose] = {}
    wrenches: Mapping[str, SeenWrench] = {}
    contacts: Mapping[str, tuple[Touch, ...]] = {}
    tags: Mapping[int, Pose] = {}


class InputValue(NamedTuple):
    """Passes a value to an input before the next tick, see `World.put`: joints and numbers, or a pose."""

    slot: str
    value: Mapping[str, float] | Pose


class Teleport(NamedTuple):
    """Puts a body somewhere at once, at rest."""

    name: str
    pose: Pose


class Shove(NamedTuple):
    """A force [N] in the axes of the world on the origin of a link, `NAME` or `NAME/LINK`, for a time [s]."""

    target: str
    force: Vector
    duration_s: float


class Change(NamedTuple):
    """Changes dynamics of a body or a link, `NAME` or `NAME/LINK`, by keys of `changeDynamics` such as `mass`."""

    target: str
    values: Mapping[str, float]


class Switch(NamedTuple):
    """Stops and starts controllers of a robot, all at one tick."""

    robot: str
    start: tuple[str, ...]
    stop: tuple[str, ...]


class GainChange(NamedTuple):
    """Changes keys of a controller, `ROBOT/CONTROLLER`, as its service `set_gains` does."""

    target: str
    values: Mapping[str, float | Vector]


class Removal(NamedTuple):
    """Removes a body."""

    name: str


WorldChange = InputValue | Teleport | Shove | Change | Switch | GainChange | Removal
"""A change that a scene makes to its world."""


class SceneFailedError(InterfaceError):
    """The robots cannot continue, for instance because a target is out of reach; the episode ends as failed."""


class Scene(ABC):
    """A task of robots in a world: its start, the robots' actions, and the test of success.

    Time passes in cycles: the scene observes, acts, and a cycle of ticks follows. All random numbers come from
    `random`, so that a seed leads to the same episode anywhere.

    Args:
        random: Random numbers of the episode.

    Attributes:
        world: Main YAML file of the world.
        watch: The parts that it observes.
        hands: Links that controllers move to poses, by `ROBOT/CONTROLLER`; joints of other robots have targets.
        others: Robots that no policy moves, such as a person, see `beside`.
        of: Number of parts of the task.
        cycle_ticks: Ticks of a cycle.
        longest_s: Time after which an episode ends [s].
        seen: The newest view of the world, before the first cycle an empty one. It has no noise, and decides on
            success.
        sensed: The view that policies act by: `seen`, and with noise the poses and tags that sensors report.
        landmarks: Further poses that a policy senses, in the world, such as that of a palm; `sensed.poses` has them.
        is_noisy: Whether sensors have noise and delay, see `sensing`; set before `prepare`.
        goal_numbers: Numbers of the episode that a policy needs in addition to observations, such as a place [m].
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
        """Prepares an episode before the first tick, for instance by `place`."""

    @abstractmethod
    def act(self) -> Iterator[None]:
        """Acts; each `yield` waits for the next cycle. The scene has observed the world once before.

        Raises:
            SceneFailedError: If the robots cannot continue.
        """

    def beside(self) -> Iterator[None]:
        """Acts for robots that no policy moves, such as a person, in place of `act`; does nothing by default.

        Raises:
            SceneFailedError: If the task can no longer be done.
        """
        yield from ()

    def note(self) -> None:  # noqa: B027 (some scenes look at the end alone)
        """Records events of a cycle, for figures and success."""

    @abstractmethod
    def has_succeeded(self) -> bool:
        """Returns whether the task succeeded, from the present observation and the records."""

    def figures(self) -> dict[str, float]:
        """Returns measures of quality, by name with unit, such as `error [mm]`."""
        return {}

    def score(self) -> tuple[int, int]:
        """Returns the number of completed parts of the task and the number of all parts; by default all or none."""
        return self.of * self.has_succeeded(), self.of

    def fault(self) -> str:
        """Returns the reason of a failure in a few words, if the end of the episode shows it; otherwise nothing."""
        return ""

    # --- Changes of the world

    def put(self, slot: str, value: Mapping[str, float] | Pose) -> None:
        """Passes a value to an input, such as `kuka_lwr/target`, see `InputValue`."""
        self._changes.append(InputValue(slot, value))

    def place(self, name: str, pose: Pose) -> None:
        """Puts a body somewhere at once, at rest."""
        self._changes.append(Teleport(name, pose))

    def shove(self, target: str, force: Vector, duration_s: float) -> None:
        """Applies a force [N] to a link for a time, see `Shove`."""
        self._changes.append(Shove(target, force, duration_s))

    def change(self, target: str, **values: float) -> None:
        """Changes dynamics of a body or a link, such as `mass` [kg] or `lateralFriction`, see `Change`."""
        self._changes.append(Change(target, values))

    def switch(self, robot: str, start: tuple[str, ...] = (), stop: tuple[str, ...] = ()) -> None:
        """Stops and starts controllers of a robot, all at one tick."""
        self._changes.append(Switch(robot, start, stop))

    def tune(self, target: str, **values: float | Vector) -> None:
        """Changes keys of a controller, such as `force` [N]; an active one starts again from the robot's present
        pose.
        """
        self._changes.append(GainChange(target, values))

    def vanish(self, name: str) -> None:
        """Removes a body."""
        self._changes.append(Removal(name))

    def look(self, seen: Seen) -> None:
        """Observes the world at the end of a cycle."""
        self.seen = seen
        self.note()
        poses, tags = {**seen.poses, **self.landmarks}, seen.tags
        if self.is_noisy:
            poses, tags = self._bodies.track(seen.time_s, poses), self._tags.track(seen.time_s, tags)
        self.sensed = seen._replace(poses=poses, tags=tags)

    def take_changes(self) -> list[WorldChange]:
        """Returns the changes since the last call, in order."""
        changes, self._changes = self._changes, []
        return changes

    def measure(self) -> Iterator[None]:
        """Waits until things at rest are measured well, if sensors have noise; used as `yield from self.measure()`.

        Every episode begins with it.
        """
        if self.is_noisy:
            yield from self.wait(MEASURE_S)

    def wait(self, duration_s: float) -> Iterator[None]:
        """Waits; used as `yield from self.wait(0.5)`."""
        end_s = self.seen.time_s + duration_s
        while self.seen.time_s < end_s - 1e-9:
            yield


class Stage(ABC):
    """Place of a scene: a world in this process, or the simulator of a ROS master."""

    @abstractmethod
    def do(self, change: WorldChange) -> None:
        """Makes a change to the world, before its next tick.

        Raises:
            InterfaceError: If the world refuses it.
        """

    @abstractmethod
    def cycle(self) -> None:
        """Advances by a cycle of ticks, and lets the scene observe the world."""


class SceneResult(NamedTuple):
    """How an episode ended.

    Attributes:
        success: Whether the task succeeded.
        done: Number of parts of the task that are done.
        of: Number of all parts.
        time_s: Duration [s].
        figures: Measures of quality.
        reason: Reason of a failure; empty if unknown.
    """

    success: bool
    done: int
    of: int
    time_s: float
    figures: dict[str, float]
    reason: str = ""


def tag_in_world(camera: Pose, tag: Pose) -> Pose:
    """Returns the pose of a tag, rounded to a micrometre, so that it does not depend on how both poses were
    transmitted.

    Args:
        camera: Pose of the camera's optical frame in the world.
        tag: Pose of the tag in that frame.
    """
    position, (x, y, z, w) = camera @ tag
    along_x, along_y, along_z = (round(each, TAG_DIGITS) for each in position)
    return Pose((along_x, along_y, along_z), normalized([round(each, TAG_DIGITS) for each in (x, y, z, w)]))


def run_scene(scene: Scene, stage: Stage) -> SceneResult:
    """Runs an episode of a prepared scene, until its actions end or its time is over.

    Raises:
        InterfaceError: If the world fails, or refuses something.
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
    """Returns the result of an episode that an error of its world has ended: no part is done."""
    return SceneResult(False, 0, scene.of, scene.seen.time_s, {}, " ".join(str(error).split()))
