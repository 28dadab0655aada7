"""Many steps at once: what is told of them, what interrupts them, and that nothing else waits for them."""

from __future__ import annotations

import contextlib
import re
import sys
import threading
from pathlib import Path

import pytest
import rospy
from diagnostic_msgs.msg import DiagnosticArray
from node_world import main_config
from ros_system import wait_until
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Int64
from std_srvs.srv import Trigger
from worlds import iiwa

from ros_pybullet_interface.msg import PlannedInput
from ros_pybullet_interface.srv import GetStateHash, ListObjects, StepN, StepWithInputs
from rpbi.ros.tick_listener import TickListener

DOCS = Path(__file__).resolve().parents[4] / "docs" / "time.md"
HUGE = 1_000_000


@pytest.fixture(scope="module")
def node(module_ros):
    robots = (iiwa(joint_state_publisher_hz=1000),)
    return module_ros.simulator(main_config(module_ros.folder, robots=robots), use_sim_time=True)


@pytest.fixture
def stopped(ros, node):
    ros.call("/rpbi/stop", Trigger)
    return node


def _later(ros, steps):
    """Asks for steps in a thread of its own; the answer is the last of the list that is returned."""
    answers = []
    thread = threading.Thread(target=lambda: answers.append(ros.call("/rpbi/step_n", StepN, steps)))
    thread.start()
    return answers, thread


def _is_stepping(ros):
    return "stepping" in ros.call("/rpbi/step", Trigger).message


@pytest.mark.quick
def test_every_tick_is_published_and_counted(ros, stopped):
    joint_states = ros.listen("/rpbi/iiwa/joint_states", JointState)
    joint_states.wait_for(1)
    before = ros.call("/rpbi/step_n", StepN, 0)
    answer = ros.call("/rpbi/step_n", StepN, 500)
    assert answer.success, answer.message
    assert answer.tick == before.tick + 500
    assert answer.stamp.to_nsec() == before.stamp.to_nsec() + 500_000_000
    wait_until(lambda: joint_states.stamps_ns[-1] == answer.stamp.to_nsec(), "the last tick arrives")
    told = [stamp for stamp in joint_states.stamps_ns if stamp > before.stamp.to_nsec()]
    assert told == [before.stamp.to_nsec() + 1_000_000 * (index + 1) for index in range(500)]


def test_inputs_act_before_their_ticks(ros, stopped):
    joint_states = ros.listen("/rpbi/iiwa/joint_states", JointState)
    joint_states.wait_for(1)
    joint = ["lbr_iiwa_joint_1"]
    there, back = (PlannedInput(tick, "iiwa/target", joint, [goal]) for tick, goal in ((0, 0.3), (300, -0.3)))
    answer = ros.call("/rpbi/step_with_inputs", StepWithInputs, 600, [back, there])
    assert answer.success, answer.message
    wait_until(lambda: joint_states.stamps_ns[-1] == answer.stamp.to_nsec(), "the last tick arrives")
    positions = [message.position[0] for message in joint_states.messages[-600:]]
    assert positions[299] == pytest.approx(0.3, abs=1e-3) and positions[301] < 0.3 - 1e-3
    assert positions[-1] == pytest.approx(-0.3, abs=1e-3)


@pytest.mark.parametrize(
    "planned, expected",
    [
        (PlannedInput(5, "iiwa/target", ["lbr_iiwa_joint_1"], [0.0]), "iiwa/target: expected a tick below 5, got 5"),
        (PlannedInput(0, "iiwa/aim", [], []), "unknown input 'iiwa/aim'"),
        (PlannedInput(0, "iiwa/target", ["elbow"], [0.0]), "elbow"),
        (PlannedInput(0, "iiwa/target", ["lbr_iiwa_joint_1"], []), "expected a value for each of 1 names, got 0"),
        (PlannedInput(0, "iiwa/target", ["lbr_iiwa_joint_1"], [float("nan")]), "finite"),
    ],
)
def test_inputs_that_are_refused_are_named_and_nothing_moves(ros, stopped, planned, expected):
    before = ros.call("/rpbi/get_state_hash", GetStateHash)
    answer = ros.call("/rpbi/step_with_inputs", StepWithInputs, 5, [planned])
    assert not answer.success and expected in answer.message
    assert ros.call("/rpbi/get_state_hash", GetStateHash).state_hash == before.state_hash


def test_many_steps_end_where_single_steps_do(ros, tmp_path):
    ends = []
    for turn in range(2):
        robots = (iiwa(initial_joint_position={"lbr_iiwa_joint_2": 40.0}),)
        config = main_config(tmp_path, robots=robots, start_pybullet_after_initialization=False)
        process = ros.simulator(config, namespace=f"/twin{turn}/")
        if turn:
            ros.call(f"/twin{turn}/rpbi/step_n", StepN, 20)
        else:
            for _ in range(20):
                ros.call(f"/twin{turn}/rpbi/step", Trigger)
        ends.append(ros.call(f"/twin{turn}/rpbi/get_state_hash", GetStateHash))
        assert process.poll() is None
    assert ends[0].tick == ends[1].tick == 20
    assert ends[0].state_hash == ends[1].state_hash


def test_no_steps_change_nothing(ros, stopped):
    first, second = (ros.call("/rpbi/step_n", StepN, 0) for _ in range(2))
    assert first.success and second.success
    assert (first.tick, first.stamp) == (second.tick, second.stamp)


def test_it_is_refused_while_the_world_runs(ros, stopped):
    ros.call("/rpbi/start", Trigger)
    answer = ros.call("/rpbi/step_n", StepN, 5)
    assert not answer.success
    assert "running" in answer.message
    ros.call("/rpbi/stop", Trigger)


def test_huge_number_of_steps_blocks_nothing_and_can_be_stopped(ros, stopped):
    clock, status = ros.listen("/clock", Clock), ros.listen("/rpbi/status", Int64)
    diagnostics = ros.listen("/diagnostics", DiagnosticArray)
    answers, thread = _later(ros, HUGE)
    wait_until(lambda: _is_stepping(ros), "it steps")
    seen, told = len(clock.messages), len(status.messages)
    wait_until(lambda: len(clock.messages) > seen + 50 and len(status.messages) > told + 10, "time and status go on")
    wait_until(lambda: status.messages[-1].data == 1, "the status says that it moves")
    assert ros.call("/rpbi/list_objects", ListObjects).names == ["iiwa"]
    for service in ("/rpbi/start", "/rpbi/step"):
        refused = ros.call(service, Trigger)
        assert not refused.success and "stepping" in refused.message
    refused = ros.call("/rpbi/step_n", StepN, 1)
    assert not refused.success and "stepping" in refused.message
    wait_until(
        lambda: [m for m in diagnostics.messages if (m.status[0].message, m.status[0].level) == ("stepping", 0)],
        "the diagnostics say so, and find nothing wrong with it",
    )
    assert ros.call("/rpbi/stop", Trigger).success
    thread.join(60.0)
    assert not answers[-1].success
    assert re.fullmatch(r"stopped after \d+ of 1000000 ticks", answers[-1].message)
    here = ros.call("/rpbi/step_n", StepN, 0)
    assert (answers[-1].tick, answers[-1].stamp) == (here.tick, here.stamp)
    wait_until(lambda: status.messages[-1].data == 0, "the status says stopped")


def test_a_reset_ends_it(ros, stopped):
    answers, thread = _later(ros, HUGE)
    wait_until(lambda: _is_stepping(ros), "it steps")
    assert ros.call("/rpbi/reset", Trigger).success
    thread.join(60.0)
    assert "the world was reset after" in answers[-1].message
    assert ros.call("/rpbi/step_n", StepN, 3).tick == 3


def test_the_node_ends_in_the_middle_of_it(ros, tmp_path):
    config = main_config(tmp_path, robots=(iiwa(),), start_pybullet_after_initialization=False)
    process = ros.simulator(config, namespace="/other/")
    thread = threading.Thread(target=lambda: _swallow(lambda: ros.call("/other/rpbi/step_n", StepN, HUGE)))
    thread.start()
    wait_until(lambda: "stepping" in ros.call("/other/rpbi/step", Trigger).message, "it steps")
    process.send_signal(2)
    assert process.wait(60.0) == 0, ros.output(process)
    thread.join(60.0)


def test_a_tick_listener_waits_for_all_of_a_tick(ros, stopped):
    listener = TickListener({"/rpbi/iiwa/joint_states": JointState})
    for _ in range(20):
        answer = ros.call("/rpbi/step_n", StepN, 10)
        newest = listener.wait_for_tick(answer.stamp, timeout_s=60.0)
        assert newest["/rpbi/iiwa/joint_states"].header.stamp == answer.stamp
    with pytest.raises(TimeoutError, match="/rpbi/iiwa/joint_states"):
        listener.wait_for_tick(answer.stamp + type(answer.stamp - answer.stamp)(1), timeout_s=0.2)
    listener.close()


def test_predictive_controller_of_the_page_reaches_its_goal(ros, tmp_path):
    code = re.search(r"```python\n(.*?)```", DOCS.read_text(), re.DOTALL)[1]
    arm = iiwa(target_interpolation="hold")
    config = main_config(tmp_path, robots=(arm,), start_pybullet_after_initialization=False)
    ros.simulator(config, namespace="/mpc/")
    script = tmp_path / "mpc.py"
    script.write_text(code)
    client = ros.start([sys.executable, str(script), "__ns:=/mpc"])
    assert client.wait(120) == 0, ros.output(client)
    assert "arrived" in ros.output(client)


def _swallow(call):
    with contextlib.suppress(rospy.ServiceException):
        call()
