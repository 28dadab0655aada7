"""Attachments: constraints that hold two bodies together, optionally with a force limit at which they break."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import pybullet

from custom_ros_tools.errors import PhysicsError, UnknownNameError
from robot_model.geometry import Vector, scaled
from rpbi.bodies.body import Body
from rpbi.bodies.dynamics import link_index
from rpbi.config.world import AttachmentConfig
from rpbi.engine.client import MAXIMAL_COORDINATES, Client
from rpbi.geometry import LinkWrench, Pose, rotated

log = logging.getLogger(__name__)

_UNLIMITED_N = 1e9
"""Force limit [N] of a constraint in PyBullet, so large that it is never reached; PyBullet's default is 500 N."""


@dataclass(frozen=True)
class _End:
    """One end of an attachment.

    Attributes:
        body: The body.
        link: PyBullet's index of the link; -1 for the base.
        pose: Pose of the attachment point in the link's URDF frame.
    """

    body: Body
    link: int
    pose: Pose = Pose()

    @property
    def is_static(self) -> bool:
        return self.link < 0 and self.body.pb.getDynamicsInfo(self.body.body_id, -1)[0] == 0.0

    @property
    def is_maximal(self) -> bool:
        return bool(self.body.pb.getDynamicsInfo(self.body.body_id, -1)[10] == MAXIMAL_COORDINATES)

    def link_pose(self) -> Pose:
        return self.body.link_pose(self.link)

    def pose_in_inertial(self) -> Pose:
        return self.body.inertial_pose(self.link).inverse() @ self.pose


@dataclass(frozen=True)
class _Attachment:
    """An active attachment.

    Attributes:
        config: Configuration of the attachment.
        constraint: PyBullet's id of the constraint.
        parent: End on the parent body.
        child: End on the child body.
    """

    config: AttachmentConfig
    constraint: int
    parent: _End
    child: _End

    def ends(self) -> tuple[_End, _End]:
        return self.parent, self.child

    def force_and_torque(self, pb: Client) -> tuple[Vector, Vector]:
        """Returns force [N] and torque [N m] on the parent at the attachment point in the last step, in world axes."""
        state = pb.getConstraintState(self.constraint)
        force: Vector = state[:3]
        if len(state) == 3:  # ball joint: PyBullet returns the force on the child
            return scaled(-1.0, force), (0.0, 0.0, 0.0)
        return force, rotated((self.parent.link_pose() @ self.parent.pose).quat_xyzw, state[3:])


class Attachments:
    """The attachments of a world.

    Attributes:
        limited: Whether at least one attachment has a force limit, so that forces must be checked.
        changes: Number of changes so far. A change adds or removes an attachment, or removes all at a reset.
        last_change: Text that describes the last change; empty before the first change.
    """

    def __init__(self, pb: Client, bodies: Mapping[str, Body]) -> None:
        self._pb, self._bodies = pb, bodies
        self._holding: dict[str, _Attachment] = {}
        self.limited = False
        self.changes = 0
        self.last_change = ""

    @property
    def configs(self) -> tuple[AttachmentConfig, ...]:
        """Configurations of the present attachments."""
        return tuple(each.config for each in self._holding.values())

    def add(self, config: AttachmentConfig) -> None:
        """Attaches the child body to the parent body.

        Raises:
            UnknownNameError: If a configured body or link does not exist.
            ValueError: If another attachment has the same name, or the two links are already attached to each other.
                Also if the two links cannot be attached to each other.
            PhysicsError: If PyBullet refuses the constraint.
        """
        if config.name in self._holding:
            raise ValueError(f"name: there is an attachment '{config.name}' already; detach it, or use another name")
        parent, child = self._end("parent", config.parent), self._end("child", config.child)
        links = {(end.body.name, end.link) for end in (parent, child)}
        if len(links) == 1:
            raise ValueError(f"child: '{config.child}' cannot be attached to itself")
        for name, other in self._holding.items():
            if links == {(end.body.name, end.link) for end in other.ends()}:
                raise ValueError(f"child: '{config.child}' is attached to '{config.parent}' already, by '{name}'")
        if parent.is_static and child.is_static:
            raise ValueError(f"child: neither '{config.child}' nor '{config.parent}' can move: both are static")
        if parent.is_maximal and not child.is_maximal:
            message = "PyBullet cannot hold a body without useMaximalCoordinates by one that has it"
            raise ValueError(f"parent: {message}; use '{config.child}' as the parent, '{config.parent}' as the child")
        if config.max_force is not None and parent.is_maximal:
            message = "PyBullet does not report the force between two bodies with useMaximalCoordinates"
            raise ValueError(f"max_force: {message}; remove it, or that key of the parent '{config.parent}'")
        parent, child = _placed(config, parent, child)
        self._change(_Attachment(config, self._constrain(config, parent, child), parent, child), "holds")

    def remove(self, name: str) -> None:
        """Removes an attachment.

        Raises:
            UnknownNameError: If no attachment has this name.
        """
        if name not in self._holding:
            raise UnknownNameError("attachment", name, list(self._holding))
        self._release(self._holding[name], "was detached")

    def release_body(self, name: str) -> None:
        """Removes the attachments of a body that is about to be removed."""
        for each in self._of(name):
            log.info("%s", self._release(each, f"ended, since '{name}' was removed"))

    def resume(self) -> None:
        """Creates all constraints again, after the world has moved into another PyBullet client."""
        for name, each in self._holding.items():
            constraint = self._constrain(each.config, each.parent, each.child)
            self._holding[name] = replace(each, constraint=constraint)

    def refuse_moving(self, name: str) -> None:
        """Checks that a body may be teleported; an attachment to another body would pull the body back at once.

        Raises:
            ValueError: If the body is attached to another body.
        """
        names = ", ".join(f"'{each.config.name}'" for each in self._of(name))
        if names:
            raise ValueError(f"'{name}' is held by attachment {names}, which would pull it back; detach it first")

    def break_overloaded(self, tick: int) -> None:
        """Removes each attachment whose force in the last step exceeded its `max_force`, and logs a warning."""
        for each in list(self._holding.values()):
            limit = each.config.max_force
            if limit is not None and (force := math.hypot(*each.force_and_torque(self._pb)[0])) > limit:
                log.warning("%s", self._release(each, f"broke at tick {tick}: {force:.4g} N, it holds {limit:g} N"))

    def loads_on(self, name: str) -> Iterator[LinkWrench]:
        """Yields the wrenches that attachments exerted on the links of a body in the last step."""
        for each in self._of(name):
            force, torque = each.force_and_torque(self._pb)
            for end, sign in zip(each.ends(), (1.0, -1.0)):
                if end.body.name == name:
                    point = (end.link_pose() @ end.pose).position
                    yield LinkWrench(end.link, scaled(sign, force), scaled(sign, torque), point)

    def clear(self) -> None:
        """Removes all attachments; must be called before all bodies are removed."""
        for each in self._holding.values():
            self._pb.removeConstraint(each.constraint)
        if self._holding:
            self.changes += 1
            self.last_change = "the world was reset"
        self._holding.clear()
        self.limited = False

    def _of(self, name: str) -> list[_Attachment]:
        return [each for each in self._holding.values() if name in (each.parent.body.name, each.child.body.name)]

    def _end(self, key: str, name: str) -> _End:
        """Returns one end of an attachment; the end's pose is not set yet.

        Args:
            key: `parent` or `child`, for messages.
            name: `NAME` for the root link of a body, or `NAME/LINK`.

        Raises:
            UnknownNameError: If the body or link does not exist.
            ValueError: If the body is soft or has no physics.
        """
        body_name, _, link = name.partition("/")
        if body_name not in self._bodies:
            raise UnknownNameError("object", body_name, list(self._bodies))
        body = self._bodies[body_name]
        if body.is_soft:
            raise ValueError(f"{key}: '{body_name}' is soft; its anchors are in its own file")
        if not body.has_physics:
            raise ValueError(f"{key}: '{body_name}' is only shown, nothing can hold it")
        return _End(body, link_index(body, link))

    def _constrain(self, config: AttachmentConfig, parent: _End, child: _End) -> int:
        on_parent, on_child = parent.pose_in_inertial(), child.pose_in_inertial()
        ids = (parent.body.body_id, parent.link, child.body.body_id, child.link)
        kind = pybullet.JOINT_FIXED if config.kind == "fixed" else pybullet.JOINT_POINT2POINT
        try:
            constraint = int(
                self._pb.createConstraint(
                    *ids,
                    kind,
                    (0.0, 0.0, 0.0),
                    on_parent.position,
                    on_child.position,
                    on_parent.quat_xyzw,
                    on_child.quat_xyzw,
                )
            )
            self._pb.changeConstraint(constraint, maxForce=_UNLIMITED_N)
        except pybullet.error as error:
            raise PhysicsError(f"{config.name}: {error}") from error
        return constraint

    def _change(self, attachment: _Attachment, what: str) -> None:
        self._holding[attachment.config.name] = attachment
        self._note(attachment, what)

    def _release(self, attachment: _Attachment, what: str) -> str:
        """Removes an attachment, and returns a text that describes the removal and ends with `what`."""
        self._pb.removeConstraint(attachment.constraint)
        del self._holding[attachment.config.name]
        return self._note(attachment, what)

    def _note(self, attachment: _Attachment, what: str) -> str:
        config = attachment.config
        self.limited = any(each.max_force is not None for each in self.configs)
        self.changes += 1
        self.last_change = f"attachment '{config.name}' of '{config.child}' to '{config.parent}' {what}"
        return self.last_change


def _placed(config: AttachmentConfig, parent: _End, child: _End) -> tuple[_End, _End]:
    """Returns both ends with their configured poses. A missing pose is chosen such that the bodies do not move."""
    on_parent = None if config.parent_pose is None else config.parent_pose.pose
    on_child = None if config.child_pose is None else config.child_pose.pose
    child_in_parent = parent.link_pose().inverse() @ child.link_pose()
    if on_child is None:
        on_child = Pose() if on_parent is None else child_in_parent.inverse() @ on_parent
    if on_parent is None:
        on_parent = child_in_parent @ on_child
    return _End(parent.body, parent.link, on_parent), _End(child.body, child.link, on_child)
