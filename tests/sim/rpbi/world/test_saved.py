"""Saved, restored and forked worlds go on as the world itself does, to the last bit; and what cannot be is named."""

from __future__ import annotations

import gzip
import os
import pickle
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import costs
import numpy as np
import pybullet
import pytest
import scripted_session as script
import sleeping_session
from soft_meshes import DEFORMABLE, GROUND, block
from worlds import FLOOR, box, iiwa, write_world

from custom_ros_tools.errors import ConfigError, InterfaceError, UnknownNameError
from rpbi.config.pybullet_world_models import SetGravity
from rpbi.geometry import Pose
from rpbi.world import World
from rpbi.world.forks import following
from rpbi.world.forks.prediction import Prediction, PredictionJob
from rpbi.world.forks.shadow import Shadow
from rpbi.world.saved.command_log import MAX_KEPT
from rpbi.world.saved.state import WorldState

TARGET = "iiwa/target"
AHEAD = 300
"""Ticks for which worlds go on."""
SLEEPY = 5002
"""Seed of a session among bodies that sleep, with a controller that solves equations."""
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


def hash_elsewhere(file: Path, ticks: int = AHEAD) -> str:
    """Returns the hash of a saved world after some ticks in another process."""
    command = [sys.executable, "-c", ELSEWHERE, str(file), str(ticks)]
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "2"}  # here, and in forks, it is one
    done = subprocess.run(command, capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr
    return next(line.partition(": ")[2] for line in done.stdout.splitlines() if line.startswith("hash: "))


@pytest.fixture
def arm(tmp_path, monkeypatch):
    """An arm beside a box, under way to a target."""
    path = write_world(tmp_path, collision=(FLOOR,), dynamic=(box("box"),), robots=(iiwa(),))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join((str(Path(costs.__file__).parent), *sys.path)))
    world = World.from_file(path, connection_mode=pybullet.DIRECT)
    world.put(TARGET, {"lbr_iiwa_joint_2": 0.8})
    hash_later(world, 50)
    yield world
    world.close()


@pytest.mark.parametrize("seed", [301, pytest.param(302, marks=pytest.mark.thorough), SLEEPY])
def test_session_continues_identically_when_saved_forked_or_predicted(tmp_path, seed):
    if seed == SLEEPY:
        world = sleeping_session.build(tmp_path, seed)
        sleeping_session.run(world, seed, 700)
    else:
        world = script.build(tmp_path)
        script.run(world, seed, 700)
    state = world.save(tmp_path / "here.world")
    with world.fork()[0] as fork:
        fork.step(AHEAD)
        forked = fork.state_hash()
    expected = hash_later(world)
    assert forked == expected
    assert hash_elsewhere(tmp_path / "here.world") == expected
    world.restore(state)
    assert world.clock.tick == state.tick and hash_later(world) == expected
    world.close()


def test_state_saved_by_pybullet_alone_does_not_suffice(tmp_path):
    world = script.build(tmp_path)
    script.run(world, 301, 700)
    saved = world.pb.saveState()
    expected = hash_later(world)
    world.pb.restoreState(saved)
    world.clock.tick -= AHEAD
    assert hash_later(world) != expected
    world.close()


def test_prediction_equals_the_later_outcome(arm):
    candidates = [
        [(20 * k, TARGET, {"lbr_iiwa_joint_1": 0.1 * turn + 0.01 * k}) for k in range(5)] for turn in range(3)
    ]
    predictions = arm.predict(candidates, 150, watch=["iiwa", "box"], every=50, cost="costs:height")
    assert [each.fault for each in predictions] == [""] * 3
    assert len({each.state_hash for each in predictions}) == 3
    chosen = predictions[1]
    assert list(chosen.ticks) == [50, 100, 150]
    assert chosen.poses["box"].shape == (3, 7) and chosen.joints["iiwa"].shape == (3, 7)
    assert chosen.contacts["box"].min() > 0.0, "it lies on the floor"
    total = 0.0
    for tick in range(150):
        for planned in candidates[1]:
            if planned[0] == tick:
                arm.put(*planned[1:])
        arm.step()
        total += costs.height(arm)
    assert arm.state_hash() == chosen.state_hash
    assert total == chosen.cost
    again = arm.predict([[]], 10)  # it has followed
    assert hash_later(arm, 10) == again[0].state_hash


def test_a_prepared_world_predicts_from_its_present_state(arm):
    arm.prepare_forks()
    hash_later(arm, 20)
    (prediction,) = arm.predict([[(0, TARGET, {"lbr_iiwa_joint_2": 0.5})]], 30)
    arm.put(TARGET, {"lbr_iiwa_joint_2": 0.5})
    assert hash_later(arm, 30) == prediction.state_hash


def test_process_killed_at_start_is_reported_and_the_next_predicts(arm):
    arm.prepare_forks()
    arm._shadow._process.kill()
    with pytest.raises(InterfaceError, match="the process that follows the world has ended"):
        arm.predict([[]], 5)
    assert hash_later(arm, 5) and arm.predict([[]], 5)[0].fault == ""


@pytest.mark.parametrize(
    "cost, fault",
    [
        ("costs:broken", "RuntimeError: no such thing"),
        ("costs:endless", "cost: expected a finite number at tick 1, got nan"),
        ("costs:killed", "its process ended early"),
        ("costs:unwritten", "its process ended early"),
        ("nowhere:cost", "nowhere"),
    ],
)
def test_failing_cost_is_named_and_the_world_continues(arm, cost, fault):
    before = arm.state_hash()
    (prediction,) = arm.predict([[]], 5, cost=cost)
    assert fault in prediction.fault and prediction.cost == float("inf")
    assert arm.state_hash() == before
    assert arm.predict([[]], 5)[0].fault == ""


@pytest.mark.parametrize(("cost", "fault"), [("hungry", "MemoryError"), ("cut", "its process ended early")])
def test_a_candidate_without_memory_costs_itself_alone(arm, cost, fault):
    first, second, third = arm.predict([[], [(0, TARGET, {"lbr_iiwa_joint_1": 1.0})], []], 30, cost=f"costs:{cost}")
    assert fault in second.fault and second.cost == float("inf")
    assert (first.fault, third.fault) == ("", "") and first.state_hash == third.state_hash


def test_an_answer_that_is_cut_anywhere_is_the_same_fault():
    prediction = Prediction(1.0, "hash", np.arange(3), {"box": np.ones((3, 7))}, {"iiwa": np.ones((3, 7))})
    answer = pickle.dumps(prediction)
    assert following._read(answer).poses["box"].shape == (3, 7)
    assert {following._read(answer[:end]).fault for end in range(len(answer))} == {following._read(b"").fault}


def test_a_process_that_cannot_fork_keeps_no_pipe(monkeypatch):
    forks = iter([1, 1])

    def fork() -> int:
        for pid in forks:
            return pid
        raise BlockingIOError("no process is left")

    before = os.listdir("/proc/self/fd")
    monkeypatch.setattr(os, "fork", fork)
    with pytest.raises(BlockingIOError):
        list(following._predict_all(None, [[], [], []], PredictionJob(5, (), 1, None), 3))
    assert os.listdir("/proc/self/fd") == before


def test_another_process_follows_when_one_has_died(arm, monkeypatch):
    with pytest.raises(InterfaceError, match="the process that follows the world has ended"):
        arm.predict([[]], 5, cost="costs:kills_the_follower")
    assert arm.predict([[]], 5)[0].fault == ""
    with monkeypatch.context() as patch, pytest.raises(InterfaceError, match="has ended"):
        patch.setattr(Shadow, "follow", lambda shadow, *_: shadow._process.kill())
        arm.fork()
    with arm.fork()[0] as fork:
        assert fork.state_hash() == arm.state_hash()


def test_a_cost_that_only_this_process_has_is_named(arm, monkeypatch):
    here = ModuleType("only_here")
    exec("def cost(world): return 0.0", vars(here))
    monkeypatch.setitem(sys.modules, "only_here", here)
    with pytest.raises(InterfaceError, match="the process that follows the world: .*'only_here'"):
        arm.predict([[]], 5, cost=here.cost)


def test_inputs_that_are_refused_are_named(arm):
    late, early = ([(tick, TARGET, {"lbr_iiwa_joint_1": 1.0})] for tick in (5, -1))
    predictions = arm.predict([[(0, "iiwa/aim", {})], [(0, TARGET, {"elbow": 1.0})], [], late, early], 5)
    assert "unknown input 'iiwa/aim'" in predictions[0].fault and "elbow" in predictions[1].fault
    assert predictions[2].fault == ""
    assert [each.fault for each in predictions[3:]] == [
        f"{TARGET}: expected a tick from 0 to 4, got {n}" for n in (5, -1)
    ]
    with pytest.raises(UnknownNameError):
        arm.predict([[]], 5, watch=["cup"])
    with pytest.raises(ValueError, match="at least 1"):
        arm.predict([[]], 0)


def test_a_fork_answers_and_its_errors_come_back(arm):
    first, second = arm.fork(2)
    first.put(TARGET, {"lbr_iiwa_joint_1": 0.5})
    samples = first.step(100)
    assert {type(each).__name__ for each in samples} >= {"JointStateSample"}
    second.step(100)
    assert first.state_hash() != second.state_hash() == hash_later(arm, 100)
    with pytest.raises(InterfaceError, match="fork 0: .*iiwa/aim"):
        first.put("iiwa/aim", {})
    first.act("box", "teleport", {"position": (1.0, 1.0, 1.0), "quat_xyzw": (0.0, 0.0, 0.0, 1.0)})
    first.close()
    with pytest.raises(InterfaceError, match="has ended"):
        first.step()
    second.close()


def test_more_commands_than_are_kept_unpacked(arm):
    for turn in range(MAX_KEPT + 50):
        arm.put(TARGET, {"lbr_iiwa_joint_2": 0.8 + 0.0001 * (turn % 100)})
        arm.apply_inputs()
        if turn % 50 == 0:
            arm.step()
    state = arm.save()
    assert len(state.commands) == arm.commands.count > MAX_KEPT
    again = World.from_state(state)
    assert hash_later(again, 50) == hash_later(arm, 50)
    again.close()


def test_files_that_are_none_are_named(arm, tmp_path):
    good = tmp_path / "good.world"
    arm.save(good)
    cut = tmp_path / "cut.world"
    cut.write_bytes(good.read_bytes()[:-20])
    (tmp_path / "text.world").write_text("tick: 3")
    text = gzip.decompress(good.read_bytes())
    (tmp_path / "other.world").write_bytes(gzip.compress(text.replace(b'"format": 2', b'"format": 99', 1)))
    reasons = {
        "cut": "truncated",
        "text": "expected a state",
        "gone": "no such file",
        "other": "expected a state .* format 99, this version reads 2",
    }
    for name, reason in reasons.items():
        with pytest.raises(ConfigError, match=rf"{name}\.world: .*{reason}"):
            World.from_state(tmp_path / f"{name}.world")
    assert WorldState.read(good) == arm.save()


def test_worlds_with_soft_bodies_are_refused(tmp_path):
    path = write_world(tmp_path, collision=(GROUND,), soft=(block(tmp_path),), **DEFORMABLE)
    world = World.from_file(path)
    for ask in (world.save, world.fork, lambda: world.predict([[]], 5)):
        with pytest.raises(InterfaceError, match="expected no soft bodies, which never move the same way twice, got"):
            ask()
    world.close()


def test_states_of_other_worlds_and_versions_are_refused(arm, tmp_path):
    state = arm.save()
    with pytest.raises(InterfaceError, match="another world"):
        arm.restore(state._replace(description=state.description.replace("box", "bin")))
    with pytest.raises(InterfaceError, match="format 99, this version reads"):
        World.from_state(state._replace(description=state.description.replace('"format": 1', '"format": 99')))
    with pytest.raises(InterfaceError, match="not the saved one"):
        World.from_state(state._replace(state_hash="0" * 32))
    with pytest.raises(InterfaceError, match="not the saved one"):
        arm.restore(state._replace(state_hash="0" * 32))
    assert arm.clock.tick == 0, "it is reset"


def test_world_of_a_state_restores_that_state(arm):
    state = arm.save()
    again = World.from_state(state)
    hash_later(again, 20)
    again.restore(state)
    assert again.state_hash() == state.state_hash
    with pytest.raises(InterfaceError, match="another world"):
        again.restore(state._replace(description=state.description.replace("box", "bin")))
    again.close()


UNRECORDED = {
    "changeDynamics": lambda world: world.pb.changeDynamics(world.bodies["box"].body_id, -1, mass=2.0),
    "setGravity": lambda world: world.pb.setGravity(0.0, 0.0, -1.62),
    "setPhysicsEngineParameter": lambda world: world.bodies["box"].pb.setPhysicsEngineParameter(numSolverIterations=5),
    "resetBasePositionAndOrientation": lambda world: world.bodies["box"].teleport(Pose((0.0, 1.0, 1.0))),
    "stepSimulation": lambda world: world.pb.stepSimulation(),
}
"""Changes of a world that no command repeats, by the function of PyBullet that makes them."""


@pytest.mark.parametrize("name", UNRECORDED)
def test_a_change_that_is_not_recorded_is_noticed(arm, name):
    arm.predict([[]], 1)
    UNRECORDED[name](arm)
    for use in (arm.save, arm.fork, lambda: arm.predict([[]], 1)):
        with pytest.raises(InterfaceError, match=f"something not recorded acts: PyBullet's {name} was called"):
            use()
    arm.reset()
    hash_later(arm, 20)
    assert World.from_state(arm.save()).state_hash() == arm.state_hash()


def test_a_reset_undoes_changes_that_are_not_recorded(arm):
    arm.reset(rebuild=False)
    expected = hash_later(arm, 50)
    for change in UNRECORDED.values():
        arm.reset(rebuild=False)
        change(arm)
        arm.reset(rebuild=False)
        assert hash_later(arm, 50) == expected


def test_changes_by_methods_of_the_world_are_recorded(arm):
    arm.change_dynamics("box", {"mass": 2.0})
    arm.change_physics(SetGravity(gravZ=-1.62))
    arm.act("box", "teleport", Pose((0.0, 1.0, 1.0)))
    arm.attach({"name": "rope", "parent": "iiwa/lbr_iiwa_link_7", "child": "box", "kind": "ball"})
    arm.detach("rope")
    arm.add("dynamic", box("other", basePosition=[0.0, -1.0, 0.5]))
    arm.remove("box")
    arm.halt("a stop")
    arm.pause("a pause")
    hash_later(arm, 20)
    arm.read_rest()
    assert World.from_state(arm.save()).state_hash() == arm.state_hash()
