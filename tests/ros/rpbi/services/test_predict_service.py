"""`rpbi/predict`: what would happen is what happens, the world goes on meanwhile, and what cannot be is named."""

from __future__ import annotations

import math
import re
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from node_world import count_taken, main_config, publishing
from ros_system import wait_until
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from worlds import BOX_FLOOR, box, iiwa

from ros_pybullet_interface.msg import Candidate, PlannedInput
from ros_pybullet_interface.srv import GetStateHash, Predict, StepN

JOINT = "lbr_iiwa_joint_1"
INPUT = "iiwa/target"
PAGE = Path(__file__).resolve().parents[4] / "docs/replay_and_fork.md"


@pytest.fixture(scope="module")
def standing(module_ros):
    """A world that is stepped by a service."""
    config = main_config(
        module_ros.folder,
        collision=(BOX_FLOOR,),
        dynamic=(box(basePosition=[1.0, 1.0, 0.5]),),
        robots=(iiwa(joint_state_publisher_hz=1000),),
        start_pybullet_after_initialization=False,
    )
    module_ros.simulator(config, use_sim_time=True)
    return module_ros


def turn(position: float, tick: int = 0) -> Candidate:
    """Returns a candidate that turns a joint."""
    return Candidate([PlannedInput(tick, INPUT, [JOINT], [position])])


def predict(ros, *candidates: Candidate, ticks: int = 300, **fields):
    return ros.call("/rpbi/predict", Predict, candidates=candidates, ticks=ticks, **fields)


@pytest.mark.quick
def test_prediction_of_the_chosen_candidate_equals_the_later_outcome(standing):
    answer = predict(standing, turn(0.2), turn(0.7), Candidate(), watch=["iiwa", "box"], every=100)
    assert answer.success and answer.message == f"3 of 3 predicted from tick {answer.tick} on"
    arm, thing = answer.predictions[1].bodies
    assert list(answer.predictions[1].ticks) == [100, 200, 300]
    joints = np.reshape(arm.joints, (3, len(arm.joint_names)))[:, arm.joint_names.index(JOINT)]
    assert joints[0] < joints[1] < joints[2] and thing.name == "box" and not thing.joint_names
    assert thing.poses[2].position.z < thing.poses[0].position.z, "the box falls"
    with publishing("/rpbi/iiwa/joint_states/target", JointState) as target:
        target.publish(JointState(name=[JOINT], position=[0.7]))
        wait_until(lambda: count_taken(target), "the target has arrived")
    stepped = standing.call("/rpbi/step_n", StepN, 300)
    assert stepped.tick == answer.tick + 300
    hashes = [each.state_hash for each in answer.predictions]
    assert standing.call("/rpbi/get_state_hash", GetStateHash).state_hash == hashes[1] and len(set(hashes)) == 3


def test_world_continues_while_it_predicts(standing):
    states = standing.listen("/rpbi/iiwa/joint_states", JointState)
    assert standing.call("/rpbi/start", Trigger).success
    try:
        states.wait_for(1)
        for _ in range(5):
            before = len(states.messages)
            answer = predict(standing, turn(0.3), turn(0.5), ticks=400)
            assert answer.success and not any(each.fault for each in answer.predictions)
            states.wait_for(before + 1)
    finally:
        standing.call("/rpbi/stop", Trigger)
    stamps = np.diff(states.stamps_ns)
    assert set(stamps.tolist()) == {1_000_000}, "no joint state is missing"


def test_the_block_of_the_page_runs(standing, capsys):
    (block,) = re.findall(r"```python\n(import rospy\n.*?)```", PAGE.read_text(), re.DOTALL)
    exec(block.replace("kuka_lwr", "iiwa").replace("lwr_arm_0_joint", JOINT), {})
    assert capsys.readouterr().out.startswith("3 of 3 predicted from tick ")


def test_a_world_that_was_reset_is_followed_anew(standing):
    standing.call("/rpbi/reset", Trigger)
    answer = predict(standing, Candidate(), ticks=10)
    assert answer.success and answer.tick == 0
    standing.call("/rpbi/step_n", StepN, 10)
    assert standing.call("/rpbi/get_state_hash", GetStateHash).state_hash == answer.predictions[0].state_hash


def test_a_bad_candidate_costs_itself_alone(standing):
    good = turn(0.1)
    unknown, outside = (Candidate([PlannedInput(0, *each)]) for each in (("iwa/target", [], []), (INPUT, ["x"], [1.0])))
    answer = predict(standing, unknown, good, outside, turn(math.nan), turn(0.1, tick=5), ticks=5)
    faults = [each.fault for each in answer.predictions]
    assert answer.success and answer.message.startswith("1 of 5 predicted")
    assert faults[4] == "iiwa/target: expected a tick from 0 to 4, got 5"
    assert "did you mean 'iiwa/target'" in faults[0] and not faults[1] and "'x'" in faults[2] and "finite" in faults[3]
    assert [each.cost for each in answer.predictions] == [math.inf, 0.0, *[math.inf] * 3]


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"ticks": 0}, "ticks and candidates: expected at least 1 of each, got 0 and 1"),
        (
            {"ticks": 2_000_000},
            "expected at most 1000000 of all candidates, got 2000000, those of 1 candidates (~max_predicted_ticks)",
        ),
        ({"ticks": 200_001, "watch": ["box"], "every": 1}, "expected at most 100000 rows of motion, got 200001"),
        ({"watch": ["bx"]}, "did you mean 'box'?"),
        ({"cost": "os:abort"}, "'os:abort' is not trusted"),
    ],
)
def test_bad_requests_are_refused_by_field(standing, fields, message):
    answer = predict(standing, turn(0.1), **fields)
    assert not answer.success and message in answer.message and not answer.predictions


def test_a_cancelled_prediction_ends_and_the_next_one_is_made(standing):
    assert standing.call("/rpbi/cancel_prediction", Trigger).message == "no prediction is under way"
    with ThreadPoolExecutor() as pool:
        long = pool.submit(predict, standing, turn(0.1), ticks=1_000_000)
        wait_until(lambda: standing.call("/rpbi/cancel_prediction", Trigger).success, "it is under way")
        answer = long.result()
    assert not answer.success and answer.message == "the prediction was cancelled"
    assert predict(standing, turn(0.1), ticks=5).success
