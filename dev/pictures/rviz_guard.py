"""Picture of RViz with the guard: an arm that was driven down at a table, and the distance at which it was halted."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import numpy as np
import rospy
import yaml
from files import write_png
from labels import label
from live import Frames, Newest, Orbit
from rviz_people import EXAMPLES, RVIZ, TIP
from screen import Stage, wait_until
from sensor_msgs.msg import JointState

from safe_robot.msg import Status

GUARD = {
    "base_frame": "rpbi/kuka_lwr/base",
    "left_out": ["kuka_lwr", "floor"],
    "period_s": 0.018,
    "silence_s": 1.0,
    "limits": {"acceleration": 10.0, "jerk": 1000.0},
    "checks": {"environment": {"margin_m": 0.1, "timeout_s": 5.0}, "staleness": {"timeout_s": 5.0}},
}
"""Parameters of the guard; its times allow for a busy machine."""
SPEED, PERIOD_S, FARTHEST_RAD = 0.05, 0.02, 0.5
"""Speed of the joint that moves the arm down at the table [rad/s], time between two targets, and its longest motion."""


def guard_rviz(path: Path) -> None:
    """Draws the distances of an arm that was driven down at a table until the guard halted it."""
    with Stage(900, 600) as stage, tempfile.TemporaryDirectory() as folder:
        world = Path(folder) / "world.yaml"
        world.write_text(yaml.safe_dump(table_world(Path(folder))), encoding="utf-8")
        stage.launch("world.launch", f"config:={world}", "use_sim_time:=false")
        frames, measured = Frames(), Newest("rpbi/kuka_lwr/joint_states", JointState)
        wait_until(lambda: measured.message, "the arm is there")
        rospy.set_param("robot_description", (EXAMPLES / "robots/kuka_lwr.urdf").read_text(encoding="utf-8"))
        rospy.set_param("guard", GUARD)
        states = "rpbi/kuka_lwr/joint_states"
        remaps = f"joint_states/command:={states}/target", f"joint_states/measured:={states}"
        stage.start(["rosrun", "safe_robot", "safe_robot_node.py", "__name:=guard", *remaps])
        status, targets = Newest("robot_safety/status", Status), rospy.Publisher("joint_states/target", JointState)
        view = Orbit(0.95, (0.1, 0.0, 0.25), 0.55, 5.2)
        shown = {"TF": None, "Guard": {"Namespaces": {"self_collision": False}}}
        stage.rviz(RVIZ / "kuka_lwr_ik_example.rviz", shown, **view.properties)
        names, start = measured.message.name, np.array(measured.message.position)
        downwards, moved = np.array([name == "lwr_arm_1_joint" for name in names]), 0.0

        def send() -> bool:
            """Sends a target, and returns whether the newest one was safe."""
            message = JointState(name=names, position=(start + moved * downwards).tolist())
            message.header.stamp = rospy.Time.now()
            targets.publish(message)
            time.sleep(PERIOD_S)
            return status.message is not None and status.message.is_safe

        wait_until(send, "the guard takes targets")
        while send() and moved < FARTHEST_RAD:
            moved += SPEED * PERIOD_S
        stage.stop_world()
        scene, tip = stage.still_picture(), frames.wait_for(TIP)
    label(
        scene, "the guard halted the arm 100 mm above the table", (235, 568), view.pixel(tip - (0.0, 0.0, 0.09), scene)
    )
    write_png(path, scene)


def table_world(folder: Path) -> dict[str, object]:
    """Returns the main file of a world with an arm over a table; writes the table's file."""
    size = {"shapeType": "GEOM_BOX", "halfExtents": [0.2, 0.14, 0.01]}
    table = {
        "name": "table",
        "createVisualShape": {**size, "rgbaColor": [0.95, 0.92, 0.85, 1.0]},
        "createCollisionShape": size,
        "basePosition": [-0.05, 0.0, 0.01],
    }
    (folder / "table.yaml").write_text(yaml.safe_dump(table), encoding="utf-8")
    return {
        "setGravity": {"gravZ": -9.81},
        "timeStep": 0.002,
        "poses": [{"tf_id": "rpbi/floor"}],
        "collision_objects": ["{rpbi_examples}/configs/floor.yaml", str(folder / "table.yaml")],
        "robots": ["{rpbi_examples}/configs/basic_example_kuka_lwr/kuka_lwr.yaml"],
    }
