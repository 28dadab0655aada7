"""The solver `exotica` in its nodes, and the release's `kuka_lwr_exotica_example` as its users have it."""

from __future__ import annotations

import math
import os
import shutil
from pathlib import Path

import pytest
import rospy
import yaml
from exotica_files import ARM, POSE_MAP, SRDF, VELOCITY_MAP, write_problem
from geometry_msgs.msg import Point, Pose, Quaternion
from ik_nodes import BENT, HOME, JOINTS, forward, start_at, start_node, static_transform
from ros_system import wait_until
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import SetBool

from custom_ros_tools.errors import ConfigError
from ik_ros.msg import EXOTicaProblem, EXOTicaSyncTf, IKSolution
from ik_ros.ros.exotica import synced_frames
from ik_ros.srv import EXOTica, EXOTicaInfo, JointNames, JointNamesRequest

PROGRAMS = Path(__file__).resolve().parents[2] / "support/programs"
FIGURE_EIGHT = Path(__file__).parents[3] / "devel/lib/ik_ros_examples/figure_eight_node.py"
COSTS = '<Task Task="Pose" Rho="1"/><Task Task="JointVel" Rho="0.5e-3"/>'
NEAR_M = 2e-3


def distance(positions, pose: Pose) -> float:
    a, b = forward(positions).position, pose.position
    return math.dist((a.x, a.y, a.z), (b.x, b.y, b.z))


def test_services_and_problems_of_the_release(ros, tmp_path):
    path = write_problem(tmp_path, POSE_MAP + VELOCITY_MAP, COSTS)
    start_node(ros, "ik_solver_node.py", "exotica", "ik/solver/exotica/solve", xml_filename=path, start_on_init=True)
    info = rospy.ServiceProxy("exotica_info", EXOTicaInfo)()
    assert info.xml_filename == path and not info.use_scipy_solver
    assert (info.task_map_names, list(info.task_map_nrho)) == (["Pose", "JointVel"], [6, 7])
    assert info.task_map_types == ["exotica::EffFrame", "exotica::JointVelocityBackwardDifference"]
    names = rospy.ServiceProxy("ik/solver/exotica/joint_names", JointNames)(JointNamesRequest()).joint_names
    assert names == info.controlled_joint_names == JOINTS

    goal = forward(BENT)
    p, q = goal.position, goal.orientation
    sync = EXOTicaSyncTf("any", "frame", "", "Target", [p.x, p.y, p.z, q.x, q.y, q.z, q.w])
    zeros = [Float64MultiArray(data=[0.0] * count) for count in info.task_map_nrho]
    problem = EXOTicaProblem(task_map_names=info.task_map_names, task_map_goals=zeros, start_state=start_at(HOME))
    problem.sync_tf = [sync]
    solve = rospy.ServiceProxy("ik/solver/exotica/solve", EXOTica)
    answer = solve(problem)
    assert answer.success, answer.message
    assert answer.solution.name == JOINTS and distance(answer.solution.position, goal) < 1e-3
    for wrong, message in (("Tagret", "did you mean 'Target'"), ("Target", "expected 7 numbers")):
        problem.sync_tf = [EXOTicaSyncTf("any", "frame", "", wrong, [] if wrong == "Target" else sync.transform)]
        answer = solve(problem)
        assert not answer.success and message in answer.message

    with pytest.raises(ConfigError, match="sync_tf_to_exotica_object.*expected four names.*'base goal'"):
        synced_frames(["base goal"])
    solutions, targets = ros.listen("ik/solution", IKSolution), ros.listen("joint_states/target", JointState)
    with static_transform("base", "goal", Pose(Point(p.x, p.y, p.z), Quaternion(q.x, q.y, q.z, q.w))):
        more = {"start_on_init": True, "sync_tf_to_exotica_object": ["base goal '' Target"]}
        start_node(ros, "ik_setup_node.py", "exotica", "ik/setup/exotica/toggle", **more)
        solution, target = solutions.wait_for()[-1], targets.wait_for()[-1]
    assert solution.success, solution.message
    assert solution.interface_name == "exotica" and distance(target.position, goal) < 1e-3


LAUNCH = """<launch>
  <node pkg="ros_pybullet_interface" type="ros_pybullet_interface_node.py" name="simulator">
    <rosparam param="config" file="$(find ik_ros_examples)/configs/kuka_lwr_exotica_example/config.yaml"/>
  </node>
  <node pkg="ik_ros" type="ik_solver_node.py" name="ik_solver" args="exotica" output="screen">
    <remap from="joint_states/target" to="rpbi/kuka_lwr/joint_states/target"/>
    <param name="xml_filename" value="{ik_ros_examples}/configs/kuka_lwr_exotica_example/kuka_lwr.xml"/>
  </node>
  <node pkg="ik_ros" type="ik_setup_node.py" name="ik_setup" args="exotica" output="screen">
    <remap from="ik/setup/exotica/start_state" to="rpbi/kuka_lwr/joint_states"/>
    <remap from="ik/setup/exotica/previous_solutions" to="rpbi/kuka_lwr/joint_states/target"/>
    <rosparam>sync_tf_to_exotica_object: ["rpbi/kuka_lwr/base figure_eight '' Target"]</rosparam>
  </node>
  <node pkg="ik_ros_examples" type="figure_eight_node.py" name="figure_eight">
    <param name="start_on_init" value="false"/>
  </node>
  <node pkg="tf2_ros" type="static_transform_publisher" name="figure_tf"
        args="-0.5 0 0.65 0 1.57 3.141 rpbi/world figure_eight_base"/>
  <node pkg="ik_ros_examples" type="run_example.py" name="client" args="exotica" output="screen">
    <param name="robot_name" value="kuka_lwr"/>
  </node>
</launch>"""
CONFIGS = "configs/kuka_lwr_exotica_example"
HOME_DEG = (0.0, 30.0, 0.0, -90.0, 0.0, 60.0, 0.0)


def write_package(folder: Path) -> Path:
    """Writes a package of the form of the release's `ik_ros_examples`; returns its launch file."""
    package = folder / "ik_ros_examples"
    configs = package / CONFIGS
    configs.mkdir(parents=True)
    (package / "package.xml").write_text(
        "<package format='2'><name>ik_ros_examples</name><version>0.0.0</version><description>d</description>"
        "<maintainer email='a@b.invalid'>a</maintainer><license>l</license></package>"
    )
    shutil.copy(ARM, configs / "lwr.urdf")
    programs = folder / "devel/lib/ik_ros_examples"
    programs.mkdir(parents=True)
    shutil.copy(PROGRAMS / "exotica_client.py", programs / "run_example.py")
    shutil.copy(FIGURE_EIGHT, programs)
    (folder / "devel/.catkin").write_text(str(folder))
    pose = POSE_MAP.replace("end_effector_ball", "lwr_arm_7_link")
    urdf = f"{{ik_ros_examples}}/{CONFIGS}/lwr.urdf"
    xml = Path(write_problem(configs, pose + VELOCITY_MAP, COSTS, urdf=urdf))
    (configs / "lwr.srdf").write_text(SRDF)
    srdf = f"{{ik_ros_examples}}/{CONFIGS}/lwr.srdf"
    (configs / "kuka_lwr.xml").write_text(xml.read_text().replace(str(configs / "arm.srdf"), srdf))
    robot = {
        "name": "kuka_lwr",
        "loadURDF": {"fileName": urdf, "useFixedBase": 1},
        "initial_joint_position": dict(zip(JOINTS, HOME_DEG)),
        "is_visual_robot": False,
        "setJointMotorControlArray": {"controlMode": "POSITION_CONTROL"},
        "enabled_joint_force_torque_sensors": ["lwr_arm_6_joint"],
        "publish_joint_state_frequency": 30,
        "broadcast_link_states": True,
        "self.broadcast_link_states_hz": 50,
    }
    (configs / "kuka_lwr.yaml").write_text(yaml.safe_dump(robot))
    world = {
        "connect": {"connection_mode": "DIRECT"},
        "gravity": [0.0, 0.0, -9.81],
        "timeStep": 0.01,
        "start_pybullet_after_initialization": True,
        "status_hz": 50,
        "robots": [f"{{ik_ros_examples}}/{CONFIGS}/kuka_lwr.yaml"],
    }
    (configs / "config.yaml").write_text(yaml.safe_dump(world))
    (package / "kuka_lwr_exotica_example.launch").write_text(LAUNCH)
    return package / "kuka_lwr_exotica_example.launch"


@pytest.mark.thorough
def test_example_of_the_release_tracks_its_figure(ros, tmp_path):
    launch = write_package(tmp_path)
    tf = ros.listen_to_tf()
    over_ours = {"ROS_PACKAGE_PATH": tmp_path, "CMAKE_PREFIX_PATH": tmp_path / "devel"}
    paths = {name: f"{path}:{os.environ[name]}" for name, path in over_ours.items()}
    process = ros.start(["roslaunch", str(launch)], **paths)

    def at(frame: str) -> tuple[float, float, float] | None:
        assert process.poll() is None, ros.output(process)
        if not tf.can_transform("rpbi/world", frame, rospy.Time(0)):
            return None
        p = tf.lookup_transform("rpbi/world", frame, rospy.Time(0)).transform.translation
        return p.x, p.y, p.z

    visited = []

    def has_gone_around() -> bool:
        if (target := at("figure_eight")) is not None:
            visited.append(target[1])
        return bool(visited) and max(visited) - min(visited) > 0.2

    wait_until(has_gone_around, "the target moves along the figure", 300.0)
    ros.call("toggle_figure_eight", SetBool, False)

    def is_reached() -> bool:
        tip, target = at("rpbi/kuka_lwr/lwr_arm_7_link"), at("figure_eight")
        return tip is not None and target is not None and math.dist(tip, target) < NEAR_M

    wait_until(is_reached, "the link is at the target", 60.0)
    assert "[ERROR]" not in ros.output(process)
