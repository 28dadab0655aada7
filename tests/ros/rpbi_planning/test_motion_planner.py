"""`motion_planner_node.py`: plans, motions, obstacles that come into the way, and requests that it refuses."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterator

import actionlib
import numpy as np
import pytest
import rospy
import yaml
from actionlib_msgs.msg import GoalID, GoalStatus
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from node_world import add, publishing, remove
from ros_system import RosSystem, wait_until
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from std_srvs.srv import Trigger
from visualization_msgs.msg import Marker, MarkerArray

from robot_model.geometry import Pose as RobotPose
from robot_model.geometry import angle_between
from ros_pybullet_interface.msg import PybulletObject
from rpbi_planning.braking import SampledMotion
from rpbi_planning.msg import (
    MotionRequest,
    MoveRobotAction,
    MoveRobotActionGoal,
    MoveRobotActionResult,
    MoveRobotGoal,
)
from rpbi_planning.ros.motion_messages import trajectory_message
from rpbi_planning.srv import PlanAndMove, PlanMotion

LINK, NAMES = "panda_grasptarget", [f"panda_joint{i}" for i in range(1, 8)]
SLOW_S = 240.0
READY = [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]


class Planner:
    """The example's world with the planner's node, and the newest joint states."""

    def __init__(self, ros: RosSystem) -> None:
        self.ros = ros
        options = "move:=false", "headless:=true", "certify:=false"
        self.process = ros.start(["roslaunch", "rpbi_examples", "planning_example.launch", *options])
        self.states = ros.listen("/rpbi/panda/joint_states", JointState)
        self.tf = ros.listen_to_tf()
        self.action = actionlib.SimpleActionClient("/planner/move_robot", MoveRobotAction)
        wait_until(lambda: self.plan(named="ready").success, "the planner plans", SLOW_S)

    @property
    def joints(self) -> list[float]:
        state = self.states.messages[-1]
        positions = dict(zip(state.name, state.position))
        return [positions[name] for name in NAMES]

    def plan(self, **fields):
        return self.ros.call("/planner/plan", PlanMotion, MotionRequest(**fields))

    def move(self, **fields):
        return self.ros.call("/planner/plan_and_move", PlanAndMove, MotionRequest(**fields))

    def move_to(self, positions):
        answer = self.move(joints=JointState(name=NAMES, position=positions))
        assert answer.success, answer.message

    def link_pose(self) -> RobotPose:
        found = self.tf.lookup_transform("rpbi/world", f"rpbi/panda/{LINK}", rospy.Time(0)).transform
        t, r = found.translation, found.rotation
        return RobotPose((t.x, t.y, t.z), (r.x, r.y, r.z, r.w))


@pytest.fixture(scope="module")
def planner(module_ros) -> Iterator[Planner]:
    yield Planner(module_ros)


def pose_of(x, y, z, quat=(1.0, 0.0, 0.0, 0.0), frame=""):
    return PoseStamped(Header(frame_id=frame), Pose(Point(x, y, z), Quaternion(*quat)))


def rests(planner) -> bool:
    """Whether no joint has moved in the last 0.3 s."""
    if len(planner.states.messages) < 30:
        return False
    recent = [dict(zip(each.name, each.position)) for each in planner.states.messages[-30:]]
    return all(np.ptp([each[name] for each in recent]) < 1e-3 for name in NAMES)


def test_plan_is_a_trajectory_and_moves_nothing(planner):
    before = planner.joints
    goal = [*before[:1], *READY[1:]]
    goal[0] = before[0] + 0.6
    answer = planner.plan(joints=JointState(name=NAMES, position=goal))
    assert answer.success and answer.planner, answer.message
    points = answer.trajectory.points
    assert answer.trajectory.joint_names == NAMES
    assert points[0].positions == pytest.approx(before, abs=1e-3)
    assert points[-1].positions == pytest.approx(goal, abs=1e-3)
    assert max(map(abs, (*points[0].velocities, *points[-1].velocities))) < 1e-6
    times = [point.time_from_start.to_sec() for point in points]
    assert times[0] == 0.0 and np.diff(times).min() > 0.0
    assert planner.joints == pytest.approx(before, abs=1e-3)


def test_motion_brings_the_link_to_the_pose(planner):
    goal = RobotPose((0.45, 0.1, 0.5), (1.0, 0.0, 0.0, 0.0))
    answer = planner.move(link=LINK, pose=pose_of(*goal.position))
    assert answer.success and answer.plans == 1, answer.message
    wait_until(lambda: rests(planner), "it rests")
    reached = planner.link_pose()
    assert math.dist(reached.position, goal.position) < 0.005
    assert angle_between(reached.quat_xyzw, goal.quat_xyzw) < 0.02


def test_pose_may_be_in_another_frame(planner):
    box = planner.tf.lookup_transform("rpbi/world", "rpbi/box_2", rospy.Time(0)).transform.translation
    answer = planner.move(link=LINK, pose=pose_of(0.0, -0.2, 0.0, (-0.5, 0.5, 0.5, 0.5), frame="rpbi/box_2"))
    assert answer.success, answer.message
    wait_until(lambda: rests(planner), "it rests")
    assert math.dist(planner.link_pose().position, (box.x, box.y - 0.2, box.z)) < 0.01


def test_path_and_ghost_are_shown(planner):
    plans = planner.ros.listen("/planner/markers", MarkerArray)
    ghosts = planner.ros.listen("/planner/ghost", MarkerArray)
    assert planner.plan(joints=JointState(name=NAMES[:1], position=[planner.joints[0] + 0.4])).success

    def begins_at_the_hand() -> bool:
        path = next(each for each in plans.messages[-1].markers if each.ns == "path")
        first = path.points[0]
        is_here = math.dist((first.x, first.y, first.z), planner.link_pose().position) < 0.01
        return is_here and path.type == Marker.LINE_STRIP and len(path.points) > 10

    wait_until(begins_at_the_hand, "the path is shown")
    ghosts.wait_for(10)
    shown = {each.id: each.pose.position for each in ghosts.messages[-1].markers}
    assert len(shown) > 8


def test_times_of_a_trajectory_message_increase_strictly():
    times = np.array([0.0, 0.037, 0.037 + 1e-12, 0.04])
    rows = np.arange(4.0)[:, None]
    message = trajectory_message(["joint"], SampledMotion(times, rows, rows, rows))
    assert [point.time_from_start.to_nsec() for point in message.points] == [0, 37_000_000, 40_000_000]
    assert [point.positions[0] for point in message.points] == [0.0, 2.0, 3.0]


def sent_at(stamp: rospy.Time, goal: MoveRobotGoal) -> MoveRobotActionGoal:
    """Returns a goal as its message, which a client with simulated time sent at a time.

    Other tests' goals have the wall's time. They have to come later: the server recalls goals older than the last one.
    """
    goal_id = GoalID(stamp, f"sent at {stamp.to_sec()}")
    return MoveRobotActionGoal(Header(stamp=stamp), goal_id, goal)


def test_motion_starts_from_states_as_new_as_the_request(planner):
    """The goal's stamp is ahead of the joint states, as if those were late; until they come, the robot moves."""
    planner.move_to(READY)
    results = planner.ros.listen("/planner/move_robot/result", MoveRobotActionResult)
    sent = planner.states.messages[-1].header.stamp + rospy.Duration(1.5)
    with (
        publishing("/planner/move_robot/goal", MoveRobotActionGoal) as goals,
        publishing("/rpbi/panda/joint_states/target", JointState) as targets,
    ):
        goals.publish(sent_at(sent, MoveRobotGoal(MotionRequest(named="ready"))))
        targets.publish(JointState(name=NAMES[:1], position=[0.3]))
        wait_until(lambda: planner.joints[0] > 0.28, "it moves away")
        assert not results.messages
        results.wait_for(1)
    assert results.messages[0].result.success, results.messages[0].result.message
    assert results.messages[0].header.stamp > sent
    assert planner.joints == pytest.approx(READY, abs=5e-3)


@pytest.mark.thorough  # it takes 10 s
def test_motion_is_refused_if_all_states_are_older(planner):
    results = planner.ros.listen("/planner/move_robot/result", MoveRobotActionResult)
    planner.ros.call("/rpbi/stop", Trigger)
    with publishing("/planner/move_robot/goal", MoveRobotActionGoal) as goals:
        sent = planner.states.messages[-1].header.stamp + rospy.Duration(5.0)
        goals.publish(sent_at(sent, MoveRobotGoal(MotionRequest(named="ready"))))
        results.wait_for(1)
    planner.ros.call("/rpbi/start", Trigger)
    result = results.messages[0].result
    assert not result.success and "robot 'panda': expected joint states as new as the request" in result.message


def test_cancelled_goal_stops_the_robot(planner):
    planner.move_to(READY)
    goal = [1.5, *READY[1:]]
    planner.action.wait_for_server()
    planner.action.send_goal(MoveRobotGoal(MotionRequest(joints=JointState(name=NAMES, position=goal))))
    wait_until(lambda: planner.joints[0] > 0.2, "it moves")
    planner.action.cancel_goal()
    assert planner.action.wait_for_result(rospy.Duration(60))
    assert planner.action.get_state() == GoalStatus.PREEMPTED
    assert planner.action.get_result().message == "cancelled; the robot is at rest"
    wait_until(lambda: rests(planner), "it rests")
    assert 0.2 < planner.joints[0] < 1.4


def test_obstacle_in_the_way_makes_it_stop_and_plan_again(planner):
    planner.move_to(READY)
    goal = [-1.5, *READY[1:]]
    phases = []
    request = MoveRobotGoal(MotionRequest(joints=JointState(name=NAMES, position=goal)))
    planner.action.send_goal(request, feedback_cb=lambda each: phases.append(each.phase))
    wait_until(lambda: planner.joints[0] < -0.05, "it moves")
    shape = {"shapeType": "GEOM_BOX", "halfExtents": [0.04, 0.04, 0.04]}
    block = {
        "name": "block",
        "createVisualShape": shape,
        "createCollisionShape": shape,
        "basePosition": [0.0, 0.0, 0.0],
    }
    # where the hand would pass half-way
    angle = -0.75
    reached = planner.link_pose().position
    radius, height = math.hypot(*reached[:2]), reached[2]
    block["basePosition"] = [radius * math.cos(angle), radius * math.sin(angle), height]
    assert add(planner.ros, PybulletObject.COLLISION, block).success
    try:
        assert planner.action.wait_for_result(rospy.Duration(120))
        result = planner.action.get_result()
        assert result.success and result.plans > 1, result.message
        assert "stopping" in phases and phases.index("stopping") < len(phases) - 1
        wait_until(lambda: rests(planner), "it rests")
        assert planner.joints == pytest.approx(goal, abs=0.01)
    finally:
        assert remove(planner.ros, "block").success


def test_foreseen_poses_are_reached(planner):
    planner.move_to(READY)
    goal = [0.5, *READY[1:]]
    answer = planner.plan(joints=JointState(name=NAMES, position=goal), foresee=True)
    assert answer.success and answer.message.endswith("; foreseen: no contacts of 'panda'"), answer.message
    bodies = {each.name: each for each in answer.foreseen.bodies}
    assert {*bodies} == {"panda", "box_1", "box_2", "box_3"}
    names = bodies["panda"].joint_names
    last = dict(zip(names, bodies["panda"].joints[-len(names) :]))
    assert [last[name] for name in NAMES] == pytest.approx(goal, abs=0.01)
    assert planner.joints == pytest.approx(READY, abs=0.01), "nothing has moved"
    moved = planner.move(joints=JointState(name=NAMES, position=goal), foresee=True)
    (error_mm,) = re.findall(r"farthest from its foreseen place: 'box_\d', (\S+) mm", moved.message)
    assert moved.success and float(error_mm) < 1.0, moved.message


def test_touch_that_nobody_has_planned_is_foreseen(planner):
    planner.move_to(READY)
    at = planner.link_pose().position
    shape = {"shapeType": "GEOM_SPHERE", "radius": 0.03}
    ball = {"name": "ball", "createVisualShape": shape, "createCollisionShape": shape, "baseMass": 0.2,
            "basePosition": [at[0], at[1], at[2] + 0.5], "broadcast_hz": 50.0}  # fmt: skip
    assert planner.ros.call("/rpbi/stop", Trigger).success
    assert add(planner.ros, PybulletObject.DYNAMIC, ball).success
    try:
        goal = JointState(name=NAMES[6:], position=[READY[6] + 1.0])

        def plan():
            return planner.plan(joints=goal, foresee=True)

        answer = wait_until(lambda: (found := plan()).success and "'ball'" in found.message and found, "it is foreseen")
        assert re.search(r"foreseen: contacts of 'panda' up to \d+ N; 'ball' moves by \d{3,4} mm$", answer.message)
    finally:
        assert planner.ros.call("/rpbi/start", Trigger).success
        assert remove(planner.ros, "ball").success


def test_nothing_is_foreseen_from_another_start(planner):
    start = JointState(name=NAMES, position=READY)
    answer = planner.plan(named="ready", start=start, foresee=True)
    assert not answer.success and answer.message.startswith("foresee: expected no start")


BAD = {
    "no goal": ({}, "expected one goal (joints, named, pose or goal; a pose needs a link), got none"),
    "two goals": ({"named": "ready", "link": LINK}, "got named, pose"),
    "unknown robot": ({"robot": "pandora", "named": "ready"}, "there is panda"),
    "body that is no robot": ({"robot": "box_1", "named": "ready"}, "there is panda"),
    "unknown posture": ({"named": "redy"}, "did you mean 'ready'?"),
    "not finite": ({"link": LINK, "pose": pose_of(math.nan, 0.0, 0.5)}, "pose: expected finite numbers"),
    "no rotation": ({"link": LINK, "pose": pose_of(0.4, 0.0, 0.5, (0.0, 0.0, 0.0, 0.0))}, "quaternion"),
    "negative tolerance": (
        {"link": LINK, "pose": pose_of(0.4, 0.0, 0.5), "position_tolerance": -1.0},
        "expected at least 0",
    ),
    "unknown frame": ({"link": LINK, "pose": pose_of(0.0, 0.0, 0.0, frame="nowhere")}, "nowhere"),
    "unknown link": ({"link": "panda_toe", "pose": pose_of(0.4, 0.0, 0.5)}, "panda_toe"),
    "out of reach": ({"link": LINK, "pose": pose_of(2.0, 0.0, 0.5)}, "reach"),
    "in a board": ({"link": LINK, "pose": pose_of(0.3, 0.6, 0.54, (-0.5, 0.5, 0.5, 0.5))}, "shelf"),
    "unknown joint": ({"joints": JointState(name=["panda_joint9"], position=[0.0])}, "panda_joint9"),
    "missing position": ({"joints": JointState(name=NAMES, position=[0.0])}, "joints: "),
    "joint beyond its limit": ({"joints": JointState(name=["panda_joint4"], position=[1.0])}, "panda_joint4"),
    "unknown joint in the group": ({"named": "ready", "group": ["panda_joint9"]}, "panda_joint9"),
    "negative time limit": ({"named": "ready", "time_limit": -1.0}, "time_limit"),
    "unknown planner": ({"named": "ready", "planner": "rrt_conect"}, "rrt_conect"),
    "goal that is no YAML": ({"goal": "{"}, "goal"),
    "unknown constraint": ({"named": "ready", "constraints": ["sideways: 1"]}, "constraints[0]"),
    "held by nothing": ({"named": "ready", "held": ["box_1"]}, "held_link: expected the link"),
    "unknown held body": ({"named": "ready", "held": ["box_9"], "held_link": "panda_hand"}, "box_9"),
    "held body far away": ({"named": "ready", "held": ["left_shelf"], "held_link": "panda_hand"}, "left_shelf"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_request_is_refused_and_nothing_moves(planner, name):
    fields, named = BAD[name]
    before = planner.joints
    answer = planner.plan(**fields)
    assert not answer.success and named in answer.message and "\n" not in answer.message, answer.message
    assert not answer.trajectory.points
    moved = planner.move(**fields)
    assert not moved.success and named in moved.message
    assert planner.joints == pytest.approx(before, abs=1e-3)


def test_start_of_a_motion_cannot_be_chosen(planner):
    answer = planner.move(named="ready", start=JointState(name=NAMES, position=READY))
    assert not answer.success and answer.message.startswith("start: expected none")


def test_nothing_to_stop(planner):
    answer = planner.ros.call("/planner/stop", Trigger)
    assert (answer.success, answer.message) == (False, "there is nothing to stop")


def test_dragged_goal_is_planned_and_moved_to(planner):
    planner.move_to(READY)
    answer = planner.ros.call("/planner/plan_to_frame", Trigger)
    assert answer.success and answer.message.endswith("planner/move executes it"), answer.message
    answer = planner.ros.call("/planner/move", Trigger)
    assert answer.success, answer.message
    wait_until(lambda: rests(planner), "it rests")
    goal = planner.tf.lookup_transform("rpbi/world", "rpbi/goal", rospy.Time(0)).transform.translation
    assert math.dist(planner.link_pose().position, (goal.x, goal.y, goal.z)) < 0.005


def test_old_plan_is_not_executed_from_another_place(planner):
    planner.move_to(READY)
    assert planner.ros.call("/planner/plan_to_frame", Trigger).success
    with publishing("/rpbi/panda/joint_states/target", JointState) as targets:
        targets.publish(JointState(name=NAMES[:1], position=[0.3]))
        wait_until(lambda: planner.joints[0] > 0.25, "it moves away")
    answer = planner.ros.call("/planner/move", Trigger)
    assert not answer.success and "expected joint 'panda_joint1' at the start of the plan" in answer.message


def test_example_configuration_fits_the_schema():
    from custom_ros_tools.config import load_config
    from rpbi_planning.node_configs import MotionPlannerConfig

    path = "{rpbi_examples}/configs/planning_example/planner.yaml"
    config = MotionPlannerConfig.parse(load_config(path), path)
    assert [*config.postures["ready"].values()] == READY
    with pytest.raises(Exception, match="speed"):
        MotionPlannerConfig.parse(yaml.safe_load("speed: 2.0"), "planner.yaml")


def test_missing_extra_ends_the_node_with_one_line(ros, tmp_path):
    (tmp_path / "pinocchio.py").write_text("raise ImportError('none here', name='pinocchio')\n")
    modules = os.pathsep.join((str(tmp_path), os.environ["PYTHONPATH"]))
    node = ros.start(["rosrun", "rpbi_planning", "motion_planner_node.py"], PYTHONPATH=modules)
    wait_until(lambda: node.poll() is not None, "it has ended")
    (line,) = [line for line in ros.output(node).splitlines() if "not installed" in line]
    assert "./rpbi setup planning" in line and "FATAL" in line
    assert "Traceback" not in ros.output(node) and node.returncode == 1
