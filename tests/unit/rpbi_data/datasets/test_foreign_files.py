"""Files of data sets of other people: names, sizes, links and limits."""

from __future__ import annotations

import os
import resource
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from rpbi_data.datasets import confinement, foreign_files
from rpbi_data.datasets.confinement import ERROR, FAULT, CheckLine, confined, look_at
from rpbi_data.datasets.foreign_files import file_name, hdf5_faults, read_json, read_parquet

PLACE = {"chunk_index": 1, "file_index": 23}


@pytest.mark.parametrize(
    ("template", "name"),
    [
        ("data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet", "data/chunk-001/file-023.parquet"),
        ("{file_index}", "23"),
        ("/etc/{chunk_index}", "etc/1"),
    ],
)
def test_templates_with_known_placeholders_are_names(template: str, name: str) -> None:
    assert file_name(template, PLACE) == name


@pytest.mark.parametrize(
    "template",
    [
        "{chunk_index.__class__}", "{chunk_index:999999999d}", "{chunk_index!r}", "{0}", "{}", "{", "{unknown}", "",
        "../{file_index}", "a/../../b", "x" * 2000, "\x1b[2J", 5, None,
    ],
)  # fmt: skip
def test_other_templates_are_refused(template: object) -> None:
    with pytest.raises(ValueError, match="expected"):
        file_name(template, PLACE)
    with pytest.raises(ValueError, match="file_index: expected a number from 0 on, found -1"):
        file_name("{file_index}", {"file_index": -1})


def test_a_table_that_unfolds_is_refused_before_it_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.parquet"
    parquet.write_table(pa.table({"a": pa.array(np.zeros(50_000))}), path, compression="zstd")
    assert len(read_parquet(path)) == 50_000  # negative control
    monkeypatch.setattr(foreign_files, "MAX_VALUES", 10_000)
    with pytest.raises(ValueError, match="expected at most 10,000 values, found 50,000"):
        read_parquet(path)
    path.write_bytes(b"PAR1" * 9)
    with pytest.raises(ValueError, match="cannot be read"):
        read_parquet(path)


def test_json_is_read_within_the_folder_alone(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text('{"a": 1}')
    assert read_json(tmp_path, "a.json") == {"a": 1}
    (tmp_path / "b.json").symlink_to("a.json")
    (tmp_path / "c.json").write_text("[" * 5000)
    for name in ("b.json", "c.json", "../a.json"):
        with pytest.raises(ValueError, match="expected no symbolic link|levels|without '..'"):
            read_json(tmp_path, name)


def test_links_and_values_elsewhere_are_named(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.hdf5", "w") as file:
        file["data/good"] = np.zeros((3, 2))
        file["data/text"] = "a"
        assert list(hdf5_faults(file, 1000)) == []  # negative control
        file["data/linked"] = h5py.ExternalLink("/etc/passwd", "/")
        file["data/soft"] = h5py.SoftLink("/data/good")
        file["data/round"] = file["/"]
        file.create_dataset("data/external", (3,), "f8", external=[("/etc/passwd", 0, 24)])
        layout = h5py.VirtualLayout(shape=(3,), dtype="f8")
        layout[:] = h5py.VirtualSource("/etc/passwd", "x", shape=(3,))
        file.create_virtual_dataset("data/virtual", layout)
        file.create_dataset("data/objects", (3,), h5py.vlen_dtype(np.float64))
        file.create_dataset("data/picture", (3, 60_000, 60_000, 3), "u1", chunks=True)
        file.create_dataset("data/zeros", (10**9, 7), "f4", chunks=True)
        faults = {fault.partition(": ")[0]: fault.partition(": ")[2] for fault in hdf5_faults(file, 1000)}
        del file["data"]
        file.create_dataset("next/pictures", (10**7, 84, 84, 3), "u1", chunks=True)
        (fault,) = hdf5_faults(file, 1000)
    assert fault == "next/pictures: expected at most 1,073,741,824 bytes of images in all, found more"
    assert faults == {
        "data/linked": "expected no link, found ExternalLink",
        "data/soft": "expected no link, found SoftLink",
        "data/round": "expected a group or data set of its own, found one that has another name, too",
        "data/external": "expected values in this file, found some in others",
        "data/virtual": "expected values in this file, found some in others",
        "data/objects": "expected numbers or texts, found object",
        "data/picture": "expected images of at most 100,000,000 bytes, found larger ones",
        "data/zeros": "expected at most 20,000,000 values in all, found more",
    }


def test_special_files_are_named_and_not_opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "a/file").write_bytes(b"123")
    assert look_at(tmp_path) == ((), 3)  # negative control
    os.mkfifo(tmp_path / "a/pipe")
    (tmp_path / "a/\x1b[2J").symlink_to("/dev/zero")
    link, pipe = look_at(tmp_path).faults
    assert link == "a/\\x1b[2J: expected a file or folder, found a symbolic link"
    assert pipe == "a/pipe: expected a file or folder, found a pipe, a socket or a device"
    monkeypatch.setattr(confinement, "MAX_ENTRIES", 2)
    assert look_at(tmp_path).faults == ("expected at most 2 files and folders, found more",)


def lines_of(task) -> list[CheckLine]:
    return list(confined(task, 0))


def test_a_task_that_takes_too_much_ends_with_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fine() -> Iterator[CheckLine]:
        yield CheckLine(FAULT, "a\nb")

    def greedy() -> Iterator[CheckLine]:
        yield CheckLine(FAULT, "first")
        assert bytearray(3_000_000_000)

    def writing() -> Iterator[CheckLine]:
        try:
            (tmp_path / "new").write_text("text")
        except OSError as error:
            yield CheckLine(FAULT, str(error.strerror))

    def ended() -> Iterator[CheckLine]:
        os.kill(os.getpid(), signal.SIGTERM)
        yield CheckLine(FAULT, "never")

    def slow() -> Iterator[CheckLine]:
        resource.setrlimit(resource.RLIMIT_CPU, (1, 2))
        while time.process_time() < 100.0:
            pass
        yield CheckLine(FAULT, "never")

    assert lines_of(fine) == [(FAULT, "a\nb")]  # negative control
    assert lines_of(greedy) == [
        (FAULT, "first"),
        (ERROR, "expected at most 1.2 GB of memory, needs more; --any-size, if you know who made it"),
    ]
    assert lines_of(writing) == [(FAULT, "File too large")]
    assert lines_of(ended) == [(ERROR, "a library that reads it was ended by SIGTERM")]
    assert lines_of(slow)[-1].text.startswith("expected at most 30 s of processor time, needs more")
