"""Tables of different rates on one clock."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from custom_ros_tools.errors import UnknownNameError
from rpbi_utils.bags.resampling import TIME_ERROR, align, resample


def _table(times: list[float], **columns: object) -> pd.DataFrame:
    return pd.DataFrame(columns, index=pd.Index(times, name="time"))


RAMP = _table([0.0, 1.0, 2.0, 4.0], x=[0.0, 10.0, 20.0, 40.0], text=["a", "b", "c", "d"], n=[0, 1, 2, 4])


@pytest.mark.parametrize(
    ("method", "x", "text", "error"),
    [
        ("linear", [np.nan, 0.0, 14.0, 30.0, np.nan], [None, "a", "b", "c", "d"], [np.nan, 0.0, 0.4, 1.0, 1.0]),
        ("previous", [np.nan, 0.0, 10.0, 20.0, 40.0], [None, "a", "b", "c", "d"], [np.nan, 0.0, 0.4, 1.0, 1.0]),
        ("nearest", [0.0, 0.0, 10.0, 20.0, 40.0], ["a", "a", "b", "c", "d"], [0.5, 0.0, 0.4, 1.0, 1.0]),
    ],
)
def test_methods(method: str, x: list[float], text: list[str], error: list[float]) -> None:
    found = resample(RAMP, [-0.5, 0.0, 1.4, 3.0, 5.0], method)
    np.testing.assert_allclose(found["x"], x)
    assert list(found["text"]) == text
    np.testing.assert_allclose(found[TIME_ERROR], error, atol=1e-12)
    assert list(found.columns) == ["x", "text", "n", TIME_ERROR]


def test_own_times_give_the_same_values() -> None:
    for method in ("linear", "previous", "nearest"):
        found = resample(RAMP, RAMP.index, method)
        pd.testing.assert_frame_equal(found.drop(columns=TIME_ERROR), RAMP.astype({"n": float}))
        assert found[TIME_ERROR].max() == 0.0


def test_gaps_of_a_column_are_bridged_by_its_own_samples() -> None:
    partial = _table([0.0, 1.0, 2.0], a=[0.0, np.nan, 2.0], b=[np.nan, 5.0, np.nan])
    found = resample(partial, [0.5, 1.0])
    np.testing.assert_allclose(found["a"], [0.5, 1.0])
    np.testing.assert_allclose(found["b"], [np.nan, 5.0])
    np.testing.assert_allclose(found[TIME_ERROR], [0.5, 1.0])


def test_of_several_samples_of_one_time_the_last_counts() -> None:
    double = _table([0.0, 1.0, 1.0, 2.0], x=[0.0, 1.0, 7.0, 8.0])
    assert list(resample(double, [1.0, 1.5])["x"]) == [7.0, 7.5]
    assert list(resample(double, [1.0], "previous")["x"]) == [7.0]


def test_too_old_samples_are_no_values() -> None:
    found = resample(RAMP, [2.2, 3.0], "linear", max_time_error_s=0.5)
    np.testing.assert_allclose(found["x"], [22.0, np.nan])
    np.testing.assert_allclose(found[TIME_ERROR], [0.2, np.nan])
    assert list(found["text"]) == ["c", None]


def test_rotations_are_on_the_shortest_way_whatever_their_signs() -> None:
    angles = np.radians([170.0, 190.0, 230.0])
    quats = Rotation.from_rotvec(np.outer(angles, [0, 0, 1])).as_quat() * [[1], [-1], [1]]
    table = _table([0.0, 1.0, 2.0], **{f"rotation/{axis}": quats[:, i] for i, axis in enumerate("xyzw")})
    found = resample(table, np.linspace(0, 2, 21))
    rotations = Rotation.from_quat(found[[f"rotation/{axis}" for axis in "xyzw"]].to_numpy())
    expected = Rotation.from_rotvec(np.outer(np.interp(np.linspace(0, 2, 21), [0, 1, 2], angles), [0, 0, 1]))
    assert (rotations.inv() * expected).magnitude().max() < 1e-12
    componentwise = resample(table.rename(columns={"rotation/w": "rotation/not_w"}), np.linspace(0, 2, 21))
    assert np.abs(componentwise["rotation/z"] - found["rotation/z"]).max() > 0.5  # negative control


def test_one_clock() -> None:
    slow = _table([0.5, 1.5, 2.5], y=[5.0, 15.0, 25.0])
    aligned = align({"fast": RAMP, "slow": slow}, hz=2.0)
    np.testing.assert_allclose(aligned.table.index, [0.5, 1.0, 1.5, 2.0, 2.5])
    np.testing.assert_allclose(aligned.table["fast/x"], [5.0, 10.0, 15.0, 20.0, 25.0])
    np.testing.assert_allclose(aligned.table["slow/y"], [5.0, 10.0, 15.0, 20.0, 25.0])
    assert aligned.max_time_error_s.to_dict() == pytest.approx({"fast": 0.5, "slow": 0.5})
    assert list(align({"fast": RAMP, "slow": slow}, to="slow").table.index) == [0.5, 1.5, 2.5]
    methods = {"slow": "previous"}
    held = align({"fast": RAMP, "slow": slow}, times=[1.0, 2.0], method=methods).table
    assert list(held["slow/y"]) == [5.0, 15.0]
    assert list(held["fast/x"]) == [10.0, 20.0]


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        ({"hz": 1.0, "to": "a"}, ValueError, "exactly one"),
        ({"to": "b"}, UnknownNameError, "table"),
        ({"hz": 0.0}, ValueError, "positive rate, got 0"),
        ({"times": [1.0, 0.0]}, ValueError, "ascending"),
        ({"times": [0.0, np.nan]}, ValueError, "finite"),
        ({"hz": 1.0, "method": "cubic"}, UnknownNameError, "cubic"),
    ],
)
def test_wrong_requests_are_named(arguments: dict[str, object], error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        align({"a": RAMP}, **arguments)  # type: ignore[arg-type]


def test_tables_without_common_time_are_refused() -> None:
    with pytest.raises(ValueError, match="no time in common: one begins at 4.5 s, another ends at 4.0 s"):
        align({"a": RAMP, "b": _table([4.5], y=[1.0])}, hz=10.0)


def test_an_empty_table_has_no_values() -> None:
    found = resample(RAMP.iloc[:0], [0.0, 1.0])
    assert found[["x", "text", TIME_ERROR]].isna().all(axis=None)
