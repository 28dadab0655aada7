"""Episodes of others: descriptions with odd values, paths that lead elsewhere, links and pipes."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import pytest
import yaml

from custom_ros_tools.errors import ConfigError, InterfaceError
from rpbi_data.episodes.errors import EpisodeError
from rpbi_data.episodes.files import files_of_world, store_files, with_stored_files
from rpbi_data.episodes.folder import BAG, FACTS, EpisodeFolder, file_in, hold, is_held, read_facts
from rpbi_data.episodes.listing import details_of, table_of

HASH = "0" * 64
TOPIC = {"type": "t", "messages": 1, "rate_hz": 1.0, "max_gap_s": 0.1}


def _folder(path: Path, *facts: Any) -> EpisodeFolder:
    """Writes a folder of episodes with these descriptions; a text is written as it is."""
    folder = EpisodeFolder(path / "demos")
    for number, each in enumerate(facts):
        folder.folder_of(number).mkdir(parents=True)
        text = each if isinstance(each, str) else yaml.safe_dump({"number": number, **each})
        (folder.folder_of(number) / FACTS).write_text(text)
    return folder


def _description(**changes: Any) -> str:
    return json.dumps({"file": "~config", "config": "{}", "objects": [], "files": {}, "descriptions": {}, **changes})


@pytest.mark.parametrize(
    ("facts", "words"),
    [
        ({"files": [{"path": "/../../../x", "sha256": HASH}]}, "files[0].path: expected a path that stays below"),
        ({"files": [{"path": "/a", "sha256": f"../{HASH[3:]}"}]}, "files[0].sha256: expected 64 hex digits"),
        ({"files": [{"path": "/a", "sha256": HASH, "meshes": {"m": "/../x"}}]}, "expected a path that stays below"),
        ({"files": [{"path": "/a", "sha256": HASH}] * 2001}, "files: expected"),
        ({"topics": [1]}, "topics: expected"),
        ({"topics": {"/a/joint_states": {**TOPIC, "rate_hz": float("nan")}}}, "must be a finite number"),
        ({"topics": {"/a": {**TOPIC, "messages": 10**400}}}, "topics./a.messages: must be within"),
        ({"topics": {"/a": {**TOPIC, "messages": True}}}, "topics./a.messages: "),
        ({"seconds": float("inf")}, "seconds: must be a finite number"),
        ("number: 0\nversions: &a {a: *a}", "is not YAML"),
        ("[" * 5000, "is not YAML"),
        ("number: 0\nlabel: !!python/name:os.system x", "line 2"),
        (f"number: 0\nnote: {'x' * 2_000_001}", "expected at most 2000000"),
    ],
    ids=lambda value: str(value)[:40],
)
def test_odd_facts_break_their_row_alone(tmp_path: Path, facts: Any, words: str) -> None:
    folder = _folder(tmp_path, facts, {"label": "good"})
    with pytest.raises(EpisodeError, match="cannot be read"):
        folder.read(0)
    _, first, second = table_of(folder.all()).splitlines()
    assert words in first
    assert second.split()[:2] == ["1", "good"]


def test_control_characters_are_escaped_and_long_texts_cut(tmp_path: Path) -> None:
    odd = "\x1b]0;x\x07\u202e\n"
    folder = _folder(tmp_path, {"label": odd, "note": odd * 1000, "topics": {f"/{odd}": TOPIC}, "git": odd})
    shown = details_of(folder.read(0)) + table_of(folder.all())
    assert not {"\x1b", "\x07", "\u202e"} & set(shown)
    assert len(shown) < 20_000
    for label in (odd, "x" * 101):
        with pytest.raises(InterfaceError, match="expected a label of at most 100 characters"):
            folder.relabel(0, label)


def test_the_name_of_the_folder_has_the_number(tmp_path: Path) -> None:
    folder = _folder(tmp_path, {"number": 7})
    assert folder.read(0).number == 0
    for name in ("episode_0000001", "episode_٠٠٠٠٠٠", f"episode_{'9' * 300}"[:200]):
        (folder.path / name).mkdir()
    assert folder.numbers() == [0]


def test_links_and_pipes_are_rejected(tmp_path: Path) -> None:
    folder = _folder(tmp_path, {}, {}, {})
    outside = tmp_path / "outside"
    folder.folder_of(1).rename(outside)
    folder.folder_of(1).symlink_to(outside)
    (folder.folder_of(2) / FACTS).unlink()
    os.mkfifo(folder.folder_of(2) / FACTS)
    rows = table_of(folder.all()).splitlines()
    assert "expected no symbolic link" in rows[2] and "is not an ordinary file" in rows[3]
    os.mkfifo(folder.folder_of(0) / BAG)
    with pytest.raises(EpisodeError, match="expected an ordinary file"):
        file_in(folder.folder_of(0), BAG)
    (folder.path / "discarded").symlink_to(outside)
    with pytest.raises(ConfigError, match="expected no symbolic link"):
        folder.discard(0)
    assert sorted(each.name for each in outside.iterdir()) == [FACTS]


def test_a_label_is_not_written_through_links(tmp_path: Path) -> None:
    folder = _folder(tmp_path, {})
    outside = tmp_path / "outside"
    outside.mkdir()
    (outside / FACTS).write_text("mine")
    part = folder.folder_of(0) / f".{FACTS}.part"
    part.symlink_to(outside)
    folder.relabel(0, "good")
    part.mkdir()
    (part / FACTS).symlink_to(outside / FACTS)
    folder.relabel(0, "better")
    assert (outside / FACTS).read_text() == "mine"
    assert read_facts(folder.folder_of(0)).label == "better"


def test_copies_are_laid_out_below_the_folder_alone(tmp_path: Path) -> None:
    store, place = tmp_path / "files", tmp_path / "a/place"
    store.mkdir()
    (store / HASH).write_text("evil")
    for path in ("/../../x", "../x"):
        with pytest.raises(ConfigError, match="expected a path below the folder"):
            with_stored_files(_description(), [{"path": path, "sha256": HASH}], store, place)
    (store / HASH).unlink()
    (store / HASH).symlink_to("/etc/passwd")
    with pytest.raises(ConfigError, match="expected no symbolic link"):
        with_stored_files(_description(), [{"path": "/x", "sha256": HASH}], store, place)
    assert sorted(each.name for each in tmp_path.iterdir()) == ["files"]


@pytest.mark.parametrize("description", ["", "[]", "{}", _description(files=[]), _description(objects=[{}])])
def test_invalid_description_is_rejected(tmp_path: Path, description: str) -> None:
    with pytest.raises(ConfigError, match="rpbi/world_description"):
        store_files(description, tmp_path)


def test_files_outside_of_the_world_are_not_copied(tmp_path: Path) -> None:
    for name in ("world/main.yaml", "world/own.yaml", "world/.ssh/id", "private/secret.yaml", "private/world.yaml"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("password: 1")
    main = tmp_path / "world/main.yaml"
    main.write_text("dynamic_objects: [own.yaml]")
    names = ("world/own.yaml", "world/.ssh/id", "private/secret.yaml")
    files = {str(tmp_path / name): "" for name in names}
    paths = []
    for file, further in ((main, []), (tmp_path / "private/world.yaml", []), (main, [tmp_path / "private"])):
        description = _description(file=str(file), files=files)
        stored, faults = store_files(description, tmp_path / "files", files_of_world(description, further))
        paths.append([Path(each["path"]).name for each in stored])
        [text] = [each for each in faults if each.startswith("not copied")]
        assert text.count(str(tmp_path)) == len(files) - len(stored)
    assert paths == [["own.yaml"], [], ["own.yaml", "secret.yaml"]]
    for name in ("world/../private/secret.yaml", "world/own.yaml\x1b", "x"):
        path = name if name == "x" else f"{tmp_path}/{name}"
        for description in (
            _description(files={path: ""}),
            _description(files={path: ""}, descriptions={path: "<robot/>"}),
        ):
            stored, [fault] = store_files(description, tmp_path / "files")
            assert stored == [] and "not copied: expected the absolute path" in fault and "\x1b" not in fault


def test_a_urdf_outside_of_the_world_is_not_read(tmp_path: Path) -> None:
    urdf = tmp_path / "r.urdf"
    urdf.write_text('<robot name="r"><link name="l"/></robot>')
    description = _description(files={str(urdf): ""})
    stored, faults = store_files(description, tmp_path / "files", files_of_world(description))
    assert stored == [] and f"not copied, since they are in no folder of the world or of copy_from: {urdf}" in faults[0]


def test_the_lock_of_an_episode_is_held_by_one(tmp_path: Path) -> None:
    _, part = EpisodeFolder(tmp_path).begin()
    assert not is_held(part)
    handle = hold(part)
    assert is_held(part)
    with pytest.raises(BlockingIOError):
        hold(part)
    os.close(handle)
    assert not is_held(part)
