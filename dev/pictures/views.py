"""Pictures of RViz: a hand that pushes a box along a path, and a real robot that follows a simulated one."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import rospy
import yaml
from files import write_png
from plots import empty_figure, save, show
from screen import SETTLES_S, Stage, wait_until
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from ros_pybullet_interface.srv import ResetJointState
from rpbi_mpc.msg import MpcStatus

RVIZ = Path(__file__).resolve().parents[2] / "src/rpbi_examples/rviz"
PUSHED_CYCLES = 75
"""Cycles of the controller before the picture, so that the box is in the first bend of the S."""
JOINT, GOAL_RAD, MOVE_S = "lwr_arm_0_joint", 0.8, 2.0
"""The move of the simulated arm that the real one follows."""
TARGETS, MEASURED = "/rpbi/kuka_lwr/joint_states", "/rpbi/real/joint_states/target"


def draw_pushing_mpc(path: Path) -> None:
    """Takes a picture of RViz while a hand pushes a box along a path."""
    with tempfile.TemporaryDirectory(prefix="rpbi-") as folder, Stage(1120, 800) as stage:
        stage.launch("pushing_mpc.launch", "start_on_init:=false", f"out:={folder}")
        stage.rviz(RVIZ / "pushing_mpc.rviz", **{"Focal Point": {"X": 0.33, "Y": -0.2, "Z": 0.72}, "Distance": 0.75})
        cycles: list[MpcStatus] = []
        rospy.Subscriber("mpc/status", MpcStatus, cycles.append)
        rospy.ServiceProxy("mpc/start", Trigger)()
        wait_until(lambda: len(cycles) >= PUSHED_CYCLES, "the hand has pushed")
        rospy.ServiceProxy("mpc/stop", Trigger)()
        rospy.sleep(SETTLES_S)
        write_png(path, stage.picture())


def draw_real_robot(path: Path) -> None:
    """Takes a picture of RViz with a stand-in that follows an arm, and draws a joint of both over time."""
    with tempfile.TemporaryDirectory(prefix="rpbi-") as folder, Stage(700, 640) as stage:
        stage.launch("run_kuka.launch", "real_robot:=true")
        states: dict[str, list[tuple[float, float]]] = {TARGETS: [], MEASURED: []}
        for topic, found in states.items():
            rospy.Subscriber(topic, JointState, lambda message, found=found: found.append(_joint(message)))
        stage.rviz(_without_frames(RVIZ / "run_kuka.rviz", Path(folder)), Distance=2.2)
        wait_until(lambda: all(states.values()), "both arms publish their joint states")
        began_s = rospy.Time.now().to_sec()
        move = rospy.ServiceProxy("rpbi/kuka_lwr/move_to_joint_state", ResetJointState)
        move(joint_state=JointState(name=[JOINT], position=[GOAL_RAD]), duration=MOVE_S)
        rospy.sleep(SETTLES_S)
        picture = stage.picture()
    figure = empty_figure((10.6, 4.6))
    left, right = figure.subplots(1, 2, width_ratios=(1.1, 1.0))
    show(left, picture)
    _draw_lag(right, {topic: np.array(found) - (began_s, 0.0) for topic, found in states.items()})
    save(figure, path)


def _joint(message: JointState) -> tuple[float, float]:
    """Returns stamp [s] and position [rad] of the joint that moves."""
    return message.header.stamp.to_sec(), message.position[message.name.index(JOINT)]


def _draw_lag(axes: Any, states: Mapping[str, np.ndarray]) -> None:
    (target_s, target), (measured_s, measured) = (states[topic].T for topic in (TARGETS, MEASURED))
    axes.plot(target_s, target, color="#e8731a", label="simulated arm: the target")
    axes.plot(measured_s, measured, color="#22333f", label="real robot, as measured")
    half = GOAL_RAD / 2.0
    times_s = [float(times[np.argmax(values > half)]) for times, values in ((target_s, target), (measured_s, measured))]
    lag_ms = 1e3 * (times_s[1] - times_s[0])
    axes.annotate("", (times_s[1], half), (times_s[0], half), arrowprops={"arrowstyle": "<->"})
    axes.annotate(f"{lag_ms:.0f} ms later", (times_s[1], half), (8, -3), textcoords="offset points")
    axes.set(xlabel="time since the move began [s]", ylabel=f"{JOINT} [rad]", xlim=(-0.2, MOVE_S + 0.6))
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, 1.2))


def _without_frames(config: Path, folder: Path) -> Path:
    """Returns a copy of an RViz file that does not show TF frames."""
    content = yaml.safe_load(config.read_text(encoding="utf-8"))
    for display in content["Visualization Manager"]["Displays"]:
        if display["Class"] == "rviz/TF":
            display["Enabled"] = display["Value"] = False
    copy = folder / config.name
    copy.write_text(yaml.safe_dump(content), encoding="utf-8")
    return copy
