"""Computes the actions of a data set: for each row, a command or a pose of the end effector."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from custom_ros_tools.errors import UnknownNameError
from rpbi_data.bags.resampling import TIME_ERROR, resample_exactly

from .format import ACTION, QUATERNION, Feature
from .signals import (
    ACTION_NAME,
    AXES,
    JOINTS,
    KINDS,
    NEXT,
    OTHER_ACTIONS,
    TARGETS_NAME,
    Column,
    RowOptions,
    Signal,
    Tables,
    joint_columns,
    joint_of,
    names_of,
    numbers_of,
)

Array = NDArray[Any]

ROTATION_VECTOR = ("rx", "ry", "rz")
"""Names of the components of a rotation vector [rad]."""


def derive_actions(
    tables: Tables, types: Mapping[str, str], fixed: Collection[str], row_options: RowOptions, pose: Sequence[Column]
) -> list[Signal]:
    """Returns a list that contains the feature `action`, or an empty list if the recording has no commands.

    Args:
        tables: Tables of a recording, as returned by `by_frame`.
        types: Message types, indexed by topic.
        fixed: Names of joints that cannot move, which are left out.
        row_options: The user's choice of topics, and whether actions are poses or changes.
        pose: Columns of the end effector's pose; empty without an end effector.

    Raises:
        UnknownNameError: If a joint of the gripper is not in the targets.
        ValueError: If the user requests changes as actions, but the commands are not joint positions.
    """
    found = _commands(tables, types, fixed, row_options)
    arm = [each for each in found if joint_of(each[0]) not in row_options.gripper]
    gripper = [each for each in found if joint_of(each[0]) in row_options.gripper]
    for name in row_options.gripper:
        if name not in {joint_of(column) for column, _ in gripper}:
            raise UnknownNameError("joint of targets", name, sorted({joint_of(column) for column, _ in found}))
    if row_options.is_pose:
        arm = [(column, Column("", "")) for column in pose]
    both = [*arm, *gripper]
    if not both:
        return []
    columns, held = tuple(column for column, _ in both), tuple(measured for _, measured in both)
    names = names_of(columns)
    if row_options.is_pose:
        names = (*AXES, *(ROTATION_VECTOR if row_options.is_delta else QUATERNION), *names_of(columns[len(pose) :]))
    elif row_options.is_delta and (others := [column for column, measured in arm if not measured.table]):
        got = f"'{others[0].name}' of {others[0].table}"
        raise ValueError(f"--action deltas: expected targets of joint positions, got {got}")
    return [Signal(Feature(ACTION, names), columns, row_options.timing, held, len(arm) if row_options.is_delta else 0)]


def _commands(
    tables: Tables, types: Mapping[str, str], fixed: Collection[str], row_options: RowOptions
) -> list[tuple[Column, Column]]:
    """Returns pairs of columns: the column of a command, and the column of the same joint's measured position.

    If the position is not measured, the second column has an empty table name.
    """
    topics = list(row_options.action or ())
    if row_options.action is None:
        joints = [topic for topic in tables if types.get(topic) == JOINTS]
        topics = [topic for topic in joints if TARGETS_NAME.fullmatch(topic)]
        others = [*joints, *(topic for topic in tables if types.get(topic) in OTHER_ACTIONS)]
        topics = topics or [topic for topic in others if ACTION_NAME.fullmatch(topic)]
    found: list[tuple[Column, Column]] = []
    for topic in topics:
        match = TARGETS_NAME.fullmatch(topic)
        states = match[1] if match else ""
        if types.get(topic) == JOINTS and states in tables:
            kind = next((each for each in KINDS if joint_columns(tables[topic], each, ())), "position")
            measured = states if kind == "position" else ""
            for name in joint_columns(tables[states], "position", fixed):
                found.append((Column(topic, name.replace("position", kind, 1)), Column(measured, name)))
        else:
            found += [(Column(topic, name), Column("", name)) for name in numbers_of(tables[topic])]
    return found


def action_values(signal: Signal, tables: Tables, rows: Array, next_rows: Array) -> tuple[Array, Array]:
    """Returns the actions of rows, and the time between each row and the command that was used.

    Args:
        signal: The feature `action`.
        tables: Tables of the recording, see `derive_actions`.
        rows: Times of the rows, int64, shape (n,) [ns].
        next_rows: Time of the next row for each of these rows, int64, shape (n,) [ns].

    Returns:
        Actions, shape (n, columns), and times between row and command, shape (n,) [s].
    """
    resampled: dict[str, pd.DataFrame] = {}
    errors = np.zeros(len(rows))
    for table, names in _by_table(signal.columns).items():
        samples = tables[table].reindex(columns=names)
        if _is_pose(table):
            resampled[table] = resample_exactly(samples, np.minimum(next_rows, samples.index[-1]), "linear")
            errors = np.fmax(errors, resampled[table][TIME_ERROR].to_numpy(float))
        else:
            at = next_rows - 1 if signal.method == NEXT else rows
            resampled[table] = resample_exactly(samples, at, "previous")
            ages = resampled[table][TIME_ERROR].to_numpy(float)
            errors = np.fmax(errors, np.abs((rows - at) / 1e9 + ages))
    columns = []
    for (table, name), measured in zip(signal.columns, signal.held, strict=True):
        column = resampled[table][name].to_numpy(float)
        if not _is_pose(table):  # before the first command: measured position of a joint, else 0
            column = np.where(np.isnan(column), _measured(measured, tables, rows) if measured.table else 0.0, column)
        columns.append(column)
    matrix = np.stack(columns, axis=1)
    return (_differences(signal, matrix, tables, rows) if signal.deltas else matrix), errors.astype(np.float32)


def _differences(signal: Signal, matrix: Array, tables: Tables, rows: Array) -> Array:
    """Replaces the first `signal.deltas` columns of actions by the differences from the measured values.

    The difference of two poses is a translation and a rotation vector, both in the world frame.
    """
    count, (table, _) = signal.deltas, signal.columns[0]
    if not _is_pose(table):
        measured = [_measured(each, tables, rows) for each in signal.held[:count]]
        return np.column_stack([matrix[:, :count] - np.stack(measured, axis=1), matrix[:, count:]])
    names = [column.name for column in signal.columns[:count]]
    now = resample_exactly(tables[table][names], rows, "linear")[names].to_numpy(float)
    turn = Rotation.from_quat(matrix[:, 3:count]) * Rotation.from_quat(now[:, 3:]).inv()
    return np.column_stack([matrix[:, :3] - now[:, :3], turn.as_rotvec(), matrix[:, count:]])


def _measured(column: Column, tables: Tables, rows: Array) -> Array:
    return resample_exactly(tables[column.table][[column.name]], rows, "linear")[column.name].to_numpy(float)


def _is_pose(table: str) -> bool:
    return "#" in table


def _by_table(columns: Sequence[Column]) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for table, name in columns:
        found.setdefault(table, []).append(name)
    return found
