"""Files and texts of other people."""

import json
import os

import pytest

from custom_ros_tools.errors import ConfigError
from custom_ros_tools.foreign import (
    entries_of,
    load_foreign_json,
    load_foreign_yaml,
    path_below,
    printable,
    read_below,
)


@pytest.mark.parametrize(
    "name",
    ["../x", "/../../x", "a/../../x", "a/..", "", "/", ".", "a\0b", "a\nb", "\x1b[2J", "x" * 1001, "link/x", "link"],
)
def test_path_that_leaves_the_folder_is_rejected(tmp_path, name):
    (tmp_path / "inside").mkdir()
    (tmp_path / "inside/link").symlink_to(tmp_path)
    with pytest.raises(ConfigError, match="expected"):
        path_below(tmp_path / "inside", name)


@pytest.mark.parametrize("name, path", [("a/b", "a/b"), ("/a/b", "a/b"), ("a//./b", "a/b"), ("..a", "..a"), ("ä", "ä")])
def test_path_is_laid_out_below_the_folder(tmp_path, name, path):
    assert path_below(tmp_path, name) == tmp_path / path


def test_folder_itself_may_be_a_link(tmp_path):
    (tmp_path / "real").mkdir()
    (tmp_path / "real/file").write_bytes(b"1")
    (tmp_path / "folder").symlink_to("real")
    assert read_below(tmp_path / "folder", "file") == b"1"


def test_files_without_end_and_large_files_are_rejected(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "large").write_bytes(b"12345")
    for name in ("pipe", "large", "missing"):
        with pytest.raises(ConfigError, match=name):
            read_below(tmp_path, name, most_bytes=4)
    assert read_below(tmp_path, "large", most_bytes=5) == b"12345"


def test_entries_are_sorted_without_links_and_limited(tmp_path):
    for name in ("b", "a", "c"):
        (tmp_path / name).touch()
    (tmp_path / "link").symlink_to("a")
    assert [entry.name for entry in entries_of(tmp_path)] == ["a", "b", "c"]
    with pytest.raises(OSError, match="more than 2 entries"):
        entries_of(tmp_path, most=2)


def test_foreign_yaml_and_json(tmp_path):
    (tmp_path / "facts.yaml").write_text("a: [1, 2]")
    assert load_foreign_yaml(tmp_path, "facts.yaml") == load_foreign_json(b'{"a": [1, 2]}', "facts") == {"a": [1, 2]}


@pytest.mark.parametrize(
    "text, reason",
    [
        ("[" * 200 + "]" * 200, "more than 100 levels"),
        ("[" * 100_000, "more than 100 levels"),
        (json.dumps([0] * 1001), "more than 1000 values"),
        (json.dumps([[0] * 600, [0] * 600]), "more than 1000 values"),
        (" " * 200_001, "at most 200000"),
        ("9" * 5000, "integer string"),
        (b"\xff", "facts: "),
        ("{", "facts: "),
    ],
    ids=lambda value: str(value)[:20],
)
def test_foreign_json_has_limits(text, reason):
    with pytest.raises(ConfigError, match=reason):
        load_foreign_json(text, "facts", most_bytes=200_000, most_values=1000)


def test_text_for_a_terminal_has_one_line_and_no_commands():
    assert printable("a\x1b[31mb\nc\u202ed\x9b") == r"a\x1b[31mb\x0ac\u202ed\x9b"
    assert printable("Grüße, 日本") == "Grüße, 日本"
    assert printable("x" * 20, 10) == "xxxxxxx..."
