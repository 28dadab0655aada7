"""Computes the pose of a TF frame in another frame over time."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from custom_ros_tools.errors import UnknownNameError

from .resampling import TIME_ERROR, resample
from .row_plan import INDEX

Array = NDArray[Any]

TRANSLATION = [f"translation/{axis}" for axis in "xyz"]
ROTATION = [f"rotation/{axis}" for axis in "xyzw"]
IDENTITY = (0.0, 0.0, 0.0, 1.0)


class _Edge(NamedTuple):
    """Poses of a frame in its parent frame.

    Attributes:
        parent: Name of the parent frame.
        poses: Table with the columns `TRANSLATION` and `ROTATION`, indexed by time [s].
        is_static: Whether the first row is the pose at all times.
    """

    parent: str
    poses: pd.DataFrame
    is_static: bool


def transforms_between(
    tables: Mapping[str, pd.DataFrame],
    parent: str,
    child: str,
    *,
    times: ArrayLike | None = None,
    max_time_error_s: float = np.inf,
) -> pd.DataFrame:
    """Returns the poses of the frame `child` in the frame `parent` over time, from the transforms in the TF tree.

    Between samples, positions are interpolated linearly, and rotations by slerp.

    Args:
        tables: Tables of a bag from `bag_to_dataframes`, of which `/tf` and `/tf_static` are used.
        parent: Reference frame of the poses, without a leading slash. It need not be above `child` in the tree.
        child: Frame whose poses are returned, without a leading slash.
        times: Times of the rows, ascending, shape (n,) [s]. By default, all times of the transforms between the frames.
        max_time_error_s: Largest time between a row and the nearest sample of each transform [s]. Rows with a larger
            time error are left out.

    Returns:
        A table with the columns `translation/x` ... `translation/z` [m], `rotation/x` ... `rotation/w`, and
        `time_error` [s]. The time error is the largest time between the row and the nearest sample of a transform.
        Rows outside the time range of a transform are left out.

    Raises:
        UnknownNameError: If a frame does not exist.
        ValueError: If the frames are not connected, a frame has several parents, or a quaternion is zero.
    """
    edges = _edges(tables)
    frames = edges.keys() | {each.parent for each in edges.values()}
    for name in (parent, child):
        if name not in frames:
            raise UnknownNameError("frame", name, frames)
    up_from_parent, up_from_child = _path_to_root(edges, parent), _path_to_root(edges, child)
    roots = up_from_parent[-1], up_from_child[-1]
    if roots[0] != roots[1]:
        raise ValueError(f"'{parent}' and '{child}' are not connected: their roots are '{roots[0]}' and '{roots[1]}'")
    to_parent = [edges[frame] for frame in up_from_parent if frame not in up_from_child]
    to_child = [edges[frame] for frame in up_from_child if frame not in up_from_parent]
    if times is None:
        way = [*to_parent, *to_child]
        sources = [each.poses.index for each in way if not each.is_static] or [each.poses.index[:1] for each in way]
        times = np.unique(np.concatenate(sources)) if sources else np.empty(0)
    wanted = np.asarray(times, float)
    if not len(wanted):
        return pd.DataFrame([], pd.Index(wanted, name=INDEX), [*TRANSLATION, *ROTATION, TIME_ERROR], float)
    position, rotation, error = _product(to_parent, wanted, max_time_error_s)
    rotation = rotation.inv()
    position = -rotation.apply(position)
    child_position, child_rotation, child_error = _product(to_child, wanted, max_time_error_s)
    position, quats = position + rotation.apply(child_position), (rotation * child_rotation).as_quat()
    quats[0] *= np.copysign(1.0, quats[0, 3])
    quats[1:] *= np.cumprod(np.where((quats[1:] * quats[:-1]).sum(axis=1) < 0, -1.0, 1.0))[:, None]  # no sign jumps
    error = np.maximum(error, child_error)
    found = pd.DataFrame(np.column_stack([position, quats, error]), columns=[*TRANSLATION, *ROTATION, TIME_ERROR])
    return found.set_index(pd.Index(wanted, name=INDEX))[np.isfinite(error)]


def _edges(tables: Mapping[str, pd.DataFrame]) -> dict[str, _Edge]:
    """Returns all transforms, indexed by child frame."""
    edges: dict[str, _Edge] = {}
    for topic, is_static in (("/tf_static", True), ("/tf", False)):
        if topic not in tables:
            continue
        for child, rows in tables[topic].groupby("child", sort=False):
            parents = set(rows["parent"]) | ({edges[child].parent} if child in edges else set())
            if len(parents) > 1:
                raise ValueError(f"'{child}' has several parents: {', '.join(map(repr, sorted(parents)))}")
            poses = rows[[*TRANSLATION, *ROTATION]]
            if not poses[ROTATION].any(axis=1).all():
                raise ValueError(f"'{child}': expected unit quaternions, got one of zeros")
            edges[child] = _Edge(parents.pop(), poses.tail(1) if is_static else poses, is_static)
    return edges


def _path_to_root(edges: Mapping[str, _Edge], frame: str) -> list[str]:
    """Returns a frame and all frames above it in the tree, up to the root.

    Raises:
        ValueError: If the frames form a cycle.
    """
    path = [frame]
    while path[-1] in edges:
        path.append(edges[path[-1]].parent)
        if path.count(path[-1]) > 1:
            raise ValueError(f"the frames form a circle: {' in '.join(path)}")
    return path


def _product(way: Iterable[_Edge], times: Array, max_time_error_s: float) -> tuple[Array, Rotation, Array]:
    """Multiplies the transforms on the way from a frame up to one of its ancestors in the tree.

    Args:
        way: The transforms, starting at the lowest frame.
        times: Times of the poses, shape (n,) [s].
        max_time_error_s: See `transforms_between`.

    Returns:
        Positions, shape (n, 3) [m], n rotations, and time errors, shape (n,) [s]; NaN where a transform is missing.
    """
    position, error = np.zeros((len(times), 3)), np.zeros(len(times))
    rotation = Rotation.from_quat([IDENTITY] * len(times))
    for edge in way:
        edge_position, edge_rotation, edge_error = _pose(edge, times, max_time_error_s)
        position, rotation = edge_rotation.apply(position) + edge_position, edge_rotation * rotation
        error = np.maximum(error, edge_error)
    return position, rotation, error


def _pose(edge: _Edge, times: Array, max_time_error_s: float) -> tuple[Array, Rotation, Array]:
    if edge.is_static:
        row = edge.poses.iloc[[0] * len(times)]
        error = np.zeros(len(times))
    else:
        row = resample(edge.poses, times, max_time_error_s=max_time_error_s)
        error = row[TIME_ERROR].to_numpy()
    is_there = np.isfinite(error)
    quats = np.where(is_there[:, None], row[ROTATION].to_numpy(), IDENTITY)
    return np.where(is_there[:, None], row[TRANSLATION].to_numpy(), 0.0), Rotation.from_quat(quats), error
