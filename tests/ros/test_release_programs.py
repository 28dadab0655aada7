"""Launch files and programs by the release's names: what they achieve, in launch files of its form."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import roslib.packages
import rospkg
import rospy
import tf2_ros
from geomagic_touch_x_ros.msg import OmniFeedback
from geometry_msgs.msg import PoseStamped, Vector3, WrenchStamped
from keyboard.msg import Key
from node_world import publishing
from ros_system import RosSystem, wait_until
from roslaunch.config import load_config_default
from std_msgs.msg import Float64, Float64MultiArray
from worlds import box, write_world

ROOT = Path(__file__).resolve().parents[2]
TIP = "rpbi/kuka_lwr/end_effector_ball"
LAUNCH_FILES = {
    "rpbi_examples": "run_pose_talos run_pose_kinova run_pose_human_model human_model_waving optas_kuka_lwr_expr "
    "optas_kuka_lwr_expr2 nsl nsl_haption",
    "ik_ros_examples": "kuka_lwr_trac_ik_example kuka_lwr_pybullet_example kuka_lwr_exotica_example",
    "rgbd_launch": "includes/processing.launch.xml includes/manager.launch.xml",
    "ik_ros": "tf_to_floatarray",
}
ARGUMENTS = {
    "includes/processing.launch.xml": ["manager:=manager"],
    "includes/manager.launch.xml": ["name:=manager"],
    "tf_to_floatarray": ["child:=figure_eight"],
}
OF_DEBIAN = {"nodelet"}
"""Packages that are no part of this workspace, nor needed by it."""


def test_every_launch_file_loads_and_its_programs_are_found():
    packages = rospkg.RosPack()
    for package, names in LAUNCH_FILES.items():
        for name in names.split():
            path = Path(packages.get_path(package), "launch", name if "." in name else f"{name}.launch")
            loaded = load_config_default([(str(path), ARGUMENTS.get(name, []))], None, assign_machines=False)
            assert loaded.nodes, name
            for node in loaded.nodes:
                found = node.package in OF_DEBIAN or roslib.packages.find_node(node.package, node.type, packages)
                assert found, f"{name}: {node.package}/{node.type}"


Where = Callable[[str, str], "np.ndarray | None"]


@pytest.fixture
def where(ros: RosSystem) -> Where:
    """Returns the position of a frame in another one [m]; None while TF does not have it."""
    buffer = ros.listen_to_tf()

    def look(parent: str, child: str) -> np.ndarray | None:
        try:
            at = buffer.lookup_transform(parent, child, rospy.Time(0)).transform.translation
        except tf2_ros.TransformException:
            return None
        return np.array([at.x, at.y, at.z])

    return look


@pytest.mark.thorough
def test_the_human_model_waves(ros, where):
    ros.start(["roslaunch", "rpbi_examples", "human_model_waving.launch", "headless:=true"])
    seen: list[np.ndarray] = []

    def has_waved() -> bool:
        hand = where("rpbi/human/Head", "rpbi/human/RightHand")
        if hand is not None:
            seen.append(hand)
        raised = [each[1] for each in seen if each[2] > -0.1]
        return len(raised) > 5 and max(raised) - min(raised) > 0.1

    wait_until(has_waved, "the hand is up, and moves to both sides", 120.0)


@pytest.mark.thorough
def test_sensors_of_nsl_are_calibrated_and_its_driver_is_emulated(ros, where):
    ros.start(["roslaunch", "rpbi_examples", "nsl.launch", "headless:=true", "emulator:=true", "real_time_factor:=0"])
    calibrated = ros.listen("/rpbi/kuka_lwr/lwr_arm_7_joint/ft_sensor/calibrated", WrenchStamped)
    force = calibrated.wait_for(20)[-1].wrench.force
    assert np.abs([force.x, force.y, force.z]).max() < 0.5, "the weight of the tool is taken off"
    wait_until(lambda: where("rpbi/world", "goal_box") is not None, "the goal is in TF")
    assert where("rpbi/world", "goal_box") == pytest.approx((-1.0, 0.0, 0.15))
    wait_until(lambda: where("touch_x_base", "touch_x_ee") is not None, "the handle is in TF")
    rospy.wait_for_service("/learn_dmp_from_demo", timeout=60.0)


IK = """
  <node pkg="ros_pybullet_interface" type="ros_pybullet_interface_node.py" name="ros_pybullet_interface_node">
    <param name="config_file" type="str" value="{world}"/>
  </node>
  <node pkg="ik_ros" type="ik_setup_node.py" name="ik_setup" args="kdl">
    <param name="parent_frame_id" type="str" value="rpbi/kuka_lwr/lwr_arm_0_link"/>
    <param name="child_frame_id" type="str" value="{target}"/>
    <param name="start_on_init" type="bool" value="false"/>
    <remap from="ik/setup/kdl/qinit" to="rpbi/kuka_lwr/joint_states"/>
  </node>
  <node pkg="ik_ros" type="ik_solver_node.py" name="ik_node" args="kdl">
    <param name="urdf_filename" type="string" value="{{ik_ros_examples}}/robots/kuka_lwr.urdf"/>
    <param name="tip_link" type="string" value="{tip}"/>
    <param name="base_link" type="string" value="lwr_arm_0_link"/>
    <param name="start_on_init" type="bool" value="false"/>
    <remap from="joint_states/target" to="rpbi/kuka_lwr/joint_states/target"/>
  </node>
"""
FIGURE = """
  <node pkg="ik_ros_examples" type="figure_eight_node.py" name="figure_eight_motion">
    <param name="start_on_init" type="bool" value="false"/>
  </node>
  <node pkg="tf2_ros" type="static_transform_publisher" name="motion_base_in_world"
        args="-0.5 0 0.65 0 1.57 3.141 rpbi/world figure_eight_base"/>
  <node pkg="ik_ros_examples" type="run_example.py" name="start" args="kdl" output="screen">
    <param name="robot_name" type="str" value="kuka_lwr"/>
    <param name="eff_name" type="str" value="lwr_arm_7_link"/>
  </node>
  <include file="$(find ik_ros)/launch/tf_to_floatarray.launch">
    <arg name="child" value="figure_eight"/>
    <arg name="mode" value="pos"/>
  </include>
"""
TELEOP = """
  <node pkg="operator_node" type="keyboard_to_joy.py" name="keyboard_to_joy">
    <rosparam param="config" file="$(find operator_node)/configs/keyboard/keyboard_to_joy.yaml"/>
  </node>
  <node pkg="operator_node" type="isometric_node.py" name="keyboard_scale">
    <rosparam param="config">{axes_idx: [1, 0, 2], scale: 0.4}</rosparam>
    <param name="start_on_init" type="bool" value="false"/>
  </node>
  <node pkg="tf2_ros" type="static_transform_publisher" name="teleop_origin_broadcaster"
        args="-0.536 0.023 0.151 0 0 3.14159 rpbi/world teleop_origin"/>
  <node pkg="teleop" type="teleop_tf_node.py" name="teleop_tf">
    <rosparam param="config">{target_frame_id: teleop_target, parent_frame_id: teleop_origin, xlim: [-0.1, 0.1],
      ylim: [-0.1, 0.1], zlim: [-0.1, 0.1]}</rosparam>
    <param name="start_on_init" type="bool" value="false"/>
  </node>
  <node pkg="rpbi_examples" type="run_teleop.py" name="run" output="screen">
    <param name="ik" value="kdl"/>
  </node>
"""
HUMAN = """
  <node pkg="operator_node" type="touch_emulator.py" name="touch_emulator">
    <param name="driver" value="pose"/>
    <param name="name" value="Left"/>
    <param name="depth" value="0.03"/>
  </node>
  <node pkg="tf2_ros" type="static_transform_publisher" name="teleop_origin_broadcaster"
        args="-0.5378 -0.0014 0.2435 0 0 3.14159 rpbi/world teleop_origin"/>
  <node pkg="tf2_ros" type="static_transform_publisher" name="box_tf_br" args="-0.5378 0 0.06 0 0 0 rpbi/world box"/>
  <node pkg="ros_pybullet_interface" type="ros_pybullet_interface_node.py" name="ros_pybullet_interface_node">
    <param name="config_file" type="str" value="{world}"/>
  </node>
  <node pkg="ik_ros" type="ik_setup_node.py" name="ik_setup" args="pybullet">
    <rosparam param="config">{robot_name: kuka_lwr, link_name: end_effector_sponge, parent_frame_id: rpbi/world,
      child_frame_id: teleop_target}</rosparam>
    <param name="start_on_init" type="bool" value="true"/>
    <remap from="ik/setup/pybullet/currentPosition" to="rpbi/kuka_lwr/joint_states"/>
    <remap from="ik" to="rpbi/kuka_lwr/ik"/>
  </node>
  <node pkg="rpbi_examples" type="run_human_interaction.py" name="run" output="screen"/>
"""


def start(ros: RosSystem, folder: Path, body: str, **world: object) -> None:
    """Launches a world of the release's form, and what a launch file has beside."""
    home = dict(zip((f"lwr_arm_{i}_joint" for i in range(7)), (0.0, 30.0, 0.0, -90.0, 0.0, 60.0, 0.0)))
    arm = {
        "name": "kuka_lwr",
        "loadURDF": {"fileName": "{ik_ros_examples}/robots/kuka_lwr.urdf", "useFixedBase": 1},
        "setJointMotorControlArray": {"controlMode": "POSITION_CONTROL"},
        "initial_joint_position": home,
        "broadcast_link_states": True,
        "start_ik_callback": True,
        "enabled_joint_force_torque_sensors": ["force_torque_sensor_mount"],
    }
    file = write_world(folder, robots=(arm,), timeStep=0.01, **world)
    (folder / "release.launch").write_text(f"<launch>{body.replace('{world}', file)}</launch>")
    ros.start(["roslaunch", str(folder / "release.launch")])


@pytest.mark.thorough
def test_run_example_has_the_arm_track_the_figure(ros, where, tmp_path):
    start(ros, tmp_path, IK.format(world="{world}", target="figure_eight", tip="lwr_arm_7_link") + FIGURE)
    numbers = ros.listen("/transform", Float64MultiArray)
    places: list[np.ndarray] = []

    def tracks() -> bool:
        target, off = where("figure_eight_base", "figure_eight"), where("figure_eight", "rpbi/kuka_lwr/lwr_arm_7_link")
        if target is None or off is None or np.linalg.norm(target) < 1e-6:
            return False
        if np.linalg.norm(off) < 0.03:
            places.append(target)
        return len(places) > 3 and float(np.ptp(np.array(places), axis=0).max()) > 0.05

    wait_until(tracks, "the tip follows the figure", 120.0)
    assert len(numbers.wait_for(1)[-1].data) == 3


@pytest.mark.thorough
def test_run_teleop_moves_the_arm_by_keys(ros, where, tmp_path):
    start(ros, tmp_path, IK.format(world="{world}", target="teleop_target", tip="end_effector_ball") + TELEOP)
    with publishing("/keyboard/keydown", Key) as down, publishing("/keyboard/keyup", Key) as up:
        wait_until(lambda: where("teleop_origin", TIP) is not None, "TF is there", 120.0)

        def press(code: int) -> None:
            down.publish(Key(code=code))
            up.publish(Key(code=code))

        def distance() -> float:
            return float(np.linalg.norm(where("teleop_origin", TIP)))

        def is_at_origin() -> bool:
            """Presses the key again until the program listens."""
            if distance() > 0.01:
                press(Key.KEY_1)
            return distance() < 0.01

        wait_until(is_at_origin, "the tip is at the origin", 120.0, every_s=4.0)
        press(Key.KEY_2)
        wait_until(lambda: where("teleop_origin", "teleop_target") is not None, "teleoperation is on", 60.0)
        down.publish(Key(code=Key.KEY_UP))
        wait_until(lambda: distance() > 0.05, "the tip moves", 60.0)
        up.publish(Key(code=Key.KEY_UP))


@pytest.mark.thorough
def test_run_human_interaction_moves_the_arm_and_renders_its_force(ros, where, tmp_path):
    soft = {"contactStiffness": 2000.0, "contactDamping": 50.0, "lateralFriction": 1.0}
    table = box(name="box", changeDynamics=soft, object_tf={"tf_id": "box", "hz": 30})
    table = {key: value for key, value in table.items() if not key.startswith("base")}
    for shape in ("createVisualShape", "createCollisionShape"):
        table[shape] = {"shapeType": "GEOM_BOX", "halfExtents": [0.1, 0.1, 0.06]}
    poses, sent = ros.listen("/Left/Pose", PoseStamped), ros.listen("/Left/force_feedback", OmniFeedback)
    felt, reading = ros.listen("/Left/felt", Vector3), ros.listen("/ft_reading", Float64)
    start(ros, tmp_path, HUMAN, collision=(table,))
    wait_until(lambda: where("teleop_origin", "teleop_target") is not None, "the handle moves a frame", 120.0)
    heights: list[float] = []

    def pressed() -> bool:
        tip = where("rpbi/world", TIP)
        if tip is not None:
            heights.append(tip[2])
        return (
            bool(heights) and np.ptp(heights) > 0.03 and max((each.z for each in list(felt.messages)), default=0) > 0.3
        )

    wait_until(pressed, "the arm goes down, and the hand feels a force upwards", 120.0)
    assert min(each.pose.position.z for each in poses.messages) < -0.01, "in metres"
    strongest = max(list(sent.messages), key=lambda each: each.force.y)
    assert strongest.force.y > 0.3 and abs(strongest.force.x) + abs(strongest.force.z) < 1e-9, "y is up"
    assert reading.messages
