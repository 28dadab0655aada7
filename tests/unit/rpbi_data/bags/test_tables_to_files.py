"""Tables to files and back."""

from __future__ import annotations

import resource
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest

from rpbi_data.bags.tables import file_stems, write_table


def test_file_names_are_readable_unique_and_stay_in_the_folder() -> None:
    topics = [
        "/kuka/joint_states",
        "/kuka.joint_states",
        "kuka/joint_states",
        "/",
        "/../../etc",
        "/a b",
        "/ä",
    ]
    assert list(file_stems(topics).values()) == [
        "kuka.joint_states",
        "kuka.joint_states-2",
        "kuka.joint_states-3",
        "_",
        "etc",
        "a_b",
        "_-2",
    ]


@pytest.fixture
def table() -> pd.DataFrame:
    columns = {
        "record_time": [1700000000.1, 1700000000.2],
        "position/arm.joint 1": [0.1, np.nan],
        "header/seq": np.array([1, 2], np.uint32),
        "text": ["ä", None],
        "late text": [None, "b"],
        "flag": [True, None],
        "mixed": [1.5, "x"],
    }
    return pd.DataFrame(columns, index=pd.Index([1700000000.000000001, 1700000000.1], name="time"))


def test_parquet_round_trip_preserves_the_table(table: pd.DataFrame, tmp_path: Path) -> None:
    table["data"] = [b"\0\xff", b""]
    write_table(table, tmp_path / "t.parquet")
    back = pd.read_parquet(tmp_path / "t.parquet", engine="fastparquet")
    assert list(back.columns) == list(table.columns)
    pd.testing.assert_index_equal(back.index, table.index)
    for name in table.columns.drop("mixed"):
        assert [None if pd.isna(x) else x for x in back[name]] == [None if pd.isna(x) else x for x in table[name]]
    assert list(back["mixed"]) == ["1.5", "x"]  # Parquet has one type a column


def test_csv_gives_back_the_numbers_bit_for_bit(table: pd.DataFrame, tmp_path: Path) -> None:
    write_table(table, tmp_path / "t.csv")
    back = pd.read_csv(tmp_path / "t.csv", index_col="time", float_precision="round_trip")
    assert list(back.index) == list(table.index)
    np.testing.assert_array_equal(back["position/arm.joint 1"], table["position/arm.joint 1"])


def test_binary_columns_do_not_go_into_text_files(table: pd.DataFrame, tmp_path: Path) -> None:
    table["data"] = [b"a", b"b"]
    with pytest.raises(ValueError, match="'data' is binary"):
        write_table(table, tmp_path / "t.csv")
    assert not (tmp_path / "t.csv").exists()


@pytest.mark.parametrize("name", ["t.parquet", "t.csv"])
def test_on_a_full_disk_the_former_file_stays(tmp_path: Path, name: str, file_limit: Callable[[int], None]) -> None:
    (tmp_path / name).write_text("former")
    long = pd.DataFrame({"record_time": np.random.default_rng(0).random(10_000)}, index=pd.Index(range(10_000)))
    file_limit(10_000)
    with pytest.raises(OSError, match="File too large"):
        write_table(long, tmp_path / name)
    file_limit(resource.RLIM_INFINITY)
    assert [(each.name, each.read_text()) for each in tmp_path.iterdir()] == [(name, "former")]


@pytest.mark.parametrize("name", ["t.parquet", "t.csv"])
def test_an_empty_table_can_be_written(tmp_path: Path, name: str) -> None:
    empty = pd.DataFrame({"record_time": np.empty(0)}, index=pd.Index(np.empty(0), name="time"))
    write_table(empty, tmp_path / name)
    assert (tmp_path / name).stat().st_size > 0


def test_hdf5_round_trip_preserves_the_table(table: pd.DataFrame, tmp_path: Path) -> None:
    table["data"] = [b"\0\xff", b""]
    write_table(table, tmp_path / "t.hdf5")
    with h5py.File(tmp_path / "t.hdf5") as file:
        np.testing.assert_array_equal(file["time"][:], table.index)
        for name in ("record_time", "position/arm.joint 1", "header/seq"):
            np.testing.assert_array_equal(file[name][:], table[name])
            assert file[name].dtype == table[name].dtype
        assert list(file["text"].asstr()) == ["ä", ""]
        assert list(file["mixed"].asstr()) == ["1.5", "x"]
        np.testing.assert_array_equal(file["flag"][:], [1.0, np.nan])
        assert [each.tobytes() for each in file["data"][:]] == [b"\0\xff", b""]


def test_an_hdf5_file_with_a_name_inside_another_is_refused(tmp_path: Path) -> None:
    table = pd.DataFrame({"data": [1.0], "data/0": [2.0]}, index=pd.Index([0.0], name="time"))
    with pytest.raises(ValueError, match="'data/0' cannot be a data set of an HDF5 file"):
        write_table(table, tmp_path / "t.hdf5")
