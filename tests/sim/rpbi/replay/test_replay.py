"""Recorded sessions, replayed in another process."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pybullet
import pytest
import scripted_session as script
import yaml
from worlds import box, write_world

from custom_ros_tools.errors import ConfigError
from custom_ros_tools.plugins import find
from rpbi.config.pybullet_models import ChangeDynamics
from rpbi.control.motors import ResolvedCommand
from rpbi.geometry import Pose
from rpbi.replay.session import Replay
from rpbi.world import World
from rpbi.world.loading import load_world
from rpbi.world.saved.description import WorldDescription
from rpbi.world.saved.values import FORMER_MODULES, FORMER_NAMES, from_text, to_text

TICKS = 3000
EXAMPLES = Path(__file__).resolve().parents[4] / "src" / "rpbi_examples" / "configs"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("session")


SEEDS = range(3)
KINDS = {
    *("input", "add", "remove", "dynamics", "physics", "sensor_rate", "attach", "detach", "push", "switch_mode"),
    *("set_gains", "switch_controllers", "set_controller_gains", "move", "follow", "teleport", "set_joint_state"),
}


@pytest.fixture(scope="module")
def sessions(folder):
    return [script.record(seed, TICKS, folder) for seed in SEEDS]


@pytest.fixture(scope="module")
def session(sessions):
    return sessions[1]


def test_the_sessions_have_every_kind_of_command(sessions):
    assert {command.what for each in sessions for _, command in each["commands"]} >= KINDS


@pytest.mark.parametrize("seed", SEEDS)
def test_session_with_contacts_is_identical_in_a_new_process(seed, sessions):
    recorded = sessions[seed]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    command, text = [sys.executable, script.__file__], json.dumps(recorded)
    printed = subprocess.run(command, input=text, capture_output=True, text=True, check=True, env=environment).stdout
    agreed, difference, left_out = json.loads(printed.partition("result: ")[2])
    assert (agreed, difference, left_out) == (1 + TICKS // 500, None, [])


def test_classes_of_older_recordings_are_found_by_their_present_names():
    for former, present in FORMER_NAMES.items():
        assert find(present).__module__ == present.partition(":")[0]
        with pytest.raises(ValueError):
            find(former)
    for former, present in FORMER_MODULES.items():
        import_module(present)
        with pytest.raises(ModuleNotFoundError):
            import_module(former)


def test_an_older_recording_can_be_read():
    plain = json.loads(to_text(ResolvedCommand(2, {0: 0.1})))
    (fields,) = plain.values()
    assert from_text(json.dumps({"rpbi.control.motors:Command": fields})) == ResolvedCommand(2, {0: 0.1})


def test_a_command_that_is_changed_a_little_is_found(session):
    index, command = next((i, c) for i, c in session["commands"] if c.name == "mobile/cmd_vel" and c.tick > 1000)
    velocity = from_text(command.data)
    changed = command._replace(data=to_text(velocity._replace(x=velocity.x + 1e-12)))
    assert changed != command
    commands = {**dict(session["commands"]), index: changed}
    result = Replay(script.read({**session, "commands": list(commands.items())})).run()
    assert result.difference is not None
    agreed, differing = result.difference.last_agreement, result.difference.checkpoint
    assert agreed.tick <= command.tick < differing.tick == agreed.tick + 500


def test_recording_without_a_command_reports_it_and_stops_there(session):
    lost = next(index for index, command in session["commands"] if command.tick > 1000)
    commands = [(index, command) for index, command in session["commands"] if index != lost]
    result = Replay(script.read({**session, "commands": commands})).run()
    assert result.difference is None
    assert result.agreed == 3  # the start, 500 and 1000
    assert f"command {lost}" in result.left_out[0]


@pytest.mark.parametrize(
    "senseless",
    [
        {"what": "explode"},
        {"name": "mobile/nothing", "what": "input"},
        {"name": "mobile/cmd_vel", "what": "input", "data": "1.0"},
        {"name": "nobody"},
        {"data": "{{"},
    ],
)
def test_invalid_command_ends_the_replay_with_its_tick(session, senseless):
    index, command = session["commands"][0]
    commands = {**dict(session["commands"]), index: command._replace(**senseless)}
    result = Replay(script.read({**session, "commands": list(commands.items())})).run()
    assert result.agreed == 1 and result.difference is None  # the start
    assert f"from tick {command.tick} on" in result.left_out[0]


def test_session_after_a_reset_can_be_replayed_alone(folder):
    world = script.build(folder)
    description = world.describe()
    script.run(world, 5, 200)
    world.reset()
    checkpoints = script.run(world, 6, 1000)
    recording = script.Recording(WorldDescription(description), {1: script.recorded(world)}, set(checkpoints))
    world.close()
    result = Replay(recording).run()
    assert (result.agreed, result.difference, result.left_out) == (3, None, ())


def test_a_world_whose_file_changed_is_warned_of(folder, session):
    path = folder / "mobile_base.urdf"
    text = path.read_text()
    path.write_text(text.replace("40.0", "41.0"))
    try:
        assert [warning for warning in WorldDescription(session["description"]).warnings if str(path) in warning]
        result = Replay(script.read(session)).run()
    finally:
        path.write_text(text)
    assert result.difference is not None


def test_a_world_whose_file_has_gone_is_refused(folder, session):
    path = folder / "mobile_base.urdf"
    text = path.read_text()
    path.unlink()
    try:
        with pytest.raises(ConfigError, match=r"mobile_base\.urdf"):
            Replay(script.read(session))
    finally:
        path.write_text(text)


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"format": 99}'])
def test_invalid_description_is_refused(text):
    with pytest.raises(ValueError, match="description"):
        WorldDescription(text)


@pytest.mark.parametrize(
    "value",
    [
        0.1 + 0.2,
        5e-324,
        -0.0,
        float("inf"),
        2**53 + 1,
        None,
        "ä",
        (1, 2.0, (3,)),
        Pose((1 / 3, 0.0, 1.0)),
        ResolvedCommand(2, {3: 0.1, 0: 1e-17}),
        ("dynamic", ChangeDynamics(mass=0.1, lateralFriction=1 / 3)),
    ],
    ids=str,
)
def test_values_read_back_to_the_last_bit(value):
    assert repr(from_text(to_text(value))) == repr(value)


@pytest.mark.parametrize("path", sorted(EXAMPLES.rglob("config.yaml")), ids=lambda path: path.parent.name)
def test_the_configuration_of_every_example_reads_back_as_it_was(path):
    loaded = load_world(str(path))
    for config in (loaded.config, *(item.config for item in loaded.objects)):
        again = from_text(to_text(config))
        assert again == config
        assert again.model_fields_set == config.model_fields_set


def test_values_that_cannot_be_recorded_are_refused():
    with pytest.raises(TypeError, match="object"):
        to_text((1, object()))


@pytest.mark.parametrize(
    "text",
    ['{"os:system": ["true"]}', '{"subprocess:Popen": [["true"]]}', '{"nowhere:Class": []}', "{", '{"a": 1, "b": 2}'],
)
def test_a_recording_can_have_nothing_called_but_values(text):
    with pytest.raises(ValueError):
        from_text(text)


@pytest.mark.parametrize("how", ["relative", "full", "package"])
def test_changed_object_file_is_reported_for_every_form_of_name(how, tmp_path, monkeypatch):
    folder = tmp_path / "my_lab"
    folder.mkdir()
    (folder / "package.xml").write_text("<package><name>my_lab</name></package>")
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"{tmp_path}:{os.environ.get('ROS_PACKAGE_PATH', '')}")
    write_world(folder, dynamic=(box("box"),))
    name = {"relative": "", "full": f"{folder}/", "package": "{my_lab}/"}[how] + "box.yaml"
    main = yaml.safe_load((folder / "world.yaml").read_text()) | {"dynamic_objects": [name]}
    (folder / "world.yaml").write_text(yaml.safe_dump(main))
    world = World.from_file(str(folder / "world.yaml"), connection_mode=pybullet.DIRECT)
    text = world.describe()
    world.close()
    assert WorldDescription(text).warnings == []
    with open(folder / "box.yaml", "a") as file:
        file.write("# changed\n")
    assert WorldDescription(text).warnings == [f"{folder}/box.yaml: is another file than when the world was recorded"]
