"""Files that cannot be read, or not to the end, are named with the reason and the remedy."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
import rosbag
from std_msgs.msg import Float64, String

from rpbi_data import bag_to_dataframes, topic_report
from rpbi_data.bags import bag_reader
from rpbi_data.bags import bag_to_table_node as bag_to_table
from rpbi_data.bags.limits import BagError

WriteBag = Callable[..., Path]


def _refused(path: Path) -> str:
    with pytest.raises(BagError) as report:
        topic_report(path)
    with pytest.raises(BagError) as tables:
        bag_to_dataframes(path)
    assert str(report.value) == str(tables.value)
    message = str(tables.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    return message


@pytest.fixture
def bag(write_bag: WriteBag) -> Path:
    return write_bag([("/a", Float64(index)) for index in range(1000)])


def test_a_missing_file(tmp_path: Path) -> None:
    assert "there is no such file" in _refused(tmp_path / "missing.bag")


def test_a_folder(tmp_path: Path) -> None:
    assert "not a file" in _refused(tmp_path)


@pytest.mark.parametrize("content", [b"", b"a text\n", bytes(range(256)), b"\xff\xfe\n"])
def test_a_file_that_is_no_bag(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "other.bag"
    path.write_bytes(content)
    assert "not a ROS 1 bag" in _refused(path)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_a_file_that_may_not_be_read(bag: Path) -> None:
    bag.chmod(0)
    assert "Permission denied" in _refused(bag)


def test_an_unindexed_bag_can_be_read_once_it_is_reindexed(tmp_path: Path) -> None:
    active = tmp_path / "run.bag.active"
    with rosbag.Bag(str(active), "w", chunk_threshold=1000) as writer:
        for index in range(1000):
            writer.write("/a", Float64(index))
        writer.flush()
        shutil.copy(active, tmp_path / "cut.bag")
        message = _refused(active)
    assert "still being recorded" in message
    path = tmp_path / "cut.bag"
    assert f"rosbag reindex {path}" in _refused(path)
    subprocess.run(["rosbag", "reindex", "-q", str(path)], check=True)
    assert 900 < len(bag_to_dataframes(path)["/a"]) <= 1000  # the chunk that was being written is lost


@pytest.mark.parametrize("part", [0.2, 0.5, 0.9, 0.99])
def test_a_bag_that_is_cut_off(bag: Path, part: float) -> None:
    os.truncate(bag, int(bag.stat().st_size * part))
    assert "cut off: repair it with 'rosbag reindex" in _refused(bag)


@pytest.mark.parametrize("compression", ["none", "bz2", "lz4"])
def test_a_bag_that_is_damaged_inside(write_bag: WriteBag, compression: str) -> None:
    path = write_bag([("/a", Float64(index)) for index in range(2000)], compression=compression)
    with rosbag.Bag(str(path)) as bag:
        chunk = list(bag._chunk_headers.values())[1]
    with open(path, "r+b") as file:
        file.seek(chunk.data_pos)
        file.write(b"\xff" * chunk.compressed_size)
    assert "damaged" in _refused(path)


@pytest.fixture
def bomb(write_bag: WriteBag, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A bag of 5 MB in a few kB, where 1 MB counts as much."""
    monkeypatch.setattr(bag_reader, "MAX_UNPACKED_BYTES", 1_000_000)
    return write_bag([("/a", String("x" * 1_000_000))] * 5, compression="bz2")


def test_bag_of_excessive_compression_is_refused_unless_explicitly_allowed(
    bomb: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert bomb.stat().st_size * bag_reader.MAX_COMPRESSION < 5_000_000
    assert "MB unfold to 0.005 GB: more than 255 times as much; --any-size, if you know who made it" in _refused(bomb)
    assert len(bag_to_dataframes(bomb, any_size=True)["/a"]) == 5
    assert topic_report(bomb, any_size=True).loc["/a", "bytes"] == 5 * 1_000_004
    assert bag_to_table.main([str(bomb), "--quiet"]) == 1
    assert capsys.readouterr().err.endswith("--any-size, if you know who made it\n")
    assert bag_to_table.main([str(bomb), "--quiet", "--any-size", "--format", "csv"]) == 0


def test_lz4_never_unfolds_too_far(write_bag: WriteBag, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bag_reader, "MAX_UNPACKED_BYTES", 0)
    path = write_bag([("/a", String("x" * 1_000_000))] * 5, compression="lz4")
    assert len(bag_to_dataframes(path)["/a"]) == 5


def test_chunk_larger_than_its_declared_size_is_damaged(write_bag: WriteBag) -> None:
    path = write_bag([("/a", String("x" * 100_000))], compression="bz2")
    data = path.read_bytes()
    at = data.index(b"size=") + len(b"size=")
    path.write_bytes(data[:at] + (1000).to_bytes(4, "little") + data[at + 4 :])
    assert "damaged: a chunk unfolds to more than its stated size" in _refused(path)


def test_an_index_that_names_a_message_many_times_is_damaged(tmp_path: Path) -> None:
    path = tmp_path / "again.bag"
    with rosbag.Bag(str(path), "w") as bag:
        bag.write("/a", String("x" * 100_000))
        for entries in bag._curr_chunk_connection_indexes.values():
            entries *= 100
    with rosbag.Bag(str(path)) as bag:
        assert sum(1 for _ in bag.read_messages()) == 100, "rosbag itself reads it a hundred times"
    assert "damaged: its index names messages more than once" in _refused(path)
