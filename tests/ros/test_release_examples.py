"""The launch files of the release's examples: worlds of their form load and run, and nodes have their names.

The files themselves are not here; worlds and launch files are written as theirs are, old spellings included.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pybullet
import pytest
import roslib.packages
from nextage_like import nextage_like
from ros_system import wait_until
from std_srvs.srv import SetBool
from tf2_msgs.msg import TFMessage
from worlds import box, write_world

from rpbi.bodies.robots.robot import Robot
from rpbi.geometry import Pose
from rpbi.kinematics import IKProblem
from rpbi.samples import WrenchSample
from rpbi.world import World

PAGE = Path(__file__).resolve().parents[2] / "docs/from_the_release.md"
HOME_DEG = dict(zip((f"lwr_arm_{i}_joint" for i in range(7)), (0.0, 30.0, 0.0, -90.0, 0.0, 60.0, 0.0)))


def robot(name: str, file: str, **more: Any) -> dict[str, Any]:
    return {
        "name": name,
        "loadURDF": {"fileName": file, "useFixedBase": 1, "basePosition": [0.5, 0.0, 0.0]},
        "is_visual_robot": False,
        "setJointMotorControlArray": {"controlMode": "POSITION_CONTROL"},
        "publish_joint_state_frequency": 30,
        "broadcast_link_states": True,
        "brodcast_link_states_frequency": 30,
        **more,
    }


def kuka(model: str = "kuka_lwr", **more: Any) -> dict[str, Any]:
    load = {"fileName": f"{{ik_ros_examples}}/robots/{model}.urdf", "useFixedBase": 1}
    return robot("kuka_lwr", "", loadURDF=load, initial_joint_position=HOME_DEG, **more)


def seen(name: str, shape: str, **more: Any) -> dict[str, Any]:
    sizes: dict[str, Any] = {"GEOM_SPHERE": {"radius": 0.2}, "GEOM_BOX": {"halfExtents": [0.3, 0.2, 0.025]}}
    rgba = {"rgbaColor": [0.0, 1.0, 1.0, 0.6]}
    return {"name": name, "createVisualShape": {"shapeType": shape, **sizes[shape], **rgba}, **more}


def following(frame: str) -> dict[str, Any]:
    return {"object_tf": {"tf_id": frame, "hz": 30}}


PLANE = {"shapeType": "GEOM_PLANE", "planeNormal": [0, 0, 1]}
CONTACT = {"lateralFriction": 1.0, "restitution": 0.0, "contactStiffness": 2000.0, "contactDamping": 0.7}
FLOOR = {
    "name": "floor",
    "createVisualShape": PLANE,
    "createCollisionShape": PLANE,
    "changeDynamics": CONTACT,
    **following("rpbi/floor"),
}
BOX = box(basePosition=[-0.6, 0.0, 0.3], changeDynamics=CONTACT)
SOFT_BOX = {**{key: value for key, value in BOX.items() if not key.startswith("base")}, **following("box")}
CAMERA = {
    "name": "rgbd_sensor",
    "hz": 30,
    "intrinsics": {"width": 640, "height": 480, "fov": 40, "range": [0.01, 10000]},
    "object_tf": {"tf_id": "rpbi/camera"},
}
CUP = """<robot name="cup"><link name="baseLink"><visual><geometry><mesh filename="cup.obj" scale="0.05 0.05 0.05"/>
</geometry></visual></link></robot>"""
TORUS = {
    "fileName": "{rpbi_examples}/configs/meshes/torus.obj",
    "simFileName": "{rpbi_examples}/configs/meshes/torus.vtk",
    "basePosition": [0, 0, 2],
    "mass": 3,
    "useNeoHookean": 1,
    "NeoHookeanMu": 180,
    "NeoHookeanLambda": 600,
    "NeoHookeanDamping": 0.01,
    "collisionMargin": 0.006,
    "useSelfCollision": 1,
    "frictionCoeff": 0.5,
    "repulsionStiffness": 800,
}


def pose(folder: Path) -> dict[str, Any]:
    (folder / "cup.urdf").write_text(CUP)
    shutil.copy(Path(pybullet.__file__).parent / "pybullet_data/cube.obj", folder / "cup.obj")
    load = {"fileName": str(folder / "cup.urdf"), "useMaximalCoordinates": True, "useFixedBase": 1}
    return {
        "robots": (foreign(folder),),
        "visual": (seen("table", "GEOM_BOX", **following("rpbi/table")),),
        "urdfs": ({"name": "cup", "loadURDF": load},),
    }


def foreign(folder: Path) -> dict[str, Any]:
    """Returns a robot whose description comes from a package that is not here."""
    return robot("nextage", nextage_like(folder)[0])


def soft_body(_: Path) -> dict[str, Any]:
    cube = {"fileName": "cube.urdf", "basePosition": [0, 1, 2], "useMaximalCoordinates": True}
    return {
        "resetSimulation": {"flags": "RESET_USE_DEFORMABLE_WORLD"},
        "setPhysicsEngineParameter": {"sparseSdfVoxelSize": 0.25},
        "setAdditionalSearchPath": "pybullet_data_path",
        "step_pybullet_manually": True,
        "collision": (),
        "urdfs": (
            {"name": "plane", "loadURDF": {"fileName": "plane.urdf", "basePosition": [0, 0, 1]}},
            {"name": "cube", "loadURDF": cube},
        ),
        "soft": ({"name": "torus", "loadSoftBody": TORUS},),
    }


ANCHORED = {"object_tf": {"offset": [0.5, 0.0, 0.0]}, "self.broadcast_link_states_hz": 50}
WORLDS: dict[str, Callable[[Path], dict[str, Any]]] = {
    "basic_example_kuka_lwr": lambda _: {
        "connect": {"connection_mode": "GUI", "options": "--mp4=$HOME/basic_example_kuka_lwr.mp4"},
        "robots": (robot("kuka_lwr", "{rpbi_examples}/robots/kuka_lwr.urdf", initial_joint_position=HOME_DEG),),
        "rgbd_sensor": CAMERA,
    },
    "basic_example_human_model run_pose_human_model": lambda _: {
        "robots": (robot("human", "{rpbi_examples}/robots/human_model.urdf"),)
    },
    "basic_example_talos run_pose_talos basic_example_kinova basic_example_nextage": lambda folder: {
        "robots": (foreign(folder),),
        "visual": (seen("table", "GEOM_BOX", **following("rpbi/table")),),
        "rgbd_sensor": CAMERA,
    },
    "run_pose_kinova": pose,
    "run_pose_kuka_lwr": lambda _: {
        "robots": (kuka(),),
        "collision": (),
        "visual": (seen("whiteboard", "GEOM_BOX", **following("rpbi/whiteboard")),),
    },
    "pybullet_objects_example pybullet_rgbd_example": lambda _: {
        "visual": (seen("visual_sphere", "GEOM_SPHERE", **following("figure_eight")),),
        "dynamic": ({**BOX, "resetBaseVelocity": {"linearVelocity": [0.0, 0, 1.5]}},),
        "rgbd_sensor": CAMERA,
    },
    "soft_body": soft_body,
    "interpolation": lambda _: {
        "robots": (kuka(),),
        "visual": tuple(seen(f"wpt{i}", "GEOM_SPHERE", **following(f"rpbi/visual_wpt{i}")) for i in (1, 2, 3)),
    },
    "teleop optas_kuka_lwr_expr optas_kuka_lwr_expr2": lambda _: {"robots": (kuka(),)},
    "lfd": lambda _: {
        "robots": (kuka(),),
        "visual": (seen("goal", "GEOM_BOX", **following("rpbi/visual_goal")),),
        "dynamic": (BOX,),
    },
    "nsl nsl_haption": lambda _: {
        "robots": (
            kuka(
                move_to_initial_joint_state_on_startup=True,
                enabled_joint_force_torque_sensors=["force_torque_sensor_mount", "lwr_arm_7_joint"],
            ),
        ),
        "enable_keyboard_publisher": True,
        "visual": (seen("goal", "GEOM_BOX", **following("goal_box")),),
        "dynamic": (BOX,),
    },
    "human_interaction": lambda _: {
        "robots": (
            kuka("kuka_lwr2", start_ik_callback=True, enabled_joint_force_torque_sensors=["force_torque_sensor_mount"]),
        ),
        "collision": (FLOOR, SOFT_BOX),
    },
    "run_kuka": lambda _: {"robots": (kuka(),), "controls": {"robot_name": "kuka"}},
    "kuka_lwr_trac_ik_example kuka_lwr_exotica_example kuka_lwr_pybullet_example": lambda _: {
        "robots": (kuka(**ANCHORED),),
        "gravity": [0.0, 0.0, -9.81],
        "visual_object": ["{ik_ros_examples}/configs/kuka_lwr_trac_ik_example/sphere.yaml"],
    },
}
"""Content of the worlds of launch files beside a window and a floor."""


@pytest.mark.parametrize("launch_files", WORLDS)
def test_worlds_of_their_form_load_and_run(tmp_path, launch_files):
    parts = {"collision": (FLOOR,), "timeStep": 0.01, "connect": {"connection_mode": "GUI"}, "status_hz": 50}
    view = {"configureDebugVisualizer": {"enable": 0, "flag": "COV_ENABLE_GUI"}}
    own = WORLDS[launch_files](tmp_path)
    file = write_world(tmp_path, **{**parts, **view, **own})
    world = World.from_file(file, connection_mode=pybullet.DIRECT)
    heights = {name: body.base_pose().position[2] for name, body in world.bodies.items()}
    for _ in range(60):
        world.step()
    fallen = {name for name, body in world.bodies.items() if body.base_pose().position[2] < heights[name] - 0.1}
    robots = [body for body in world.bodies.values() if isinstance(body, Robot)]
    assert fallen == (
        {"cube", "torus"} if launch_files == "soft_body" else {each["name"] for each in own.get("dynamic", ())}
    )
    assert robots or {"torus", "visual_sphere"} & set(heights)
    assert np.isfinite([list(each.joint_positions().values()) for each in robots]).all()
    world.close()
    page = PAGE.read_text()
    assert [name for name in launch_files.split() if f"`{name}`" not in page] == []


NODES = (
    "ros_pybullet_interface/ros_pybullet_interface_node.py",
    "rpbi_utils/rpbi_controls_node.py",
    "rpbi_utils/calibrate_wrench_node.py",
    "rpbi_utils/interpolation_node.py",
    "rpbi_examples/basic_robot_example_node.py",
    "rpbi_examples/orbit_node.py",
    "rpbi_examples/pybullet_objects_example_node.py",
    "ik_ros_examples/figure_eight_node.py",
    "ik_ros/ik_setup_node.py",
    "ik_ros/ik_solver_node.py",
    "keyboard/keyboard",
    "operator_node/keyboard_to_joy.py",
    "operator_node/isometric_node.py",
    "operator_node/scale_node.py",
    "teleop/teleop_tf_node.py",
    "dmp/dmp_server",
    "safe_robot/safe_robot_node.py",
    "custom_ros_tools/remap_joint_state_to_floatarray",
    "tf/static_transform_publisher",
    "tf2_ros/static_transform_publisher",
)
"""Nodes of its launch files; clients come with them, drivers of devices are others'."""


def test_nodes_are_found_under_their_names():
    assert [node for node in NODES if not roslib.packages.find_node(*node.split("/"))] == []


LAUNCH = """<launch>
  <node pkg="ik_ros_examples" type="figure_eight_node.py" name="figure_eight"/>
  <node pkg="tf" type="static_transform_publisher" name="box_tf" args="-0.5378 0 0.06 0 0 0 rpbi/world box 10"/>
  <node pkg="operator_node" type="scale_node.py" name="scale">
    <rosparam param="config" file="$(find operator_node)/configs/keyboard/keyboard_scale.yaml"/>
    <param name="start_on_init" type="bool" value="true"/>
  </node>
  <node pkg="teleop" type="teleop_tf_node.py" name="teleop">
    <rosparam param="config" file="$(find teleop)/configs/teleop_tf_demo_config.yaml"/>
    <param name="start_on_init" type="bool" value="true"/>
  </node>
</launch>"""


def test_a_launch_file_of_their_form_starts_its_nodes(ros, tmp_path):
    (tmp_path / "release.launch").write_text(LAUNCH)
    frames = ros.listen("/tf", TFMessage)
    ros.start(["roslaunch", str(tmp_path / "release.launch")])
    expected = {("figure_eight_base", "figure_eight"), ("rpbi/world", "box"), ("tf_start", "tf_target")}

    def known() -> set[tuple[str, str]]:
        transforms = [each for message in list(frames.messages) for each in message.transforms]
        return {(each.header.frame_id, each.child_frame_id) for each in transforms}

    wait_until(lambda: known() >= expected, f"{expected} are on /tf")
    assert not ros.call("toggle_figure_eight", SetBool, True).success, "it moves from the start"
    assert not ros.call("operator_node/toggle", SetBool, True).success, "it is on from the start"


def test_the_sponge_of_human_interaction_is_felt(tmp_path):
    """Its inverse kinematics, asked for a place 2 cm below the top of the box, presses the sponge onto it."""
    file = write_world(tmp_path, timeStep=0.01, **WORLDS["human_interaction"](tmp_path))
    world = World.from_file(file)
    world.put("box/pose", Pose((-0.5378, 0.0, 0.02)))
    arm = world.bodies["kuka_lwr"]
    goal = IKProblem(
        "end_effector_sponge",
        (-0.5378, 0.0, 0.10),
        (1.0, 0.0, 0.0, 0.0),
        currentPosition=arm.joint_positions().values(),
    )
    solution = arm.kinematics.solve(goal)
    assert solution.success, solution.message
    samples = [sample for _ in range(150) for sample in world.step()]
    weight = [sample.force[2] for sample in samples if isinstance(sample, WrenchSample)][-1]
    world.put("kuka_lwr/target", dict(zip(solution.joint_names, solution.positions)))
    samples = [sample for _ in range(150) for sample in world.step()]
    pressed = [sample.force[2] for sample in samples if isinstance(sample, WrenchSample)][-1]
    assert abs(pressed - weight) > 10.0
    world.close()
