"""After a reset, a world is what it was when it was built, to the last bit, whatever was done to it."""

from __future__ import annotations

import threading

import deterministic_session as session
import pytest
import scripted_session as script
from worlds import FLOOR, ball, iiwa, write_world

from custom_ros_tools.errors import InterfaceError, PhysicsError, UnknownNameError
from rpbi.control.joint_command import JointCommand
from rpbi.world import World
from rpbi.world.actions import TimedGoal


@pytest.fixture
def rich(tmp_path):
    world = script.build(tmp_path)
    yield world
    world.close()


@pytest.fixture
def arm(tmp_path):
    world = World.from_file(write_world(tmp_path, collision=(FLOOR,), dynamic=(ball(),), robots=(iiwa(),)))
    yield world
    world.close()


@pytest.mark.parametrize("before", [0, 1, 2])
def test_session_after_a_reset_equals_one_in_a_fresh_world(before):
    world = session.build()
    for turn in range(before):
        session.run(world, ticks=700, visitors=bool(turn))
        world.reset()
    reset = session.run(world)
    world.close()
    fresh = session.build()
    assert session.run(fresh) == reset
    fresh.close()


@pytest.mark.parametrize("seed", range(3))
def test_nothing_that_was_done_outlives_it(rich, tmp_path, seed):
    start = rich.state_hash()
    script.run(rich, seed, 3000)
    rich.put("mobile/target", JointCommand(["shoulder"], [1.0]))
    rich.bodies["iiwa"].force_torque_sensors[0].zero(1000)
    rich.reset()
    assert rich.state_hash() == start
    samples = [rich.step() for _ in range(1000)]
    fresh = script.build(tmp_path)
    assert [fresh.step() for _ in range(1000)] == samples, "sensors, their noise, filters and schedules are as fresh"
    assert [c.state_hash for c in script.run(rich, 7, 2000)] == [c.state_hash for c in script.run(fresh, 7, 2000)]
    fresh.close()


def test_ticks_restart_and_stamps_continue(arm):
    for _ in range(10):
        arm.step()
    stamp_ns = arm.clock.stamp_ns
    arm.reset()
    assert (arm.clock.tick, arm.clock.time_s, arm.resets) == (0, 0.0, 1)
    assert arm.clock.stamp_ns == stamp_ns + arm.clock.dt_ns


def test_motions_end_with_the_reason(arm):
    motion = arm.act("iiwa", "move", TimedGoal({0: 0.5}, 1.0))
    arm.step()
    arm.reset()
    success, message = motion.result.result(timeout=0)
    assert not success and "the world was reset" in message
    assert arm.bodies["iiwa"].drive.motion is None


def test_first_target_after_reset_is_obeyed_and_earlier_ones_dropped(arm):
    arm.put("iiwa/target", JointCommand(["lbr_iiwa_joint_1"], [1.0]))
    arm.reset()
    arm.step()
    assert arm.bodies["iiwa"].motors.targets[0] == 0.0
    arm.put("iiwa/target", JointCommand(["lbr_iiwa_joint_1"], [0.7]))
    arm.step()
    assert arm.bodies["iiwa"].motors.targets[0] == 0.7


def test_target_checked_before_reset_is_dropped_when_it_comes_after(arm):
    generation = arm.mailbox.generation
    checked = arm.inputs["iiwa/target"].check(JointCommand(["lbr_iiwa_joint_1"], [1.0]))
    arm.reset()
    arm.mailbox.put("iiwa/target", checked, generation=generation)
    arm.step()
    assert arm.bodies["iiwa"].motors.targets[0] == 0.0


def test_objects_that_came_go_and_those_that_went_are_back(rich):
    before = list(rich.bodies)
    rich.remove("body0")
    config = rich.loaded.objects[-1].config.model_copy(update={"name": "other"})
    rich.add(rich.loaded.objects[-1].type, config)
    assert rich.changed_names() == {"body0", "other"}
    rich.reset()
    assert list(rich.bodies) == before
    assert rich.changed_names() == set()
    with pytest.raises(UnknownNameError):
        rich.put("other/target", JointCommand([], []))


def test_no_input_is_ever_lost(arm):
    for _ in range(200):
        arm.reset()
        assert set(arm.inputs) == {"iiwa/target", "iiwa/external_wrench", "ball/external_wrench"}


def test_inputs_are_taken_all_the_time(arm):
    """Those who put meanwhile, from other threads, must not be told that there is no such input."""
    over = threading.Event()
    missed = []

    def look():
        while not over.is_set():
            missed.append("iiwa/target" not in arm.inputs)

    looking = threading.Thread(target=look)
    looking.start()
    for _ in range(5):
        arm.reset()
    over.set()
    looking.join()
    assert len(missed) > 100 and not any(missed)


def test_load_log_begins_anew(rich):
    entries = len(rich.log)
    script.run(rich, 1, 500)
    rich.reset()
    assert len(rich.log) == entries
    assert rich.commands.count == 0


def test_a_world_that_is_not_finite_any_more_is_mended(arm):
    arm.pb.resetBaseVelocity(arm.bodies["ball"].body_id, (float("nan"), 0.0, 0.0))
    arm.pb.resetJointState(arm.bodies["iiwa"].body_id, 0, float("nan"))
    with pytest.raises(PhysicsError):
        for _ in range(100):
            arm.step()
    arm.reset()
    for _ in range(100):
        arm.step()


def test_missing_file_is_reported_and_found_by_a_later_reset(tmp_path):
    from mobile_base import mobile_base

    camera = {"name": "eye", "hz": 10, "object_tf": {"tf_id": "eye"}}
    path = write_world(tmp_path, robots=(mobile_base(tmp_path),), dynamic=(ball(),), rgbd_sensor=camera)
    world = World.from_file(path)
    start = world.state_hash()
    urdf = tmp_path / "mobile_base.urdf"
    text = urdf.read_text()
    urdf.unlink()
    with pytest.raises(InterfaceError, match=r"mobile_base\.urdf"):
        world.reset()
    assert list(world.bodies) == ["ball"] and list(world.cameras) == ["eye"]
    assert {"mobile/target", "ball/pose", "eye/pose"} & world.inputs.keys() == {"eye/pose"}
    urdf.write_text(text)
    world.reset()
    assert world.state_hash() == start
    world.close()


def test_a_rate_that_is_too_high_is_warned_of_once(tmp_path, caplog):
    world = World.from_file(write_world(tmp_path, dynamic=(ball(broadcast_hz=1e6),)))
    for _ in range(3):
        world.reset()
    world.close()
    assert caplog.text.count("more than a sample a tick") == 1
