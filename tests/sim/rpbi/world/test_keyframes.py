"""Worlds go on from keyframes to the last bit, in any process, and what was before them is dropped."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pybullet
import pytest
import scripted_session
import sleeping_session
import streaming_session
from gripper import gripper
from soft_meshes import DEFORMABLE, GROUND, block
from worlds import BOX_FLOOR, FLOOR, ball, box, iiwa, write_world

from custom_ros_tools.errors import InterfaceError
from rpbi.config.pybullet_models import ChangeDynamics
from rpbi.replay.parallel import groups_of, in_forks, merged
from rpbi.replay.session import Checkpoint, Recording, Replay
from rpbi.world import World
from rpbi.world.forks import shadow as shadows
from rpbi.world.keyframes import keyframe as keyframes
from rpbi.world.keyframes.graph import GraphReader
from rpbi.world.keyframes.maker import KeyframeMaker
from rpbi.world.loading import load_object
from rpbi.world.saved.command_log import RecordedCommand
from rpbi.world.saved.description import WorldDescription
from rpbi.world.saved.values import FORMER_MODULES

AHEAD = 200
"""Ticks for which worlds go on."""
ELSEWHERE = """
import sys
from rpbi.world import World
world = World.from_state(sys.argv[1])
for _ in range(int(sys.argv[2])):
    world.step()
print("hash:", world.state_hash())
"""


def hash_later(world: World, ticks: int = AHEAD) -> str:
    """Returns the hash of a world after some ticks."""
    for _ in range(ticks):
        world.step()
    return world.state_hash()


@pytest.fixture
def heap(tmp_path):
    """Boxes that fall upon each other beside an arm that goes to a target."""
    boxes = tuple(box(f"box{turn}", basePosition=[0.6, 0.02 * turn, 0.1 + 0.21 * turn]) for turn in range(4))
    world = World.from_file(write_world(tmp_path, collision=(BOX_FLOOR,), dynamic=boxes, robots=(iiwa(),)))
    world.put("iiwa/target", {"lbr_iiwa_joint_2": 0.8})
    hash_later(world, 50)
    yield world
    world.close()


@pytest.mark.parametrize(
    ("session", "seed"),
    [
        (sleeping_session, 7006),
        pytest.param(sleeping_session, 7041, marks=pytest.mark.thorough),
        (streaming_session, 101),
    ],
)
def test_save_fork_predict_and_restore_agree_after_a_keyframe(tmp_path, session, seed):
    world = session.build(tmp_path, seed)
    session.run(world, seed, 500)
    file = tmp_path / "here.world"
    state = world.save(file, keyframe=True)
    assert state.commands == () and state.keyframe
    with world.fork()[0] as fork:
        fork.step(AHEAD)
        forked = fork.state_hash()
    (prediction,) = world.predict([[]], AHEAD)
    samples = [world.step() for _ in range(AHEAD)]
    expected = world.state_hash()
    assert forked == prediction.state_hash == expected
    other = World.from_state(file)
    assert [other.step() for _ in range(AHEAD)] == samples, "noise, filters and averages go on too"
    assert other.state_hash() == expected
    other.close()
    world.restore(state)
    assert world.clock.tick == state.tick and hash_later(world) == expected
    world.close()


def test_another_process_continues_from_a_keyframe(heap, tmp_path):
    heap.save(tmp_path / "here.world", keyframe=True)
    command = [sys.executable, "-c", ELSEWHERE, str(tmp_path / "here.world"), str(AHEAD)]
    done = subprocess.run(command, capture_output=True, text=True, env={**os.environ, "OPENBLAS_NUM_THREADS": "2"})
    assert f"hash: {hash_later(heap)}" in done.stdout.splitlines(), done.stderr


def test_commands_before_a_keyframe_are_dropped(heap):
    heap.keyframe()
    count = heap.commands.count
    heap.put("iiwa/target", {"lbr_iiwa_joint_2": 0.2})
    hash_later(heap, 20)
    state = heap.save()
    assert [each.what for each in state.commands] == ["input"] and heap.commands.count == count + 1
    again = World.from_state(state)
    assert again.state_hash() == state.state_hash and hash_later(again) == hash_later(heap)
    again.close()
    heap.reset()
    assert heap.save().keyframe == "", "a reset world begins at its start"


def test_a_keyframe_hardly_disturbs_the_world(tmp_path):
    ends = []
    for keyframe in (False, True):
        stack = tuple(box(f"box{turn}", basePosition=[0.0, 0.0, 0.1 + 0.2 * turn]) for turn in range(3))
        world = World.from_file(write_world(tmp_path, collision=(BOX_FLOOR,), dynamic=stack))
        hash_later(world, 500)
        if keyframe:
            world.keyframe()
        hash_later(world, 500)
        ends.append([world.bodies[each["name"]].base_pose().position for each in stack])
        world.close()
    for undisturbed, moved in zip(*ends):
        assert moved == pytest.approx(undisturbed, abs=1e-4)


def test_bodies_keep_their_ids_after_others_were_removed(heap):
    heap.remove("box0")
    heap.remove("box2")
    heap.add("dynamic", load_object("dynamic", ball("new", basePosition=[1.0, 1.0, 0.2]), "new.yaml"))
    ids = {name: body.body_id for name, body in heap.bodies.items()}
    state = heap.save(keyframe=True)
    other = World.from_state(state)
    assert {name: body.body_id for name, body in other.bodies.items()} == ids
    assert other.changed_names() == heap.changed_names() == {"box0", "box2", "new"}
    for world in (heap, other):
        world.add("dynamic", load_object("dynamic", ball("late", basePosition=[0.6, 0.0, 1.5]), "late.yaml"))
    assert other.bodies["late"].body_id == heap.bodies["late"].body_id and hash_later(other) == hash_later(heap)
    other.close()


def test_sleeping_bodies_sleep_on(tmp_path):
    asleep = {"activationState": "ACTIVATION_STATE_ENABLE_SLEEPING|ACTIVATION_STATE_SLEEP"}
    things = (
        ball("hung", basePosition=[0.0, 0.0, 1.0], changeDynamics=asleep),
        ball("woken", basePosition=[1.0, 0.0, 1.0], changeDynamics=asleep),
    )
    world = World.from_file(write_world(tmp_path, collision=(FLOOR,), dynamic=things))
    world.change_dynamics("woken", ChangeDynamics(activationState=pybullet.ACTIVATION_STATE_WAKE_UP))
    hash_later(world, 100)
    height = world.bodies["hung"].base_pose().position[2]
    world.keyframe()
    hash_later(world, 100)
    assert world.bodies["hung"].base_pose().position[2] == pytest.approx(height, abs=2e-5), "PyBullet's fall of a tick"
    assert world.bodies["woken"].base_pose().position[2] < 0.9
    world.close()


def test_masses_and_inertias_are_those_at_the_keyframe(heap):
    for change in (
        {"mass": 2.0},
        {"localInertiaDiagonal": (0.02, 0.03, 0.04)},
        {"mass": 3.0},
        {"lateralFriction": 0.2},
    ):
        heap.change_dynamics("box1", ChangeDynamics(**change))
    expected = heap.dynamics("box1")
    heap.keyframe()
    assert heap.dynamics("box1") == expected
    assert [entry.what for entry in heap.log].count("dynamics") == 4, "the renderer's copy goes on"


@pytest.fixture
def session(tmp_path):
    """A recording of a session with two keyframes, and with states in each of its three parts."""
    world = scripted_session.build(tmp_path)
    recording = Recording(WorldDescription(world.describe()))
    script = scripted_session.Script(301)
    for tick in range(300):
        script.act(world)
        world.step()
        if tick % 50 == 0:
            state = Checkpoint(0, world.clock.tick, world.commands.count, world.state_hash())
            recording.checkpoints.add(state)
        if tick in (99, 199):
            world.keyframe()
    recording.commands[0] = {k: RecordedCommand.of(each) for k, each in enumerate(world.commands.since(0)[1])}
    world.close()
    return recording


def test_looking_at_bodies_changes_no_keyframe(heap):
    state = heap.save()
    heap.keyframe()
    other = World.from_state(state)
    for body in other.bodies.values():
        body.base_pose()
    assert other.bodies["iiwa"].kinematics
    other.keyframe(heap.save().keyframe)
    other.close()


def test_keyframe_is_identical_for_the_same_files_elsewhere(tmp_path):
    texts = []
    for name in ("here", "there"):
        (folder := tmp_path / name).mkdir()
        world = World.from_file(write_world(folder, robots=(gripper(folder),)))
        hash_later(world, 20)
        texts.append(world.save(keyframe=True).keyframe)
        world.reset()
        if name == "there":
            names = {str(file).replace("/there/", "/here/"): str(file) for file in folder.glob("*.urdf")}
            moved = keyframes.renamed(texts[0], names)
            assert names and keyframes.difference(texts[0], texts[1]) and not keyframes.difference(moved, texts[1])
            world.enter_keyframe(moved)
        world.close()


@pytest.mark.parametrize("jobs", [1, 2, pytest.param(3, marks=pytest.mark.thorough)])
def test_parts_of_a_recording_agree_in_any_number_of_processes(session, jobs):
    groups = groups_of(session.parts(), jobs)
    assert len(groups) == jobs
    result = merged(in_forks(lambda parts: Replay(session).run(parts), groups))
    assert result == (7, 251, None, ())


def test_a_late_recording_is_replayed_from_its_first_keyframe_on(session):
    del session.commands[0][0]
    result = Replay(session).run()
    assert (
        result.agreed == 6 and len(result.left_out) == 1 and "command 0 is not in the recording" in result.left_out[0]
    )


def test_a_changed_command_or_keyframe_is_found_in_its_part(session):
    commands = session.commands[0]
    second, third = session.parts()[1:]
    end = commands[second.end]
    commands[second.end] = end._replace(data=commands[second.first - 1].data)
    with_wrong_end = Replay(session).run([second])
    assert "the keyframe at tick 200 is not the recorded one" in with_wrong_end.left_out[0]
    commands[second.end] = end
    for index in range(second.first, second.end):
        commands[index] = commands[index]._replace(what="halt", name="", data='"never"')
    assert Replay(session).run([third]).left_out == ()
    changed = Replay(session).run([second])
    assert changed.difference is not None or "is not the recorded one" in changed.left_out[0]


def test_a_maker_makes_keyframes_between_ticks(heap, caplog):
    maker = KeyframeMaker(heap, 0.1)
    for tick in range(350):
        heap.step()
        maker.poll()
        if tick == 105:
            heap.change_dynamics("box0", ChangeDynamics(lateralFriction=0.3))  # while it is built
    moved = [each.tick for each in heap.commands.since(0)[1] if each.what == "keyframe"]
    assert len(moved) == 3 and moved[0] > 150 + 6, "it was built again"
    again = World.from_state(heap.save())
    assert hash_later(again) == hash_later(heap)
    again.close()
    heap.add("faulty_lab:Thing", {"name": "thing"}, "thing.yaml")
    for _ in range(250):
        heap.step()
        maker.poll()
    assert caplog.text.count("keyframe_every_s: no keyframe at tick") == 1
    assert [each.what for each in heap.commands.since(0)[1]].count("keyframe") == 3


def test_a_maker_saves_the_state_of_a_keyframe(heap):
    maker = KeyframeMaker(heap, 0.0)
    asked = maker.save()
    while not asked.done():
        heap.step()
        maker.poll()
    state = asked.result()
    assert state.commands == () and state.keyframe and state.tick == heap.clock.tick
    again = World.from_state(state)
    assert hash_later(again) == hash_later(heap)
    again.close()
    heap.add("faulty_lab:Thing", {"name": "thing"}, "thing.yaml")
    refused = maker.save()
    maker.poll()
    with pytest.raises(InterfaceError, match="of another package"):
        refused.result(0)


def test_no_keyframe_is_made_while_a_state_is_restored(heap):
    state = heap.save()
    maker = KeyframeMaker(heap, 0.01)
    heap.mailbox.hold(lambda: "the world is being restored")
    for _ in heap.restoring(state):
        maker.poll()
    assert not heap.save().keyframe


def test_forking_process_continues_at_later_keyframes(heap, monkeypatch):
    monkeypatch.setattr(shadows, "MAX_COPIED_MB", 0.0)  # so that it is a program
    processes = set()
    for target in (0.4, 0.6, 0.2):
        heap.keyframe()
        heap.put("iiwa/target", {"lbr_iiwa_joint_2": target})
        hash_later(heap, 20)
        (prediction,) = heap.predict([[]], AHEAD)
        processes.add(heap._shadow._process.pid)
        assert prediction.state_hash == hash_later(heap)
    assert len(processes) == 1
    heap.reset()
    (prediction,) = heap.predict([[]], AHEAD)
    assert prediction.state_hash == hash_later(heap)


def test_worlds_with_unknown_state_are_refused(heap, tmp_path):
    soft = World.from_file(write_world(tmp_path, collision=(GROUND,), soft=(block(tmp_path),), **DEFORMABLE))
    with pytest.raises(InterfaceError, match="is soft"):
        soft.keyframe()
    soft.close()
    heap.add("faulty_lab:Thing", {"name": "thing"}, "thing.yaml")
    with pytest.raises(InterfaceError, match="'thing' is a Thing of another package"):
        heap.save(keyframe=True)
    heap.remove("thing")
    before = heap.state_hash()
    heap.bodies["iiwa"].motors.unknown = open(os.devnull)  # noqa: SIM115
    with heap.bodies["iiwa"].motors.unknown, pytest.raises(InterfaceError, match=r"iiwa\.motors\.unknown: a keyframe"):
        heap.keyframe()
    assert heap.state_hash() == before, "it goes on as it was"
    heap.pb.changeDynamics(heap.bodies["box1"].body_id, -1, lateralFriction=0.1)
    with pytest.raises(InterfaceError, match="not recorded acts: PyBullet's changeDynamics"):
        heap.keyframe()


def test_keyframe_with_former_names_of_classes_is_read(heap):
    state = heap.save(keyframe=True)
    older = text = keyframes._unpacked(state.keyframe)
    for former, present in FORMER_MODULES.items():
        older = older.replace(f'"{present}:', f'"{former}:')
    assert older != text
    again = World.from_state(state._replace(keyframe=keyframes._packed(older)))
    assert hash_later(again) == hash_later(heap)
    again.close()


@pytest.mark.parametrize(
    ("written", "forged", "reason"),
    [
        ('"format":2', '"format":9', "format 9, this version reads 2"),
        ("{", "{", "keyframe: "),
        ("rpbi.world.keyframes.motion:BodyMotion", "subprocess:Popen", "makes no sense"),
        ("rpbi.control.motors:Motors", "rpbi.engine.client:Client", "does not come while a world runs"),
        ('"_told"', '"__class__"', "is no attribute of a state"),
        ('"targets"', '"unheard"', "does not take the state"),
    ],
)
def test_forged_keyframes_are_refused(heap, written, forged, reason):
    state = heap.save(keyframe=True)
    text = keyframes._unpacked(state.keyframe)
    text = "{" if written == forged else text.replace(written, forged)
    with pytest.raises(InterfaceError, match=reason):
        World.from_state(state._replace(keyframe=keyframes._packed(text)))
    with pytest.raises(InterfaceError, match="expected a keyframe"):
        World.from_state(state._replace(keyframe="no base64"))


def test_motions_that_would_end_the_process_are_refused(heap):
    state = heap.save(keyframe=True)
    text = keyframes._unpacked(state.keyframe)
    for forged in ("NaN", "1", '"x"', "[]"):
        end = text.index("BodyMotion")
        number = text.index("[", text.index("tuple", end)) + 1
        cut = text[:number] + forged + text[text.index(",", number) :]
        with pytest.raises(InterfaceError, match="makes no sense"):
            World.from_state(state._replace(keyframe=keyframes._packed(cut)))


def test_forged_schedule_of_sensors_is_not_used(heap):
    state = heap.save(keyframe=True)
    text = keyframes._unpacked(state.keyframe)
    backwards = re.sub(r'\["_numerator",(\d+)\]', r'["_numerator",-\1]', text)
    assert backwards != text
    forged = World.from_state(state._replace(keyframe=keyframes._packed(backwards)))
    for _ in range(50):
        assert forged.step() == heap.step(), "it ends, with the samples that are due"
    forged.close()


def test_files_with_keyframes_read_back(heap, tmp_path: Path):
    state = heap.save(tmp_path / "here.world", keyframe=True)
    assert type(state).read(tmp_path / "here.world") == state


@pytest.mark.parametrize(
    "attributes, named",
    [
        ([["halt", ["method", ["anchor", "arm"], "link_pose"]]], "halt"),
        (
            [
                [
                    "later",
                    [
                        "method",
                        ["named", "rpbi.world.saved.state:WorldState", ["", ["tuple", [], 1], 0, ""], 0],
                        "write",
                    ],
                ]
            ],
            "write",
        ),
        ([["later", ["method", ["anchor", "arm"], "__init__"]]], "__init__"),
        ([["__class__", 1]], "__class__"),
    ],
    ids=["hides a method", "writes a file", "special", "class"],
)
def test_forged_keyframe_replaces_no_method_and_calls_no_other(tmp_path, attributes, named):
    world = World.from_file(write_world(tmp_path, robots=(iiwa(),)))
    arm = world.bodies["iiwa"]
    reader = GraphReader((), {"arm": arm})
    reader.fill(arm, [["later", ["method", ["anchor", "arm"], "link_pose"]]])
    assert arm.later == arm.link_pose
    with pytest.raises(ValueError, match=f"'{named}' is no"):
        reader.fill(arm, attributes)
    world.close()
