"""Collects shapes and poses of the links of a recorded world."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import pandas as pd

from custom_ros_tools.errors import InterfaceError
from rpbi.bodies import Body
from rpbi.bodies.visual_shapes import BodyShape, body_shapes, followed_frame, link_frame
from rpbi.world import World
from rpbi.world.saved.command_log import RecordedCommand, apply_command
from rpbi_data.bags.resampling import resample

from .frames import Frames
from .scene import Array, Poses, ShownLink

Commands = Mapping[int, Mapping[int, RecordedCommand]]
"""Commands, indexed by the number of preceding resets and the index of the command, as in `Recording`."""


def add_later_bodies(world: World, commands: Commands) -> list[str]:
    """Adds to a world all bodies that the recorded commands add, so that the shapes of these bodies are known.

    Returns:
        Messages about bodies that cannot be added.
    """
    notes = []
    for command in _in_order(commands):
        if command.what == "add" and command.name not in world.bodies:
            try:
                apply_command(world, command)
            except (InterfaceError, ValueError) as error:
                notes.append(f"{command.name} is not shown, it cannot be loaded: {' '.join(str(error).split())}")
    return notes


def links_of(
    world: World,
    at_start: Iterable[str],
    commands: Commands,
    states: pd.DataFrame | None,
    frames: Frames,
    joints: Mapping[str, pd.DataFrame],
) -> tuple[list[ShownLink], list[str]]:
    """Returns all links that have visible shapes.

    Args:
        world: The world, with all bodies that occur in the recording.
        at_start: Names of the bodies that were in the world at the start of the recording.
        commands: The recorded commands.
        states: Table of `rpbi/state`, which contains the times of ticks; None if the topic is not recorded.
        frames: TF frames at the times of the scene.
        joints: Tables of joint states, indexed by body name. They are used for links that are not on TF.

    Returns:
        The links, and messages about bodies that are not shown, or that are shown only at their initial poses.
    """
    links: list[ShownLink] = []
    notes: list[str] = []
    presence = _Presence(frozenset(at_start), commands, states, frames.times)
    teleported = {command.name for command in _in_order(commands) if command.what == "teleport"}
    for name, body in world.bodies.items():
        if body.is_soft:
            notes.append(f"{name} is not shown: it is soft")
            continue
        shapes = _by_link(body_shapes(body))
        poses = _LinkPoses(world, body, frames, joints.get(name))
        links += [
            ShownLink(name, body.link_name(index), of_link, poses.of(index), presence.of(name))
            for index, of_link in shapes.items()
        ]
        if poses.is_base_guessed and (name in teleported or _can_move(body)):
            notes.append(f"{name} is shown where it started: it is not on TF")
        if poses.are_joints_guessed:
            notes.append(f"{name} is shown with its joints as they started: the bag has no joint states of it")
    return links, notes


class _Presence:
    """Computes at which times bodies are in the world."""

    def __init__(self, at_start: frozenset[str], commands: Commands, states: pd.DataFrame | None, times: Array) -> None:
        self._times = times
        self._changes: list[tuple[float, str, bool]] = []
        later = {command.name for command in _in_order(commands) if command.what == "add"} - at_start
        for resets, ticks in () if states is None else states.groupby("resets"):
            begin_s = -np.inf if not self._changes else ticks.index[0]
            self._changes += [(begin_s, name, name in at_start) for name in (*at_start, *later)]
            for _, command in sorted(commands.get(resets, {}).items()):
                if command.what in ("add", "remove"):
                    at_s = float(np.interp(command.tick, ticks["tick"], ticks.index, left=begin_s))
                    self._changes.append((at_s, command.name, command.what == "add"))

    def of(self, name: str) -> Array:
        """Returns whether a body is in the world at each time, shape (n,); always True if states are not recorded."""
        is_there = np.ones(len(self._times), bool)
        for at_s, changed, comes in self._changes:
            if changed == name:
                is_there[self._times >= at_s] = comes
        return is_there


class _LinkPoses:
    """Computes the poses of a body's links over time.

    A pose is read from TF. If the link is not on TF, the pose is computed from the base pose and joint states. Without
    recorded data, the initial pose or initial joint positions are used.
    """

    def __init__(self, world: World, body: Body, frames: Frames, joints: pd.DataFrame | None) -> None:
        self._body, self._frames, self._joints = body, frames, joints
        self._sensors = world.sensors_of(body.name)
        self._start = body.base_pose()
        self._count = len(frames.times)
        followed = followed_frame(body) or (None if body.object_tf is None else body.object_tf.tf_id)
        base = self._on_tf(body.root_link) or (frames.poses(followed) if followed else None)
        self.is_base_guessed = base is None
        self.are_joints_guessed = False
        self._base = Poses.still(self._start, self._count) if base is None else base
        self._by_joints: dict[int, Poses] = {}

    def of(self, index: int) -> Poses:
        """Returns the poses of the link with a given PyBullet index, which is -1 for the base."""
        if index < 0:
            return self._base
        return self._on_tf(self._body.link_name(index)) or self._base @ self._in_base(index)

    def _on_tf(self, link: str) -> Poses | None:
        frame = link_frame(self._body, self._sensors, link)
        return None if frame is None else self._frames.poses(frame)

    def _in_base(self, index: int) -> Poses:
        if not self._by_joints:
            self._by_joints = self._poses_by_joints()
        return self._by_joints[index]

    def _poses_by_joints(self) -> dict[int, Poses]:
        body, to_base = self._body, self._start.inverse()
        names = {
            index: f"position/{body.pb.getJointInfo(body.body_id, index)[1].decode()}" for index in body.link_indices
        }
        table = self._joints
        driven = {} if table is None else {index: name for index, name in names.items() if name in table}
        if table is None or not driven:
            self.are_joints_guessed = any(
                body.pb.getJointInfo(body.body_id, i)[2] != body.pb.JOINT_FIXED for i in names
            )
            return {i: Poses.still(to_base @ body.link_pose(i), self._count) for i in body.link_indices}
        rows = resample(table[list(driven.values())], self._frames.times).ffill().bfill()
        found: list[list[tuple[float, ...]]] = []
        for row in rows[list(driven.values())].to_numpy():
            for index, position in zip(driven, row, strict=True):
                body.pb.resetJointState(body.body_id, index, position)
            poses = [to_base @ body.link_pose(index) for index in body.link_indices]
            found.append([(*pose.position, *pose.quat_xyzw) for pose in poses])
        by_link = np.array(found).transpose(1, 0, 2)
        return {index: Poses.from_numbers(numbers) for index, numbers in zip(body.link_indices, by_link, strict=True)}


def _by_link(shapes: Sequence[BodyShape]) -> dict[int, list[BodyShape]]:
    found: dict[int, list[BodyShape]] = {}
    for shape in shapes:
        found.setdefault(shape.link_index, []).append(shape)
    return found


def _can_move(body: Body) -> bool:
    return bool(body.dynamics_info(-1)[0] > 0.0)


def _in_order(commands: Commands) -> list[RecordedCommand]:
    return [command for _, of_life in sorted(commands.items()) for _, command in sorted(of_life.items())]
