"""Those task maps of EXOTica that tasks of the solver `tasks` can express."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

from pydantic import Field

from custom_ros_tools.schema import KeyedError, Text
from ik_ros.problem import AttachedFrame, JointPositions
from robot_model.geometry import Pose

from .elements import NOTATIONS, ElementConfig, Flag, MapFrame, Number, Numbers, list_of, rotation_of
from .scene import ExoticaScene, OnLink, errors_of

Notation = Literal["RPY", "ZYX", "ZYZ", "AngleAxis", "Quaternion", "Matrix"]
XYZ, TURNS = ("x", "y", "z"), ("rx", "ry", "rz")


class Situation(NamedTuple):
    """Parts of a problem that the goals of tasks depend on.

    Attributes:
        scene: The scene.
        frames: Frames of the scene that the problem attaches to a new parent, indexed by frame name.
        start: Start positions of the joint group, indexed by joint name [rad or m].
        previous: Previous solutions, the newest last.
    """

    scene: ExoticaScene
    frames: Mapping[str, AttachedFrame]
    start: JointPositions
    previous: Sequence[JointPositions]


class MapTask(NamedTuple):
    """A task of the solver `tasks` that expresses a task map, or a part of a task map.

    Attributes:
        options: Options of the task, without name and weight.
        rho: EXOTica's weight of the task.
        goal: Function that computes the task's goal from the numbers of the map's goal; None for a task without goal.
        on_link: The frame that the task moves, and the link that it is attached to; None for tasks that do not concern
            a link's pose.
    """

    options: dict[str, Any]
    rho: float
    goal: Callable[[Sequence[float], Situation], Sequence[float]] | None
    on_link: OnLink | None = None


class TaskMap(ElementConfig):
    """Base class of task maps. A task map computes values from the configuration, and has a goal for these values.

    Attributes:
        is_about_links: True for maps of link poses and of the centre of mass, False for maps of joints. Only errors of
            maps with True can decide whether a solution counts as successful.
    """

    is_about_links: ClassVar[bool] = False
    Name: Text

    @classmethod
    def kind(cls) -> str:
        """Returns the name of the map's type in EXOTica."""
        return cls.__name__.removesuffix("Map")

    @abstractmethod
    def size(self, scene: ExoticaScene) -> int:
        """Returns the number of values in the map's goal."""

    @abstractmethod
    def parts(self, scene: ExoticaScene, rho: Sequence[float]) -> Iterator[MapTask]:
        """Yields the tasks that together express the map.

        Args:
            scene: The scene.
            rho: Weights of the map's values; `weights` returns the number of weights.
        """

    def weights(self, scene: ExoticaScene) -> int:
        """Returns the number of weights that the map has."""
        return self.size(scene)


def _groups(names: Sequence[str], rho: Sequence[float]) -> dict[float, list[str]]:
    """Returns lists of names, indexed by the weight in `rho` that they share; leaves out names with weight 0."""
    found: dict[float, list[str]] = {}
    for name, weight in zip(names, rho):
        if weight:
            found.setdefault(weight, []).append(name)
    return found


Frames = Annotated[tuple[MapFrame, ...], list_of(lambda: {"Frame": MapFrame}, "frame of a map"), Field(min_length=1)]


class LinkMap(TaskMap):
    """Base class of the task maps for positions, orientations or poses of links in other frames."""

    is_about_links = True
    axes: ClassVar[tuple[str, ...]]
    EndEffector: Frames

    @property
    def notation(self) -> str | None:
        """Notation of the rotations in the map's goal; None for a goal without rotations."""
        return None

    @property
    def positions(self) -> int:
        """Number of position coordinates that the map's goal has for each frame."""
        return sum(axis in XYZ for axis in self.axes)

    @property
    def stride(self) -> int:
        """Number of values that the map's goal has for each frame: position coordinates and rotation."""
        return self.positions + (NOTATIONS[self.notation][0] if self.notation else 0)

    def size(self, scene: ExoticaScene) -> int:
        return self.stride * len(self.EndEffector)

    def weights(self, scene: ExoticaScene) -> int:
        return len(self.axes) * len(self.EndEffector)

    def parts(self, scene: ExoticaScene, rho: Sequence[float]) -> Iterator[MapTask]:
        for i, frame in enumerate(self.EndEffector):
            with errors_of(f"EndEffector[{i}].Link"):
                link, offset = scene.moving(frame.Link)
            with errors_of(f"EndEffector[{i}].Base"):
                scene.fixed(frame.Base)
            own = rho[i * len(self.axes) : (i + 1) * len(self.axes)]
            on_link = OnLink(link, offset @ frame.LinkOffset)
            if len(set(own)) == 1:
                groups = [(own[0], list(self.axes))] if own[0] else []
            else:  # separate tasks for positions and rotations, since positions are along the axes of the base
                split = [axes for axes in (XYZ, TURNS) if set(axes) & set(self.axes)]
                weight = dict(zip(self.axes, own))
                groups = [
                    entry for axes in split for entry in _groups(axes, [weight.get(axis, 0.0) for axis in axes]).items()
                ]
            for weight_of_axes, axes_of_weight in groups:
                options = {"type": "frame_pose", "axes": axes_of_weight}
                yield MapTask(options, weight_of_axes, self._goal(i, frame, axes_of_weight), on_link)

    def _goal(
        self, i: int, frame: MapFrame, axes: Sequence[str]
    ) -> Callable[[Sequence[float], Situation], Sequence[float]]:
        def goal(values: Sequence[float], situation: Situation) -> Sequence[float]:
            numbers = values[i * self.stride : (i + 1) * self.stride]
            x, y, z = (*numbers[: self.positions], 0.0, 0.0, 0.0)[:3]
            rotation = rotation_of(self.notation, numbers[self.positions :]) if self.notation else (0.0, 0.0, 0.0, 1.0)
            base = situation.scene.fixed(frame.Base, situation.frames) @ frame.BaseOffset
            pose = base @ Pose((x, y, z), rotation)
            return (*pose.position, *(pose.quat_xyzw if set(axes) & set(TURNS) else base.quat_xyzw))

        return goal


class EffPositionMap(LinkMap):
    """Task map of the position of a link."""

    axes = XYZ


class EffPositionXYMap(LinkMap):
    """Task map of the position of a link along x and y."""

    axes = ("x", "y")


class EffOrientationMap(LinkMap):
    """Task map of the orientation of a link."""

    axes: ClassVar[tuple[str, ...]] = TURNS
    Type: Notation = "RPY"

    @property
    def notation(self) -> str:
        return self.Type


class EffFrameMap(EffOrientationMap):
    """Task map of the pose of a link."""

    axes: ClassVar[tuple[str, ...]] = (*XYZ, *TURNS)


def _refuse_goal(values: Sequence[float], situation: Situation) -> None:
    if any(values):
        raise ValueError(f"expected zeros, got {list(values)}")


class LookAtMap(TaskMap):
    """Task map that points the z axis of the frame `Base`, on a moving link, at the fixed frame `Link`."""

    is_about_links = True
    EndEffector: Frames

    def size(self, scene: ExoticaScene) -> int:
        return 2 * len(self.EndEffector)

    def parts(self, scene: ExoticaScene, rho: Sequence[float]) -> Iterator[MapTask]:
        for i, frame in enumerate(self.EndEffector):
            with errors_of(f"EndEffector[{i}].Base"):
                link, offset = scene.moving(frame.Base)
            with errors_of(f"EndEffector[{i}].Link"):
                scene.fixed(frame.Link)
            if rho[2 * i] != rho[2 * i + 1]:
                raise KeyedError("Rho", f"expected the same for both numbers of a frame, got {list(rho)}")
            on_link = OnLink(link, offset @ frame.BaseOffset)
            yield MapTask({"type": "look_at"}, rho[2 * i], self._goal(frame), on_link)

    def _goal(self, frame: MapFrame) -> Callable[[Sequence[float], Situation], Sequence[float]]:
        def goal(values: Sequence[float], situation: Situation) -> Sequence[float]:
            _refuse_goal(values, situation)
            return (situation.scene.fixed(frame.Link, situation.frames) @ frame.LinkOffset).position

        return goal


class CenterOfMassMap(TaskMap):
    """Task map of the position of the robot's centre of mass."""

    is_about_links = True
    EnableZ: Flag = True

    def size(self, scene: ExoticaScene) -> int:
        return 3 if self.EnableZ else 2

    def parts(self, scene: ExoticaScene, rho: Sequence[float]) -> Iterator[MapTask]:
        for weight, axes in _groups(XYZ, rho).items():
            yield MapTask({"type": "com", "axes": axes}, weight, lambda values, _: (*values, 0.0)[:3])


class JointPoseMap(TaskMap):
    """Task map of joint positions."""

    JointMap: Numbers = ()
    JointRef: Numbers = ()

    def joints(self, scene: ExoticaScene) -> tuple[str, ...]:
        """Returns the names of the joints that the map concerns."""
        if not self.JointMap:
            return scene.joints
        if not all(index in range(len(scene.joints)) for index in self.JointMap):
            raise KeyedError("JointMap", f"expected indices below {len(scene.joints)}, got {list(self.JointMap)}")
        return tuple(scene.joints[int(index)] for index in self.JointMap)

    def size(self, scene: ExoticaScene) -> int:
        return len(self.joints(scene))

    def parts(self, scene: ExoticaScene, rho: Sequence[float]) -> Iterator[MapTask]:
        joints = self.joints(scene)
        if len(self.JointRef) not in (0, len(joints)):
            raise KeyedError("JointRef", f"expected {len(joints)} positions, got {len(self.JointRef)}")
        for weight, names in _groups(joints, rho).items():
            options = {"type": "posture", "goal": dict.fromkeys(names, 0.0)}
            yield MapTask(options, weight, self._goal(joints, names))

    def _goal(
        self, joints: Sequence[str], names: Sequence[str]
    ) -> Callable[[Sequence[float], Situation], Sequence[float]]:
        def goal(values: Sequence[float], situation: Situation) -> Sequence[float]:
            reference = self.reference(joints, situation)
            at = {name: value + reference[name] for name, value in zip(joints, values)}
            return [at[name] for name in names]

        return goal

    def reference(self, joints: Sequence[str], situation: Situation) -> JointPositions:
        """Returns the reference positions by joint name [rad or m]. The map's goal is relative to these positions."""
        return dict(zip(joints, self.JointRef or (0.0,) * len(joints)))


class _BackwardDifference(JointPoseMap):
    factors: ClassVar[tuple[float, ...]]
    """Factors by which previous solutions are multiplied, the newest solution first. The sum of the products is the
    joint position at which the difference is 0."""
    JointMap: Annotated[Numbers, Field(max_length=0)] = ()
    JointRef: Annotated[Numbers, Field(max_length=0)] = ()
    StartState: Numbers = ()

    def parts(self, scene: ExoticaScene, rho: Sequence[float]) -> Iterator[MapTask]:
        if len(self.StartState) not in (0, len(scene.joints)):
            raise KeyedError("StartState", f"expected {len(scene.joints)} positions, got {len(self.StartState)}")
        yield from super().parts(scene, rho)

    def reference(self, joints: Sequence[str], situation: Situation) -> JointPositions:
        first = dict(zip(joints, self.StartState)) or situation.start
        before = [*reversed(situation.previous), *(first for _ in self.factors)]
        for solution in before[: len(self.factors)]:
            if missing := [name for name in joints if name not in solution]:
                raise ValueError(f"a previous solution lacks {', '.join(missing)}")
        return {name: sum(factor * one[name] for factor, one in zip(self.factors, before)) for name in joints}


class JointVelocityBackwardDifferenceMap(_BackwardDifference):
    """Task map of the first backward difference: joint positions minus the previous solution."""

    factors = (1.0,)


class JointAccelerationBackwardDifferenceMap(_BackwardDifference):
    """Task map of the second backward difference, from the joint positions and the last two solutions."""

    factors = (2.0, -1.0)


class JointJerkBackwardDifferenceMap(_BackwardDifference):
    """Task map of the third backward difference, from the joint positions and the last three solutions."""

    factors = (3.0, -3.0, 1.0)


class JointLimitMap(TaskMap):
    """Task map of the distance by which joints exceed their limits, after `SafePercentage` has narrowed the ranges."""

    SafePercentage: Annotated[Number, Field(ge=0.0, le=1.0)] = 0.0

    def size(self, scene: ExoticaScene) -> int:
        return len(scene.joints)

    def parts(self, scene: ExoticaScene, rho: Sequence[float]) -> Iterator[MapTask]:
        limits = scene.robot.limits.of([scene.robot.joint_names.index(name) for name in scene.joints])
        within = {}
        for name, lower, upper in zip(scene.joints, limits.lower, limits.upper):
            if math.isfinite(upper - lower):
                margin = 0.5 * self.SafePercentage * (upper - lower)
                within[name] = [lower + margin, upper - margin]
        for weight, names in _groups(scene.joints, rho).items():
            if limited := {name: within[name] for name in names if name in within}:
                yield MapTask({"type": "joint_limits", "limits": limited}, weight, None)


MAPS: Mapping[str, type[TaskMap]] = {
    each.kind(): each
    for each in (
        EffFrameMap,
        EffPositionMap,
        EffPositionXYMap,
        EffOrientationMap,
        LookAtMap,
        CenterOfMassMap,
        JointPoseMap,
        JointVelocityBackwardDifferenceMap,
        JointAccelerationBackwardDifferenceMap,
        JointJerkBackwardDifferenceMap,
        JointLimitMap,
    )
}
"""All task maps by their tags in XML."""
