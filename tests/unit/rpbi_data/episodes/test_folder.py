"""Folders of episodes, their descriptions and tables."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from rpbi_data.episodes.errors import EpisodeError
from rpbi_data.episodes.files import changed_files, newer_files, store_files, with_stored_files
from rpbi_data.episodes.folder import FACTS, EpisodeFolder
from rpbi_data.episodes.listing import details_of, table_of

TOPICS = {
    "/a/joint_states": {"type": "sensor_msgs/JointState", "messages": 90, "rate_hz": 100.0, "max_gap_s": 0.02},
    "/b/joint_states": {"type": "sensor_msgs/JointState", "messages": 40, "rate_hz": 50.0, "max_gap_s": 0.03},
}


def _record(folder: EpisodeFolder, label: str = "") -> int:
    episode, part = folder.begin(seeds="7")
    episode.state, episode.label, episode.topics = "complete", label, TOPICS
    folder.complete(part, episode)
    return episode.number


def test_an_episode_gets_its_name_when_it_is_complete(tmp_path: Path) -> None:
    folder = EpisodeFolder(tmp_path / "demos")
    episode, part = folder.begin()
    assert (part.name, folder.numbers(), folder.partial()) == (".episode_000000.part", [], [part])
    folder.complete(part, episode)
    assert (folder.numbers(), folder.partial()) == ([0], [])
    assert folder.read(0) == episode


def test_an_episode_may_have_a_fixed_number_that_is_free(tmp_path: Path) -> None:
    folder = EpisodeFolder(tmp_path)
    episode, part = folder.begin(7)
    assert (episode.number, part) == (7, folder.part_of(7))
    with pytest.raises(EpisodeError, match="expected a number that is not used, got 7"):
        folder.begin(7)
    folder.complete(part, episode)
    folder.discard(7)
    assert folder.taken() == {7} and folder.numbers() == []
    with pytest.raises(EpisodeError, match="got 7"):
        folder.begin(7)
    assert folder.begin()[0].number == 8


def test_numbers_of_discarded_episodes_are_not_used_again(tmp_path: Path) -> None:
    folder = EpisodeFolder(tmp_path)
    assert [_record(folder) for _ in range(3)] == [0, 1, 2]
    assert folder.discard(2) == tmp_path / "discarded/episode_000002"
    assert _record(folder) == 3
    assert folder.numbers() == [0, 1, 3]


def test_a_label_is_changed_and_the_rest_stays(tmp_path: Path) -> None:
    folder = EpisodeFolder(tmp_path)
    _record(folder, "failure")
    folder.relabel(0, "success")
    episode = folder.read(0)
    assert (episode.label, episode.seeds, episode.topics) == ("success", "7", TOPICS)


def test_missing_or_unreadable_episodes_are_named(tmp_path: Path) -> None:
    folder = EpisodeFolder(tmp_path)
    _record(folder)
    with pytest.raises(EpisodeError, match="no episode 5; there are 0"):
        folder.discard(5)
    with pytest.raises(EpisodeError, match="expected a folder of episodes, there is none"):
        EpisodeFolder(tmp_path / "missing").numbers()
    for text, words in (
        ("[", "line 1, column 2: expected"),
        ("seeds: x", "number: missing"),
        ("number: 0\nwrong: 1", "wrong: unknown key 'wrong'"),
        ("number: 0\nlabel: 1", "label: expected text, got 1"),
        ("number: 0\ntopics: {/a: {messages: 1}}", "topics./a.type: missing"),
    ):
        (tmp_path / "episode_000000" / FACTS).write_text(text)
        with pytest.raises(EpisodeError, match=f"episode.yaml: cannot be read: {words}"):
            folder.read(0)
        assert f"  cannot be read: {words}" in table_of(folder.all())


def test_the_table_has_lowest_rate_longest_gap_and_losses(tmp_path: Path) -> None:
    folder = EpisodeFolder(tmp_path)
    _record(folder, "success")
    episode = folder.read(0)
    episode.published = {"/a/joint_states": 93, "/b/joint_states": 40}
    header, row = table_of([episode]).splitlines()
    assert header.split("  ")[0] == "episode"
    assert row.split() == [
        "0",
        "success",
        "0.0",
        "0.9",
        "130",
        "50",
        "Hz",
        "30",
        "ms",
        "complete,",
        "3",
        "messages",
        "lost",
    ]
    assert "/a/joint_states: 90 messages, 3 lost, 100 Hz, longest gap 20 ms" in details_of(episode)
    assert ", 0.0 s, 0.9 s simulated\n" in details_of(episode)
    episode.topics = {}
    assert table_of([episode]).splitlines()[1].split()[3] == "-"


URDF = '<robot name="r"><link name="l"><visual><geometry><mesh filename="part.stl"/></geometry></visual></link></robot>'


@pytest.fixture
def description(tmp_path: Path) -> str:
    """The description of a world with a URDF that names a mesh, and a YAML file."""
    source = tmp_path / "source"
    source.mkdir()
    for name, text in (("r.urdf", URDF), ("part.stl", "solid"), ("r.yaml", "name: r")):
        (source / name).write_text(text)
    paths = [str(source / name) for name in ("r.urdf", "r.yaml")]
    objects = [{"type": "urdf", "file": paths[1], "config": json.dumps({"fileName": paths[0]})}]
    hashes = dict.fromkeys(paths, "")
    return json.dumps({"config": "{}", "objects": objects, "files": hashes, "descriptions": {}})


def test_files_are_stored_by_content_and_worlds_read_the_copies(description: str, tmp_path: Path) -> None:
    store = tmp_path / "files"
    files, faults = store_files(description, store)
    assert {Path(each["path"]).name for each in files} == {"r.urdf", "r.yaml", "part.stl"}
    assert len(faults) == 2 and "has changed since the world was loaded" in faults[0]
    assert store_files(description, store)[0] == files and len(list(store.iterdir())) == 3
    for each in (tmp_path / "source").iterdir():
        each.unlink()
    place = tmp_path / "place"
    [thing] = json.loads(with_stored_files(description, files, store, place))["objects"]
    urdf = Path(json.loads(thing["config"])["fileName"])
    mesh = urdf.with_name("part.stl")
    assert urdf.is_relative_to(place) and mesh.read_text() == "solid"
    assert f'filename="{mesh}"' in urdf.read_text()


def test_a_changed_or_missing_copy_is_named(description: str, tmp_path: Path) -> None:
    store = tmp_path / "files"
    files, _ = store_files(description, store)
    assert list(changed_files(files, store)) == list(newer_files(files)) == []
    (tmp_path / "source/r.yaml").write_text("name: t")
    (tmp_path / "source/part.stl").unlink()
    assert list(newer_files(files)) == [f"{tmp_path}/source/r.yaml differs from its copy in the episode"]
    (copy,) = store.glob("*.yaml")
    copy.write_text("name: s")
    next(store.glob("*.stl")).unlink()
    faults = "\n".join(changed_files(files, store))
    assert f"files/{copy.name}, the copy of {tmp_path}/source/r.yaml, was changed" in faults
    assert "part.stl, is missing" in faults
