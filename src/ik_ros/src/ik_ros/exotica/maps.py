"""The task maps of EXOTica that the table of tasks can express."""

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
    """State of a problem that the goals of tasks depend on.

    Attributes:
        scene: The scene.
        frames: Frames of the scene that the problem attaches elsewhere.
        start: Start of the joints of the group [rad or m].
        previous: Previous solutions, newest last.
    """

    scene: ExoticaScene
    frames: Mapping[str, AttachedFrame]
    start: JointPositions
    previous: Sequence[JointPositions]


class MapTask(NamedTuple):
    """A task that expresses a map, or a part of it.

    Attributes:
        options: Options of the task, without name and weight.
        rho: Its weight.
        goal: Returns the goal of the task, from the numbers of the map's goal; None: it has none.
        on_link: The frame that the task concerns, if any.
    """

    options: dict[str, Any]
    rho: float
    goal: Callable[[Sequence[float], Situation], Sequence[float]] | None
    on_link: OnLink | None = None


class TaskMap(ElementConfig):
    """A task map: a function of the configuration, with a goal for its values.

    Attributes:
        is_about_links: Whether it concerns links; then success requires it.
    """

    is_about_links: ClassVar[bool] = False
    Name: Text

    @classmethod
    def kind(cls) -> str:
        """Returns its name in EXOTica."""
        return cls.__name__.removesuffix("Map")

    @abstractmethod
    def size(self, scene: ExoticaScene) -> int:
        """Returns the number of values of its goal."""

    @abstractmethod
    def parts(self, scene: ExoticaScene, rho: Sequence[float]) -> Iterator[MapTask]:
        """Yields the tasks that express it; `rho` has the weights of its values."""

    def weights(self, scene: ExoticaScene) -> int:
        """Returns the number of its weights."""
        return self.size(scene)


def _groups(names: Sequence[str], rho: Sequence[float]) -> dict[float, list[str]]:
    """Groups names by weight; names of weight 0 are left out."""
    found: dict[float, list[str]] = {}
    for name, weight in zip(names, rho):
        if weight:
            found.setdefault(weight, []).append(name)
    return found


Frames = Annotated[tuple[MapFrame, ...], list_of(lambda: {"Frame": MapFrame}, "frame of a map"), Field(min_length=1)]


class LinkMap(TaskMap):
    """A map about poses of links in other frames."""

    is_about_links = True
    axes: ClassVar[tuple[str, ...]]
    EndEffector: Frames

    @property
    def notation(self) -> str | None:
        """Notation of rotations in its goal; None: it has no rotations."""
        return None

    @property
    def positions(self) -> int:
        """Count of coordinates in its goal."""
        return sum(axis in XYZ for axis in self.axes)

    @property
    def stride(self) -> int:
        """Count of numbers of one frame."""
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
            else:  # positions and rotations apart: the former are along the axes of the base
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
    """Position of a link."""

    axes = XYZ


class EffPositionXYMap(LinkMap):
    """Position of a link in the plane."""

    axes = ("x", "y")


class EffOrientationMap(LinkMap):
    """Orientation of a link."""

    axes: ClassVar[tuple[str, ...]] = TURNS
    Type: Notation = "RPY"

    @property
    def notation(self) -> str:
        return self.Type


class EffFrameMap(EffOrientationMap):
    """Pose of a link."""

    axes: ClassVar[tuple[str, ...]] = (*XYZ, *TURNS)


def _refuse_goal(values: Sequence[float], situation: Situation) -> None:
    if any(values):
        raise ValueError(f"expected zeros, got {list(values)}")


class LookAtMap(TaskMap):
    """The z axis of a link (`Base`) points at a frame (`Link`)."""

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
    """Centre of mass of the robot."""

    is_about_links = True
    EnableZ: Flag = True

    def size(self, scene: ExoticaScene) -> int:
        return 3 if self.EnableZ else 2

    def parts(self, scene: ExoticaScene, rho: Sequence[float]) -> Iterator[MapTask]:
        for weight, axes in _groups(XYZ, rho).items():
            yield MapTask({"type": "com", "axes": axes}, weight, lambda values, _: (*values, 0.0)[:3])


class JointPoseMap(TaskMap):
    """Positions of joints."""

    JointMap: Numbers = ()
    JointRef: Numbers = ()

    def joints(self, scene: ExoticaScene) -> tuple[str, ...]:
        """Returns its joints."""
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
        """Returns the positions that its numbers are relative to [rad or m]."""
        return dict(zip(joints, self.JointRef or (0.0,) * len(joints)))


class _BackwardDifference(JointPoseMap):
    factors: ClassVar[tuple[float, ...]]
    """Factors on the previous solutions, the newest first, for the positions that have no difference."""
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
    """Difference from the previous solution."""

    factors = (1.0,)


class JointAccelerationBackwardDifferenceMap(_BackwardDifference):
    """Second difference, of the last two solutions and this one."""

    factors = (2.0, -1.0)


class JointJerkBackwardDifferenceMap(_BackwardDifference):
    """Third difference, of the last three solutions and this one."""

    factors = (3.0, -3.0, 1.0)


class JointLimitMap(TaskMap):
    """Distance of joints beyond their limits, or beyond a share of them."""

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
"""The maps by their names in XML."""
