"""States of other people: what they may import, how large and old they may be, and which faults are found at once."""

from __future__ import annotations

import gzip
import json
import os
import sys

import pytest
from worlds import FLOOR, box, iiwa, write_world

from custom_ros_tools.errors import ConfigError, InterfaceError
from rpbi.replay.session import Checkpoint, Recording, Replay
from rpbi.world import World
from rpbi.world.saved import state as state_files
from rpbi.world.saved.command_log import RecordedCommand
from rpbi.world.saved.description import WorldDescription
from rpbi.world.saved.state import WorldState

CANARY = "import pathlib; pathlib.Path(__file__).with_name('canary').touch()\nclass Thing: pass\n"
CHANGES = {
    "a value": {"command": RecordedCommand(0, "box/target", "input", '{"planted:Thing":[]}')},
    "an object": {"command": RecordedCommand(0, "", "add", '["planted:Thing",{"pairs":[["name","x"]]}]')},
    "a configuration": {"config": '{"planted:Thing":{}}'},
    "a type": {"type": "planted:Thing"},
}
"""Places of a state that name a class, and what they name there."""


@pytest.fixture
def world(tmp_path):
    """A world with a box after 5 ticks."""
    world = World.from_file(write_world(tmp_path, collision=(FLOOR,), dynamic=(box("box"),)))
    for _ in range(5):
        world.step()
    yield world
    world.close()


@pytest.fixture
def state(world):
    """Its state."""
    return world.save()


@pytest.fixture
def canary(tmp_path, monkeypatch):
    """A file that a module `planted` writes when it is imported."""
    (tmp_path / "planted.py").write_text(CANARY)
    monkeypatch.syspath_prepend(tmp_path)
    yield tmp_path / "canary"
    sys.modules.pop("planted", None)


def changed(state: WorldState, command: RecordedCommand | None = None, **of_object: str) -> WorldState:
    """Returns the state with a further command, or with other texts in its last object."""
    if command is not None:
        return state._replace(commands=(command, *state.commands))
    description = json.loads(state.description)
    description["objects"][-1].update(of_object)
    return state._replace(description=json.dumps(description))


@pytest.mark.parametrize("change", CHANGES)
def test_a_state_imports_nothing_that_is_not_trusted(state, canary, change):
    hostile = changed(state, **CHANGES[change])
    with pytest.raises(InterfaceError, match=r"'planted:Thing' is not trusted, so it is not imported: .*trust="):
        World.from_state(hostile)
    assert not canary.exists()
    with pytest.raises(InterfaceError, match="planted"):
        World.from_state(hostile, trust=["planted"])
    assert canary.exists(), "the control: a trusted package is imported"


def test_restore_and_replay_import_nothing_that_is_not_trusted(world, state, canary):
    with pytest.raises(InterfaceError, match="'planted:Thing' is not trusted"):
        world.restore(changed(state, **CHANGES["a value"]))
    with pytest.raises(ConfigError, match="'planted:Thing' is not trusted"):
        Replay(Recording(WorldDescription(changed(state, **CHANGES["a type"]).description)))
    assert not canary.exists()


FORGERIES = {
    "another hash": lambda text: text.replace(b'"state_hash": "', b'"state_hash": "0', 1),
    "a later tick": lambda text: text.replace(b'"tick": 5', b'"tick": 19999999', 1),
    "another command": lambda text: text.replace(b"\n", b'\n[0, "", "halt", "\\"\\""]\n', 1),
    "no seal": lambda text: text[:-64],
}


@pytest.mark.parametrize("forgery", FORGERIES)
def test_a_forged_file_is_refused_before_it_is_simulated(state, tmp_path, monkeypatch, forgery):
    file = tmp_path / "forged.world"
    state.write(file)
    file.write_bytes(gzip.compress(FORGERIES[forgery](gzip.decompress(file.read_bytes()))))
    monkeypatch.setattr(World, "step", lambda _: pytest.fail("it was simulated"))
    with pytest.raises(ConfigError, match=r"forged\.world: expected a state that World\.save of this version wrote"):
        World.from_state(file)


def test_an_old_state_is_refused_without_max_ticks(world, state):
    World.from_state(state, max_ticks=5).close()
    for read in (World.from_state, world.restore):
        with pytest.raises(InterfaceError, match="at most 20000000 ticks from the start, got one of 20000001 ticks"):
            read(state._replace(tick=20_000_001))


def test_another_start_is_noticed_before_the_first_tick(state, monkeypatch):
    description = json.loads(state.description) | {"start_hash": "0" * 32}
    description["files"] = {__file__: "0" * 64}
    monkeypatch.setattr(World, "step", lambda _: pytest.fail("it was simulated"))
    with pytest.raises(InterfaceError, match="not the saved one at its start: .*is another file than when"):
        World.from_state(state._replace(description=json.dumps(description)))


def test_commands_out_of_order_are_refused(state, tmp_path):
    for ticks in ((3, 2), (-1, 2), (0, 6)):
        commands = tuple(RecordedCommand(tick, "", "halt", '""') for tick in ticks)
        state._replace(commands=commands).write(tmp_path / "order.world")
        with pytest.raises(ConfigError, match="not in order, or beyond its own"):
            WorldState.read(tmp_path / "order.world")


@pytest.mark.parametrize("name", ["box\x1b[2J", "box\n"])
def test_names_and_hashes_cannot_write_to_a_terminal(state, tmp_path, name):
    file = tmp_path / "names.world"
    for hostile in (
        state._replace(commands=(RecordedCommand(0, name, "halt", '""'),)),
        state._replace(state_hash=name),
    ):
        hostile.write(file)
        with pytest.raises(ConfigError, match="control characters|hexadecimal") as caught:
            WorldState.read(file)
        assert str(caught.value).isprintable()


def test_pipes_and_files_that_unfold_too_far_are_refused(state, tmp_path, monkeypatch):
    os.mkfifo(tmp_path / "pipe.world")
    with pytest.raises(ConfigError, match="is not an ordinary file"):
        WorldState.read(tmp_path / "pipe.world")
    monkeypatch.setattr(state_files, "MAX_BYTES", 100_000)
    bomb = tmp_path / "bomb.world"
    for text, reason in (
        (b"[" * 1000, "levels"),
        (b" " * 200_000, "over 100000 bytes"),
        (b'{"format": 2, "commands": 3000000000}', "KeyError|description"),
    ):
        bomb.write_bytes(gzip.compress(text))
        with pytest.raises(ConfigError, match=reason):
            WorldState.read(bomb)
    with pytest.raises(InterfaceError, match="expected at most 100000 bytes"):
        state._replace(description=" " * 200_000).write(bomb)


def test_descriptions_cannot_grow_the_text_of_a_configuration(state):
    description = json.loads(state.description) | {"descriptions": {"a": "<robot/>" * 1000}}
    with pytest.raises(ValueError, match="has a text for 'a'"):
        WorldDescription(json.dumps(description))


def test_a_configuration_that_does_not_fit_is_reported_by_key(state):
    config = '{"rpbi.bodies.dynamic:DynamicObjectConfig":{"name":"box","baseMass":"1","size":2}}'
    with pytest.raises(ConfigError) as caught:
        World.from_state(changed(state, config=config))
    assert {(each.file, each.key) for each in caught.value.problems} >= {("box.yaml", "baseMass"), ("box.yaml", "size")}


def test_a_value_that_fails_in_a_later_step_is_named(tmp_path):
    world = World.from_file(write_world(tmp_path, collision=(FLOOR,), robots=(iiwa(),)))
    world.put("iiwa/target", {"lbr_iiwa_joint_2": 0.1})
    for _ in range(5):
        world.step()
    state = world.save()
    world.close()
    hostile = state._replace(
        commands=tuple(each._replace(data=each.data.replace("0.1", "[1]")) for each in state.commands)
    )
    with pytest.raises(InterfaceError, match="tick 0: "):
        World.from_state(hostile)
    commands = {0: dict(enumerate(hostile.commands))}
    checkpoint = Checkpoint(0, state.tick, len(state.commands), state.state_hash)
    result = Replay(Recording(WorldDescription(state.description), commands, {checkpoint})).run()
    assert "from tick 0 on" in result.left_out[0]
