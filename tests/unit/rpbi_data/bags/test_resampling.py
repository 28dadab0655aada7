"""Tables of different rates on one clock."""

from __future__ import annotations

import bisect

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from custom_ros_tools.errors import UnknownNameError
from rpbi_data.bags.resampling import TIME_ERROR, align, resample, resample_exactly
from rpbi_data.bags.times import to_seconds


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


def test_the_last_of_several_partial_samples_of_one_time_counts() -> None:
    partial = _table([0.0, 1.0, 1.0, 1.0], a=[0.0, 5.0, np.nan, 9.0], b=[0.0, np.nan, 3.0, np.nan])
    for method in ("linear", "previous", "nearest"):
        found = resample(partial, [1.0], method)
        assert (list(found["a"]), list(found["b"])) == ([9.0], [3.0])


@pytest.mark.parametrize("begin_ns", [0, 1_002_000_000, 1_700_000_000_123_456_789])
def test_rows_get_the_sample_at_their_own_time(begin_ns: int) -> None:
    ties = 0
    for seed, hz in enumerate((10, 25, 30, 50, 60, 100, 333, 1000)):
        rng = np.random.default_rng(seed)
        rows = [begin_ns + (2 * k * 10**9 + hz) // (2 * hz) for k in range(200)]
        tied = rng.random(200) < 0.5
        tied[0] = tied[-1] = True
        others = begin_ns + rng.integers(1, rows[-1] - begin_ns, 100)
        stamps = sorted({row for row, is_tied in zip(rows, tied) if is_tied} | set(others.tolist()))
        seconds = [stamp // 10**9 + stamp % 10**9 / 1e9 for stamp in stamps]
        table = _table(seconds, x=np.arange(len(stamps)))
        found = align({"a": table}, hz=hz, method="previous").table
        assert len(found) == len(rows)
        expected = [bisect.bisect_right(stamps, row) - 1 for row in rows]
        assert list(found["a/x"]) == expected
        at_own = align({"a": table}, hz=hz, method="linear").table["a/x"].to_numpy()[tied]
        assert list(at_own) == [index for index, is_tied in zip(expected, tied) if is_tied]
        ties += int(tied.sum())
    assert ties > 700


def test_nanoseconds_are_exact_where_floats_are_not() -> None:
    begin = 1_700_000_000_000_000_000
    table = pd.DataFrame({"x": [0.0, 1.0, 2.0]}, index=pd.Index([begin, begin + 1, begin + 50], name="time"))
    rows = np.array([begin, begin + 1, begin + 2, begin + 49, begin + 50])
    assert list(resample_exactly(table, rows, "previous")["x"]) == [0.0, 1.0, 1.0, 1.0, 2.0]
    assert to_seconds(rows).max() - to_seconds(rows).min() == 0.0  # negative control
    with pytest.raises(ValueError, match="index of the table: expected seconds of at most 4.5e"):
        resample(table.astype(float).set_axis([0.0, 1.0, 5e9]), [0.0])


def test_too_old_samples_are_no_values() -> None:
    found = resample(RAMP, [2.2, 3.0], "linear", max_time_error_s=0.5)
    np.testing.assert_allclose(found["x"], [22.0, np.nan])
    np.testing.assert_allclose(found[TIME_ERROR], [0.2, np.nan])
    assert list(found["text"]) == ["c", None]


def test_rotations_take_the_shortest_path_whatever_their_signs() -> None:
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
