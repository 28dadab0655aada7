"""Inverse kinematics by service and by topic."""

from __future__ import annotations

import math
import re

import numpy as np
import pybullet_data
import pytest
from node_world import Rosout, add, main_config, publishing, registrations, remove
from ros_system import wait_until
from sensor_msgs.msg import JointState
from worlds import iiwa

from ros_pybullet_interface.msg import CalculateInverseKinematicsProblem, PybulletObject
from ros_pybullet_interface.srv import CalculateInverseKinematics, RobotInfo
from rpbi.geometry import Pose
from rpbi.kinematics import Kinematics

LINK = "lbr_iiwa_link_7"
ELBOW = [0.0, 0.5, 0.0, -1.2, 0.0, 0.8, 0.0]
JOINTS = [f"lbr_iiwa_joint_{i}" for i in range(1, 8)]
BASE = Pose((0.5, -0.3, 0.2), (0.0, 0.0, math.sin(0.6), math.cos(0.6)))


def _iiwa(name, **more):
    return iiwa(
        name,
        loadURDF={
            "fileName": "kuka_iiwa/model.urdf",
            "useFixedBase": True,
            "basePosition": list(BASE.position),
            "baseOrientation": list(BASE.quat_xyzw),
        },
        initial_joint_position=dict(zip(JOINTS, ELBOW)),
        initial_revolute_joint_positions_are_deg=False,
        **more,
    )


def _link(name):
    inertia = '<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/>'
    return f'<link name="{name}"><inertial><mass value="0.5"/>{inertia}</inertial></link>'


def _joint(name, kind, parent, child, x, lower, upper):
    return f"""<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>
      <origin xyz="{x} 0 0"/><axis xyz="0 0 1"/>
      <limit lower="{lower}" upper="{upper}" effort="50" velocity="3"/></joint>"""


GRIPPER_URDF = f"""<robot name="gripper">{"".join(map(_link, ("base", "upper", "lower", "hand", "finger")))}
  {_joint("shoulder", "revolute", "base", "upper", 0.0, -2.5, 2.5)}
  {_joint("elbow", "revolute", "upper", "lower", 0.4, -2.5, 2.5)}
  {_joint("wrist", "fixed", "lower", "hand", 0.3, 0.0, 0.0)}
  {_joint("grip", "prismatic", "hand", "finger", 0.1, 0.0, 0.04)}
</robot>"""
GRIPPER_AT = (0.0, 2.0, 0.0)


@pytest.fixture(scope="module")
def node(module_ros):
    urdf = module_ros.folder / "gripper.urdf"
    urdf.write_text(GRIPPER_URDF)
    gripper = iiwa("gripper", start_ik_callback=True, initial_joint_position={"elbow": 60.0, "grip": 0.03})
    gripper["loadURDF"] = {"fileName": str(urdf), "useFixedBase": True, "basePosition": list(GRIPPER_AT)}
    robots = (
        _iiwa("arm", start_ik_callback=True, strict=True),
        _iiwa("shown", is_visual_robot=True),
        {**_iiwa("drone"), "loadURDF": {"fileName": "kuka_iiwa/model.urdf", "basePosition": [5.0, 0.0, 1.0]}},
        gripper,
    )
    return module_ros.simulator(main_config(module_ros.folder, robots=robots, setGravity={"gravZ": 0.0}))


@pytest.fixture(scope="module")
def kinematics():
    own = Kinematics(f"{pybullet_data.getDataPath()}/kuka_iiwa/model.urdf")
    yield own
    own.close()


def _problem(pose, link=LINK, **fields):
    return CalculateInverseKinematicsProblem(
        link_name=link, targetPosition=pose.position, targetOrientation=pose.quat_xyzw, **fields
    )


def _solve(ros, robot, problem):
    return ros.call(f"/rpbi/{robot}/ik", CalculateInverseKinematics, problem)


def _moved(positions, by=0.3):
    return [position + by for position in positions]


@pytest.mark.quick
@pytest.mark.parametrize("robot", ["arm", "shown"])
def test_target_is_in_the_world_and_solution_names_all_joints(ros, node, kinematics, robot):
    goal = BASE @ kinematics.forward(_moved(ELBOW), LINK)
    answer = _solve(ros, robot, _problem(goal))
    assert answer.success, answer.message
    assert "of its target" in answer.message
    assert answer.solution.name == JOINTS
    assert len(answer.solution.velocity) == 0
    reached = BASE @ kinematics.forward(answer.solution.position, LINK)
    assert math.dist(reached.position, goal.position) < 1e-3
    assert abs(np.dot(reached.quat_xyzw, goal.quat_xyzw)) > math.cos(0.005)


def test_a_floating_robot_solves_for_where_its_base_is_now(ros, node, kinematics):
    here = Pose((5.0, 0.0, 1.0))
    answer = _solve(ros, "drone", _problem(here @ kinematics.forward(ELBOW, LINK)))
    assert answer.success, answer.message
    assert answer.solution.position == pytest.approx(ELBOW, abs=0.05)


def test_search_starts_at_the_robots_position_by_default(ros, node, kinematics):
    other = [1.0, -0.6, 0.7, 1.1, -0.5, -0.9, 0.4]
    near_robot = _solve(ros, "shown", _problem(BASE @ kinematics.forward(_moved(ELBOW, 0.02), LINK)))
    assert np.abs(np.subtract(near_robot.solution.position, ELBOW)).max() < 0.2
    goal = BASE @ kinematics.forward(other, LINK)
    told = _solve(ros, "shown", _problem(goal, currentPosition=_moved(other, 0.02)))
    assert np.abs(np.subtract(told.solution.position, other)).max() < 0.2


def test_velocity_is_displacement_from_the_current_position_divided_by_time(ros, node, kinematics):
    goal = BASE @ kinematics.forward(_moved(ELBOW, 0.1), LINK)
    answer = _solve(ros, "arm", _problem(goal, currentPosition=ELBOW, dt=0.5))
    expected = np.subtract(answer.solution.position, ELBOW) / 0.5
    assert answer.solution.velocity == pytest.approx(expected)
    assert len(_solve(ros, "arm", _problem(goal, dt=0.5)).solution.velocity) == 0


def test_strict_robot_refuses_unreachable_targets_and_others_approach_them(ros, node, kinematics):
    refused, near = (_solve(ros, robot, _problem(Pose((4.0, 0.0, 0.5)))) for robot in ("arm", "shown"))
    assert (refused.success, near.success) == (False, True)
    assert near.message == f"as near as possible: {refused.message}"
    assert refused.message.startswith("'lbr_iiwa_link_7' misses its target by ") and "rad" in refused.message
    assert near.solution.position == pytest.approx(refused.solution.position)
    assert (np.abs(near.solution.position) <= kinematics.limits.upper).all()
    missed_m = math.dist((BASE @ kinematics.forward(near.solution.position, LINK)).position, (4.0, 0.0, 0.5))
    assert f"by {missed_m * 1e3:.4g} mm" in near.message


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"link_name": "lbr_iiwa_link_77"}, "unknown link 'lbr_iiwa_link_77': .*did you mean 'lbr_iiwa_link_7'"),
        ({"link_name": "lbr_iiwa_link_0"}, "link_name: 'lbr_iiwa_link_0' is the root link"),
        ({"targetPosition": [0.1, 0.2]}, "targetPosition: expected 3 values, got 2"),
        ({"targetPosition": [0.1, 0.2, math.nan]}, "targetPosition: values must be finite"),
        ({"targetPosition": [1e308, 1e308, 1e308]}, "targetPosition: .* 1e.09 at most"),
        ({"targetOrientation": [0.0, 0.0, 0.0, 0.0]}, "targetOrientation: must not be zero"),
        ({"currentPosition": [0.0]}, "currentPosition: expected 7 values, one for each of lbr_iiwa_joint_1, .*; got 1"),
        ({"resetPoses": [0.0] * 7}, "lowerLimits, upperLimits, jointRanges: missing"),
        ({"solver": 7}, "solver: expected 0"),
        ({"maxNumIterations": -5}, "maxNumIterations: must not be negative"),
        ({"dt": -1.0}, "dt: must not be negative, got -1"),
        ({"dt": math.inf}, "dt: must not be negative, got inf"),
        ({"dt": 1e-320, "currentPosition": [0.1] * 7}, "dt: too short"),
    ],
)
def test_invalid_problem_is_refused_naming_the_field(ros, node, kinematics, fields, message):
    problem = _problem(BASE @ kinematics.forward(ELBOW, LINK))
    for field, value in fields.items():
        setattr(problem, field, value)
    answer = _solve(ros, "arm", problem)
    assert not answer.success
    assert re.search(message, answer.message), answer.message
    assert not answer.solution.name


def test_both_solvers_and_the_null_space_answer(ros, node, kinematics):
    goal = BASE @ kinematics.forward(_moved(ELBOW), LINK)
    for more in (
        {"solver": 1},
        {"lowerLimits": [-2.0] * 7, "upperLimits": [2.0] * 7, "jointRanges": [4.0] * 7, "resetPoses": ELBOW},
        {"jointDamping": [0.1] * 7, "maxNumIterations": 100, "residualThreshold": 1e-5},
    ):
        answer = _solve(ros, "arm", _problem(goal, **more))
        assert answer.success, answer.message
        assert np.abs(answer.solution.position).max() <= 2.0


def test_topic_moves_only_the_joints_of_the_links_chain(ros, node):
    """The finger hangs on the hand: where it is does not bring the hand to its target, and it keeps its own."""
    states = ros.listen("/rpbi/gripper/joint_states", JointState)
    targets = publishing("/rpbi/gripper/joint_states/target", JointState)
    problems = publishing("/rpbi/gripper/ik", CalculateInverseKinematicsProblem)
    with targets as target, problems as problem:
        target.publish(JointState(name=["grip"], position=[0.01]))
        wait_until(lambda: abs(_position(states, "grip") - 0.01) < 1e-3, "the finger closes")
        problem.publish(
            CalculateInverseKinematicsProblem(link_name="hand", targetPosition=np.add(GRIPPER_AT, (0.3, 0.4, 0.0)))
        )
        wait_until(lambda: math.dist(_hand(states), (0.3, 0.4)) < 5e-3, "the hand is there")
    assert _position(states, "grip") == pytest.approx(0.01, abs=1e-3)


def _position(states, joint):
    message = states.wait_for(1)[-1]
    return message.position[message.name.index(joint)]


def _hand(states):
    shoulder, elbow = _position(states, "shoulder"), _position(states, "elbow")
    return [0.4 * f(shoulder) + 0.3 * f(shoulder + elbow) for f in (math.cos, math.sin)]


def test_topic_moves_the_link_as_near_as_possible_and_warns(ros, node):
    rosout = Rosout(ros)
    states = ros.listen("/rpbi/gripper/joint_states", JointState)
    away = np.add(GRIPPER_AT, (0.0, 2.0, 0.0))
    with publishing("/rpbi/gripper/ik", CalculateInverseKinematicsProblem) as topic:
        topic.publish(CalculateInverseKinematicsProblem(link_name="hand", targetPosition=away))
        wait_until(lambda: math.dist(_hand(states), (0.0, 0.7)) < 5e-3, "the arm is stretched out towards it")
    rosout.wait_for(["/rpbi/gripper/ik: as near as possible: 'hand' misses its target by 1300 mm; 1 mm would do"])


def test_topic_of_a_strict_robot_moves_nothing_and_reports_residual(ros, node):
    rosout = Rosout(ros)
    states = ros.listen("/rpbi/arm/joint_states", JointState)
    before = states.wait_for(1)[-1].position
    with publishing("/rpbi/arm/ik", CalculateInverseKinematicsProblem) as topic:
        wait_until(lambda: topic.publish(_problem(Pose((4.0, 0.0, 0.5)))) or rosout.logs("/rpbi/arm/ik"), "it is named")
    text = rosout.logs("/rpbi/arm/ik")[0].msg
    assert "'lbr_iiwa_link_7' misses its target by" in text and "mm" in text
    assert states.messages[-1].position == pytest.approx(before, abs=1e-3)


def test_the_topic_is_there_only_where_it_is_asked_for(ros, node):
    ours = registrations()
    assert ("subscribes", "/rpbi/arm/ik") in ours and ("serves", "/rpbi/arm/ik") in ours
    assert ("subscribes", "/rpbi/drone/ik") not in ours and ("serves", "/rpbi/drone/ik") in ours


def test_service_and_topic_go_with_their_robot(ros, node, kinematics):
    before = registrations()
    for _ in range(2):
        assert add(ros, PybulletObject.ROBOT, _iiwa("guest", start_ik_callback=True)).success
        goal = BASE @ kinematics.forward(_moved(ELBOW), LINK)
        assert _solve(ros, "guest", _problem(goal)).success
        assert remove(ros, "guest").success
    wait_until(lambda: registrations() == before, "nothing of it is left")
    assert ros.call("/rpbi/arm/robot_info", RobotInfo).numDof == 7, "the others go on"
