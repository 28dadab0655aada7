"""`./rpbi save` and `./rpbi restore`: a running world is what it was, with its topics, and what cannot be is named."""

from __future__ import annotations

import re
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
import rospy
from diagnostic_msgs.msg import DiagnosticArray
from node_world import add, main_config, objects, publishing, remove
from ros_system import wait_until
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from worlds import BOX_FLOOR, ball, box, iiwa

from custom_ros_tools.errors import InterfaceError
from ros_pybullet_interface.srv import GetStateHash, StepN
from rpbi.world import World
from rpbi.world.saved.state import WorldState
from rpbi_utils.console.restore import restore
from rpbi_utils.console.save import save

JOINT = "lbr_iiwa_joint_1"


@pytest.fixture
def standing(ros, tmp_path):
    """A world that is stepped by a service; it has an arm, and a ball that came later."""
    rospy.set_param("/ros_pybullet_interface/state_folder", str(tmp_path))
    arm = iiwa(joint_state_publisher_hz=100)
    config = main_config(
        tmp_path,
        collision=(BOX_FLOOR,),
        dynamic=(box(basePosition=[1.0, 1.0, 0.5]),),
        robots=(arm,),
        start_pybullet_after_initialization=False,
    )
    ros.simulator(config, use_sim_time=True)
    assert add(ros, config=ball("later", basePosition=[1.0, 0.0, 0.5], broadcast_hz=50)).success
    return ros


def step(ros, ticks):
    """Advances the world, and returns the hash of its state."""
    answer = ros.call("/rpbi/step_n", StepN, ticks)
    assert answer.success, answer.message
    return ros.call("/rpbi/get_state_hash", GetStateHash).state_hash


@pytest.mark.quick
def test_restored_world_continues_identically(standing, tmp_path):
    states = standing.listen("/rpbi/iiwa/joint_states", JointState)
    with publishing("/rpbi/iiwa/joint_states/target", JointState) as target:
        target.publish(JointState(name=[JOINT], position=[0.7]))
    step(standing, 100)
    file = tmp_path / "here.world"
    assert save(file) == f"saved tick 100 in {file}"
    expected = step(standing, 300)
    remove(standing, "later")
    remove(standing, "box")
    before = states.messages[-1].header.stamp
    assert restore(file) == "restored tick 100"
    assert set(objects(standing)) == {"floor", "iiwa", "box", "later"}
    assert step(standing, 300) == expected
    last = wait_until(lambda: states.messages[-1].header.stamp > before and states.messages[-1], "stamps go on")
    assert last.position[list(last.name).index(JOINT)] > 0.1
    elsewhere = World.from_state(file)
    for _ in range(300):
        elsewhere.step()
    assert elsewhere.state_hash() == expected
    elsewhere.close()


def test_a_state_at_a_keyframe_has_no_commands(standing, tmp_path):
    step(standing, 100)
    file = tmp_path / "here.world"
    assert save(file, keyframe=True) == f"saved tick 100 in {file}"
    assert WorldState.read(file).commands == ()
    expected = step(standing, 100)
    assert restore(file) == "restored tick 100"
    assert step(standing, 100) == expected


def test_files_that_cannot_be_are_named_and_the_world_stays(standing, tmp_path):
    before = step(standing, 10)
    with pytest.raises(InterfaceError, match=r"expected the path of a \.world file, got '.*"):
        save(tmp_path / "here.yaml")
    with pytest.raises(InterfaceError, match="cannot be written: no such file"):
        save(tmp_path / "nowhere/here.world")
    (tmp_path / "gazebo.world").write_text("<sdf/>")
    with pytest.raises(InterfaceError, match=r"gazebo\.world: exists, and is no saved state"):
        save(tmp_path / "gazebo.world")
    for command in (save, restore):
        with pytest.raises(
            InterfaceError, match=r"expected a file below .* \(~state_folder of the node\), got '/etc/x\.w"
        ):
            command(Path("/etc/x.world"))
    with pytest.raises(InterfaceError, match=r"gone\.world: .*no such file"):
        restore(tmp_path / "gone.world")
    (tmp_path / "cut.world").write_bytes(b"\x1f\x8b")
    with pytest.raises(InterfaceError, match=r"cut\.world: .*truncated"):
        restore(tmp_path / "cut.world")
    other = World.from_file("{rpbi_examples}/configs/run_kuka/config.yaml")
    other.save(tmp_path / "other.world")
    other.close()
    with pytest.raises(InterfaceError, match="of another world"):
        restore(tmp_path / "other.world")
    assert standing.call("/rpbi/get_state_hash", GetStateHash).state_hash == before


def test_node_answers_during_a_restore_and_a_stop_ends_it(standing, tmp_path):
    step(standing, 10)
    save(tmp_path / "here.world")
    state = WorldState.read(tmp_path / "here.world")
    state._replace(tick=10_000_000).write(tmp_path / "old.world")
    load = standing.listen("/diagnostics", DiagnosticArray)
    with ThreadPoolExecutor() as pool:
        restored = pool.submit(restore, tmp_path / "old.world")
        wait_until(lambda: standing.call("/rpbi/get_state_hash", GetStateHash).tick > 20, "it is simulated again")
        refused = remove(standing, "box")
        assert not refused.success
        assert re.search(r"being restored, at tick \d+ of 10000000; rpbi/stop ends that", refused.message)
        wait_until(lambda: any("restoring, at tick" in each.status[0].message for each in load.messages), "it is said")
        assert standing.call("/rpbi/stop", Trigger).success
        with pytest.raises(InterfaceError, match=r"stopped at tick \d+ of 10000000: the world was reset"):
            restored.result()
    assert set(objects(standing)) == {"floor", "iiwa", "box"}
    assert standing.call("/rpbi/get_state_hash", GetStateHash).tick == 0
    assert restore(tmp_path / "here.world") == "restored tick 10"
