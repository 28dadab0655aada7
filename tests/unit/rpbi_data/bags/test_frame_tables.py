"""The pose of one TF frame in another over time."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from custom_ros_tools.errors import UnknownNameError
from rpbi_data.bags.transforms import ROTATION, TRANSLATION, transforms_between

Pose = tuple[np.ndarray, Rotation]


def _rows(parent: str, child: str, times: np.ndarray, positions: np.ndarray, rotations: Rotation) -> pd.DataFrame:
    values = np.column_stack([positions, rotations.as_quat()])
    table = pd.DataFrame(values, columns=[*TRANSLATION, *ROTATION], index=pd.Index(times, name="time"))
    return table.assign(parent=parent, child=child)


def _matrices(positions: np.ndarray, rotations: Rotation) -> np.ndarray:
    found = np.tile(np.eye(4), (len(positions), 1, 1))
    found[:, :3, :3], found[:, :3, 3] = rotations.as_matrix(), positions
    return found


@pytest.mark.parametrize("seed", range(5))
def test_a_random_tree_is_multiplied_up_and_down(seed: int) -> None:
    """world > base > tip, and world > camera > tag: the tag in the tip, at common times, against matrices."""
    random = np.random.default_rng(seed)
    times = np.cumsum(random.uniform(0.01, 0.1, 30))
    tables, matrices = [], {}
    for parent, child in (("world", "base"), ("base", "tip"), ("world", "camera"), ("camera", "tag")):
        positions, rotations = random.normal(size=(30, 3)), Rotation.random(30, random_state=random)
        if child == "camera":
            positions[:], rotations = positions[0], Rotation.from_quat([rotations[0].as_quat()] * 30)
        tables.append(_rows(parent, child, times, positions, rotations))
        matrices[child] = _matrices(positions, rotations)
    static = tables.pop(2).head(1)
    found = transforms_between({"/tf": pd.concat(tables).sort_index(), "/tf_static": static}, "tip", "tag")
    expected = np.linalg.inv(matrices["base"] @ matrices["tip"]) @ matrices["camera"] @ matrices["tag"]
    np.testing.assert_allclose(found.index, times)
    np.testing.assert_allclose(found[TRANSLATION], expected[:, :3, 3], atol=1e-12)
    quats = Rotation.from_quat(found[ROTATION].to_numpy())
    np.testing.assert_allclose(quats.as_matrix(), expected[:, :3, :3], atol=1e-12)
    assert found["time_error"].max() == 0.0
    assert (found[ROTATION].to_numpy()[1:] * found[ROTATION].to_numpy()[:-1]).sum(axis=1).min() >= 0.0


def test_frames_of_different_rates_are_interpolated_with_a_time_error() -> None:
    fast, slow = np.linspace(0.0, 1.0, 11), np.array([0.0, 1.0])
    none = Rotation.from_quat([[0.0, 0.0, 0.0, 1.0]])
    a = _rows("world", "a", fast, np.outer(fast, [1, 0, 0]), Rotation.concatenate([none] * 11))
    b = _rows("a", "b", slow, np.outer(slow, [0, 1, 0]), Rotation.concatenate([none] * 2))
    tables = {"/tf": pd.concat([a, b]).sort_index(kind="stable")}
    found = transforms_between(tables, "world", "b")
    np.testing.assert_allclose(found["translation/x"], fast)
    np.testing.assert_allclose(found["translation/y"], fast)
    np.testing.assert_allclose(found["time_error"], np.minimum(fast, 1 - fast), atol=1e-12)
    assert list(transforms_between(tables, "world", "b", max_time_error_s=0.25).index) == pytest.approx(
        [0.0, 0.1, 0.2, 0.8, 0.9, 1.0]
    )
    assert list(transforms_between(tables, "world", "b", times=[-1.0, 0.5, 2.0]).index) == [0.5]


def test_the_same_frame_is_the_identity_of_no_time() -> None:
    one = Rotation.from_quat([[0.0, 0.0, 0.0, 1.0]])
    tables = {"/tf": _rows("world", "a", np.zeros(1), np.ones((1, 3)), one)}
    assert len(transforms_between(tables, "a", "a")) == 0
    np.testing.assert_allclose(transforms_between(tables, "a", "a", times=[3.0]).iloc[0], [0, 0, 0, 0, 0, 0, 1, 0])


def test_unconnected_frames_are_named() -> None:
    one = Rotation.from_quat([[0.0, 0.0, 0.0, 1.0]])
    rows = {pair: _rows(*pair, np.zeros(1), np.zeros((1, 3)), one) for pair in [("w", "a"), ("v", "b"), ("v", "a")]}
    apart = {"/tf": pd.concat([rows["w", "a"], rows["v", "b"]])}
    with pytest.raises(ValueError, match="'a' and 'b' are not connected: their roots are 'w' and 'v'"):
        transforms_between(apart, "a", "b")
    with pytest.raises(UnknownNameError, match="frame"):
        transforms_between(apart, "a", "c")
    with pytest.raises(ValueError, match="'a' has several parents: 'v', 'w'"):
        transforms_between({"/tf": pd.concat([rows["w", "a"], rows["v", "a"]])}, "w", "a")
    no_rotation = rows["w", "a"].assign(**{"rotation/w": 0.0})
    with pytest.raises(ValueError, match="'a': expected unit quaternions, got one of zeros"):
        transforms_between({"/tf": no_rotation}, "w", "a")
    circle = pd.concat(
        [_rows("a", "b", np.zeros(1), np.zeros((1, 3)), one), _rows("b", "a", np.zeros(1), np.zeros((1, 3)), one)]
    )
    with pytest.raises(ValueError, match="circle"):
        transforms_between({"/tf": circle}, "a", "b")
