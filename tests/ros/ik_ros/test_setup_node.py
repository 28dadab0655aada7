"""`ik_setup_node.py`: TF, joint states, tolerances and goals become problems; `tf_to_floatarray_node.py`."""

from __future__ import annotations

import math

import pytest
import rospy
import tf2_ros
from geometry_msgs.msg import Point, Pose, Quaternion
from ik_nodes import HOME, JOINTS, start_setup, static_transform, transform
from node_world import Rosout, publishing
from ros_system import wait_until
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Float64MultiArray
from std_srvs.srv import SetBool

from ik_ros.msg import IKProblem

TARGET = Pose(Point(0.3, -0.2, 0.5), Quaternion(0.0, math.sqrt(0.5), 0.0, math.sqrt(0.5)))
FRAMES = {"parent_frame_id": "foot", "child_frame_id": "target"}


@pytest.fixture
def target(ros):
    """Broadcasts where the target is, as often as it is called."""
    broadcaster = tf2_ros.TransformBroadcaster()

    def send(pose: Pose = TARGET) -> None:
        broadcaster.sendTransform(transform("foot", "target", pose, rospy.Time.from_sec(rospy.get_time())))

    yield send
    broadcaster.pub_tf.unregister()


def hear(problems, target, condition, what):
    """Keeps the target alive until the newest problem fulfils a condition, and returns it."""
    wait_until(lambda: target() or (problems.messages and condition(problems.messages[-1])), what)
    return problems.messages[-1]


def wait_until_none_comes(problems, meanwhile=lambda: None):
    """Waits until no new problem comes for some twenty periods."""

    def none_comes():
        last = problems.messages[-1].header.stamp
        for _ in range(20):
            meanwhile()
            rospy.rostime.wallsleep(0.02)
        return problems.messages[-1].header.stamp == last

    wait_until(none_comes, "problems stop")


@pytest.mark.quick
def test_target_start_tolerances_and_previous_solutions_come_together(ros, target):
    start_setup(ros, **FRAMES, init_bx=0.01, max_num_prev_solutions=2, seed=7, hz=100.0)
    problems = ros.listen("ik", IKProblem)
    with (
        publishing("ik/setup/kdl/qinit", JointState) as start,
        publishing("ik/setup/kdl/brz", Float64) as turn,
        publishing("ik/setup/kdl/previous_solutions", JointState) as previous,
    ):
        start.publish(JointState(name=JOINTS, position=HOME))
        turn.publish(3.2)
        for value in (0.1, 0.2, 0.3):
            previous.publish(JointState(name=["a"], position=[value]))
        problem = hear(
            problems,
            target,
            lambda one: (
                one.start.name
                and one.rotation_tolerance.z
                and len(one.previous_solutions) == 2
                and one.previous_solutions[-1].position == (0.3,)
            ),
            "a problem has all of it",
        )
    assert problem.has_target and problem.target == TARGET
    assert problem.header.frame_id == "foot" and problem.header.stamp
    assert dict(zip(problem.start.name, problem.start.position)) == pytest.approx(dict(zip(JOINTS, HOME)))
    assert (problem.position_tolerance.x, problem.position_tolerance.y, problem.rotation_tolerance.z) == (0.01, 0, 3.2)
    assert [one.position for one in problem.previous_solutions] == [(0.2,), (0.3,)]
    assert problem.seed == 7
    assert rospy.get_param("ik_ros/interface") == "kdl"


def test_no_problem_is_published_without_current_tf_of_a_target(ros, target):
    rosout = Rosout(ros)
    start_setup(ros, **FRAMES, tf_timeout_s=0.2)
    problems = ros.listen("ik", IKProblem)
    wait_until(lambda: rosout.logs("there is no TF from 'foot' to 'target'"), "it says what it lacks")
    assert problems.messages == []
    hear(problems, target, lambda _: True, "problems come")
    wait_until(lambda: rosout.logs("is stale: nothing new has come"), "it says that TF is stale")
    wait_until_none_comes(problems)
    count = len(problems.messages)
    wait_until(lambda: target() or len(problems.messages) > count, "problems come again when TF does")


def test_nothing_is_published_before_the_first_start(ros):
    rosout = Rosout(ros)
    start_setup(ros, goals={"hand": [0.1, 0.2, 0.3]}, wait_for_start=True)
    problems = ros.listen("ik", IKProblem)
    rosout.wait_for(["no problem is published: no start has come yet on /ik/setup/kdl/qinit"])
    assert problems.messages == []
    with publishing("ik/setup/kdl/qinit", JointState) as start:
        start.publish(JointState(name=JOINTS, position=HOME))
        problems.wait_for(1)
    assert problems.messages[0].start.position == pytest.approx(HOME)


def test_absurdly_distant_target_is_refused_and_the_next_accepted(ros, target):
    rosout = Rosout(ros)
    start_setup(ros, **FRAMES)
    problems = ros.listen("ik", IKProblem)
    far = Pose(Point(1e10, 0.0, 0.0), TARGET.orientation)
    wait_until(lambda: target(far) or rosout.logs("target: position: expected finite numbers"), "it is refused")
    assert problems.messages == []
    hear(problems, target, lambda _: True, "problems go on")


def test_static_target_never_gets_stale(ros):
    with static_transform("foot", "target", TARGET):
        start_setup(ros, **FRAMES, tf_timeout_s=0.05, hz=100.0)
        problems = ros.listen("ik", IKProblem)
        problems.wait_for(50)


def test_goals_of_tasks_change_by_topic_and_keep_their_length(ros):
    rosout = Rosout(ros)
    start_setup(ros, "tasks", goals={"hand": [0.1, 0.2, 0.3], "head": [1.0]})
    problems = ros.listen("ik", IKProblem)

    def goals():
        return {goal.task: goal.values for goal in problems.messages[-1].goals} if problems.messages else {}

    wait_until(lambda: goals() == {"hand": (0.1, 0.2, 0.3), "head": (1.0,)}, "the first goals come")
    assert not problems.messages[-1].has_target
    with publishing("ik/setup/tasks/task_map_goal/hand", Float64MultiArray) as hand:
        hand.publish(Float64MultiArray(data=[0.1, 0.2]))
        hand.publish(Float64MultiArray(data=[0.1, 0.2, math.nan]))
        hand.publish(Float64MultiArray(data=[0.4, 0.5, 0.6]))
        wait_until(lambda: goals() == {"hand": (0.4, 0.5, 0.6), "head": (1.0,)}, "a goal changes")
    rosout.wait_for(["task_map_goal/hand: message refused: expected 3 values"])


@pytest.mark.parametrize(
    ("topic", "message", "told"),
    [
        ("qinit", JointState(name=["a"], position=[math.nan]), "values must be finite"),
        ("currentPosition", JointState(position=[1.0]), "expected the names"),
        ("bx", Float64(-0.1), "must not be negative"),
        ("brx", Float64(math.inf), "expected finite numbers"),
    ],
)
def test_bad_messages_are_refused_and_the_topic_named(ros, target, topic, message, told):
    rosout = Rosout(ros)
    start_setup(ros, **FRAMES)
    problems = ros.listen("ik", IKProblem)
    with publishing(f"ik/setup/kdl/{topic}", type(message)) as publisher:
        wait_until(lambda: publisher.publish(message) or rosout.logs(told), "it is refused")
    assert f"/ik/setup/kdl/{topic}" in rosout.logs(told)[0].msg
    problem = hear(problems, target, lambda _: True, "problems go on")
    assert problem.start.name == [] and problem.position_tolerance.x == problem.rotation_tolerance.x == 0.0


def test_it_is_switched_by_service(ros, target):
    start_setup(ros, start_on_init=False, **FRAMES)
    problems = ros.listen("ik", IKProblem)
    assert ros.call("ik/setup/kdl/toggle", SetBool, True).success
    hear(problems, target, lambda _: True, "problems come")
    assert ros.call("ik/setup/kdl/toggle", SetBool, False).success
    wait_until_none_comes(problems, meanwhile=target)


@pytest.mark.parametrize(
    ("parameters", "told"),
    [
        ({"parent_frame_id": "foot"}, "child_frame_id: missing; parent_frame_id and child_frame_id go together"),
        ({}, "child_frame_id: missing; a problem has a target frame, or goals of tasks"),
        ({**FRAMES, "hz": 0.0}, "hz: must be > 0"),
        ({**FRAMES, "init_brx": 1e10}, "rotation_tolerance: expected finite numbers"),
        ({**FRAMES, "init_brx": -1.0}, "init_brx: must be >= 0"),
    ],
)
def test_wrong_parameters_end_it_with_1_and_their_names(ros, parameters, told):
    rospy.set_param("/ik_setup_node", parameters)
    process = ros.start(["rosrun", "ik_ros", "ik_setup_node.py", "kdl", "__name:=ik_setup_node"])
    assert process.wait(60.0) == 1
    assert told in ros.output(process), ros.output(process)


@pytest.mark.parametrize(
    ("mode", "rotation"),
    [("pos", ()), ("pos+quat", (0.0, math.sqrt(0.5), 0.0, math.sqrt(0.5))), ("pos+eul", (0.0, math.pi / 2, 0.0))],
)
def test_transform_as_numbers(ros, mode, rotation):
    with static_transform("foot", "target", TARGET):
        rospy.set_param("/tf_to_floatarray_node", {**FRAMES, "mode": mode})
        ros.start(["rosrun", "ik_ros", "tf_to_floatarray_node.py", "__name:=tf_to_floatarray_node"])
        numbers = ros.listen("transform", Float64MultiArray).wait_for()[0].data
        assert numbers == pytest.approx((0.3, -0.2, 0.5, *rotation), abs=1e-6)


def test_simulated_robot_is_asked_itself(ros, target):
    arm = {
        "name": "arm",
        "loadURDF": {"fileName": "kuka_iiwa/model.urdf", "useFixedBase": True},
        "setJointMotorControlArray": {"controlMode": "POSITION_CONTROL"},
        "start_ik_callback": True,
        "broadcast_link_states": True,
    }
    ros.simulator(
        {
            "connect": {"connection_mode": "DIRECT"},
            "setAdditionalSearchPath": "pybullet_data_path",
            "robots": [ros.write_yaml("arm.yaml", arm)],
        }
    )
    wanted = Pose(Point(0.5, 0.1, 0.6), Quaternion(0.0, 1.0, 0.0, 0.0))
    with static_transform("rpbi/world", "target", wanted):
        config = {
            "robot_name": "arm",
            "link_name": "lbr_iiwa_link_7",
            "parent_frame_id": "rpbi/world",
            "child_frame_id": "target",
        }
        rospy.set_param("/ik_setup_node", {"config": config, "start_on_init": True})
        ros.start(["rosrun", "ik_ros", "ik_setup_node.py", "pybullet", "__name:=ik_setup_node", "ik:=rpbi/arm/ik"])
        buffer = ros.listen_to_tf()

        def is_there():
            try:
                found = buffer.lookup_transform("rpbi/world", "rpbi/arm/lbr_iiwa_link_7", rospy.Time(0)).transform
            except tf2_ros.TransformException:
                return False
            p = found.translation
            return math.dist((p.x, p.y, p.z), (0.5, 0.1, 0.6)) < 5e-3

        wait_until(is_there, "the arm goes to the target")


def test_empty_configuration_that_deleted_parameters_leave_counts_as_none(ros, target):
    start_setup(ros, "pybullet", **FRAMES, hz=100.0, config={})
    problems = ros.listen("ik", IKProblem)
    hear(problems, target, lambda each: each.has_target, "problems come")
