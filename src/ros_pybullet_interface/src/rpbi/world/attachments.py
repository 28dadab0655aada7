"""Attachments: bodies that hold each other, up to a force."""

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
"""PyBullet's own limit is 500 N."""


@dataclass(frozen=True)
class _End:
    """One end of an attachment: a body, PyBullet's index of a link, and the end's pose in the link's URDF frame."""

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
    """An attachment in force."""

    config: AttachmentConfig
    constraint: int
    parent: _End
    child: _End

    def ends(self) -> tuple[_End, _End]:
        return self.parent, self.child

    def force_and_torque(self, pb: Client) -> tuple[Vector, Vector]:
        """Returns the force and torque on the parent in the last step [N, N m], in the axes of the world."""
        state = pb.getConstraintState(self.constraint)
        force: Vector = state[:3]
        if len(state) == 3:  # a ball; PyBullet returns the force on the child
            return scaled(-1.0, force), (0.0, 0.0, 0.0)
        return force, rotated((self.parent.link_pose() @ self.parent.pose).quat_xyzw, state[3:])


class Attachments:
    """The attachments of a world.

    Attributes:
        limited: Whether one of them breaks beyond a force, so that forces must be checked.
        changes: Number of times one was added or removed.
        last_change: The last of these changes, as a sentence.
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
        """Attaches a child to a parent.

        Raises:
            UnknownNameError: If there is no such body or link.
            ValueError: If the name is taken, the two are attached already, or cannot be.
            PhysicsError: If PyBullet refuses.
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
            UnknownNameError: If there is no attachment of that name.
        """
        if name not in self._holding:
            raise UnknownNameError("attachment", name, list(self._holding))
        self._release(self._holding[name], "was detached")

    def release_body(self, name: str) -> None:
        """Removes the attachments of a body that is about to be removed."""
        for each in self._of(name):
            log.info("%s", self._release(each, f"ended, since '{name}' was removed"))

    def resume(self) -> None:
        """Creates all attachments again in the client into which the bodies have moved."""
        for name, each in self._holding.items():
            constraint = self._constrain(each.config, each.parent, each.child)
            self._holding[name] = replace(each, constraint=constraint)

    def refuse_moving(self, name: str) -> None:
        """Refuses to move a body that its attachments would pull back at once.

        Raises:
            ValueError: If it is attached to something.
        """
        names = ", ".join(f"'{each.config.name}'" for each in self._of(name))
        if names:
            raise ValueError(f"'{name}' is held by attachment {names}, which would pull it back; detach it first")

    def break_overloaded(self, tick: int) -> None:
        """Breaks attachments whose force in the last step exceeded `max_force`."""
        for each in list(self._holding.values()):
            limit = each.config.max_force
            if limit is not None and (force := math.hypot(*each.force_and_torque(self._pb)[0])) > limit:
                log.warning("%s", self._release(each, f"broke at tick {tick}: {force:.4g} N, it holds {limit:g} N"))

    def loads_on(self, name: str) -> Iterator[LinkWrench]:
        """Yields the wrenches of attachments on a body's links in the last step."""
        for each in self._of(name):
            force, torque = each.force_and_torque(self._pb)
            for end, sign in zip(each.ends(), (1.0, -1.0)):
                if end.body.name == name:
                    point = (end.link_pose() @ end.pose).position
                    yield LinkWrench(end.link, scaled(sign, force), scaled(sign, torque), point)

    def clear(self) -> None:
        """Removes all attachments, since all bodies are about to be removed."""
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
        """Returns the end on the body NAME, or on the link NAME/LINK.

        Raises:
            UnknownNameError: If there is no such body or link.
            ValueError: If it has no physics, or is soft.
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
        """Removes an attachment, and returns the sentence about it."""
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
    """Returns both ends with their poses, by default the present ones."""
    on_parent = None if config.parent_pose is None else config.parent_pose.pose
    on_child = None if config.child_pose is None else config.child_pose.pose
    child_in_parent = parent.link_pose().inverse() @ child.link_pose()
    if on_child is None:
        on_child = Pose() if on_parent is None else child_in_parent.inverse() @ on_parent
    if on_parent is None:
        on_parent = child_in_parent @ on_child
    return _End(parent.body, parent.link, on_parent), _End(child.body, child.link, on_child)
