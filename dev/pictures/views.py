"""Pictures of RViz: a hand that pushes a box along a path, and a real robot that follows a simulated one."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import rospy
from files import write_png
from labels import label, with_legend
from plots import empty_figure, save, show
from rviz_view import rviz_camera
from screen import PATIENCE_S, Stage, call, next_message, wait_until
from sensor_msgs.msg import JointState

from custom_ros_tools.plot_style import BLUE, ORANGE
from ros_pybullet_interface.srv import ResetJointState
from rpbi_mpc.msg import MpcStatus

States: TypeAlias = "dict[str, Any]"
"""Stamps [s] and positions of a joint [rad], rows of an array or list, indexed by topic."""

RVIZ = Path(__file__).resolve().parents[2] / "src/rpbi_examples/rviz"
PUSHED_CYCLES = 75
"""Cycles of the controller before the picture, so that the box is in the first bend of the S."""
PUSHING_VIEW = {"Distance": 0.52, "Focal_Point": {"X": 0.30, "Y": -0.2, "Z": 0.79}, "Pitch": 0.85, "Yaw": 0.6}
PUSHING_LEGEND = (
    ("#33b24c", "path of the box, and reference"),
    ("#198ce6", "predicted path and outlines of the box"),
    ("#ed8824", "measured outline of the box"),
)
REAL_SIZE_PX = (720, 480)
FOCUS, DISTANCE_M, PITCH_RAD, YAW_RAD = (0.27, 0.22, 0.31), 1.45, 0.25, 5.5
REAL_DISPLAYS = {
    "TF": None,
    "Guard of the real robot": None,
    "World": {"Namespaces": {"kuka_lwr": False, "floor": False}},
}
BASES = {"simulated arm: the target": (0.4, 0.0, -0.14), "stand-in for the real robot": (0.4, 0.9, -0.1)}
"""Points below the bases of both arms, in the world [m]."""
JOINT, GOAL_RAD, MOVE_S, MOVES = "lwr_arm_0_joint", 0.8, 2.0, 4
"""The move of the simulated arm that the real one follows, and how often."""
REST_S, SETTLED_S = 1.0, 5.0
"""Time between two moves, and time in which RViz shows the robots, whose measurements have noise [s]."""
TARGETS, MEASURED = "/rpbi/kuka_lwr/joint_states", "/rpbi/real/joint_states/target"


def draw_pushing_mpc(path: Path) -> None:
    """Takes a picture of RViz while a hand pushes a box along a path."""
    with tempfile.TemporaryDirectory(prefix="rpbi-") as folder, Stage(1120, 620) as stage:
        stage.launch("pushing_mpc.launch", "start_on_init:=false", f"out:={folder}")
        stage.rviz(RVIZ / "pushing_mpc.rviz", **PUSHING_VIEW)
        call("mpc/start")
        next_message("mpc/status", MpcStatus, lambda status: status.cycle >= PUSHED_CYCLES)
        call("mpc/stop")
        picture = stage.still_picture()
    write_png(path, with_legend(picture, PUSHING_LEGEND))


def draw_real_robot(path: Path) -> None:
    """Takes a picture of RViz with a stand-in that follows an arm, and draws a joint of both over time."""
    with Stage(*REAL_SIZE_PX) as stage:
        stage.launch("run_kuka.launch", "real_robot:=true", "headless:=true")
        moves = _moves()
        focus = dict(zip("XYZ", FOCUS))
        config = RVIZ / "run_kuka.rviz"
        stage.rviz(config, REAL_DISPLAYS, Focal_Point=focus, Distance=DISTANCE_M, Pitch=PITCH_RAD, Yaw=YAW_RAD)
        rospy.sleep(SETTLED_S)
        picture = stage.picture()
    camera = rviz_camera(FOCUS, DISTANCE_M, PITCH_RAD, YAW_RAD, REAL_SIZE_PX)
    for text, base in BASES.items():
        label(picture, text, camera.pixel(base))
    figure = empty_figure((10.6, 4.4))
    left, right = figure.subfigures(1, 2, width_ratios=(1.5, 1.0))
    show(left.subplots(), picture)
    _draw_lag(right.subplots(), min(moves, key=_lag_s))
    save(figure, path, has_photographs=True)


def _moves() -> list[States]:
    """Moves the simulated arm several times to its goal, and returns the states of each move.

    Other programs delay messages, so that the real robot lags by different times.
    """
    states: States = {TARGETS: [], MEASURED: []}
    for topic in (TARGETS, MEASURED):
        rospy.Subscriber(topic, JointState, lambda message, topic=topic: states[topic].append(_joint(message)))
    service = "rpbi/kuka_lwr/move_to_joint_state"
    rospy.wait_for_service(service, PATIENCE_S)
    move = rospy.ServiceProxy(service, ResetJointState)
    moves = []
    for _ in range(MOVES):
        for goal_rad in (0.0, GOAL_RAD):
            states.update({TARGETS: [], MEASURED: []})
            wait_until(lambda: all(states.values()), "both arms publish their joint states")
            began_s = rospy.Time.now().to_sec()
            move(joint_state=JointState(name=[JOINT], position=[goal_rad]), duration=MOVE_S)
            rospy.sleep(REST_S)
        moves.append({topic: np.array(found) - (began_s, 0.0) for topic, found in states.items()})
    return moves


def _joint(message: JointState) -> tuple[float, float]:
    """Returns stamp [s] and position [rad] of the joint that moves."""
    return message.header.stamp.to_sec(), message.position[message.name.index(JOINT)]


def _half_times_s(states: States) -> tuple[float, float]:
    """Returns the times at which target and real robot have done half of the move [s]."""
    target, measured = (
        float(times_s[np.argmax(position > GOAL_RAD / 2.0)])
        for times_s, position in (np.transpose(states[topic]) for topic in (TARGETS, MEASURED))
    )
    return target, measured


def _lag_s(states: States) -> float:
    target_s, measured_s = _half_times_s(states)
    return measured_s - target_s


def _draw_lag(axes: Any, states: States) -> None:
    axes.plot(*np.transpose(states[TARGETS]), color=ORANGE, label="simulated arm: the target")
    axes.plot(*np.transpose(states[MEASURED]), color=BLUE, label="stand-in, as measured")
    half, (target_s, measured_s) = GOAL_RAD / 2.0, _half_times_s(states)
    axes.annotate("", (measured_s, half), (target_s, half), arrowprops={"arrowstyle": "<->"})
    axes.annotate(f"{_lag_s(states):.2f} s later", (measured_s, half), (8, -3), textcoords="offset points")
    axes.set(xlabel="time since the move began [s]", ylabel=f"{JOINT} [rad]", xlim=(-0.1, MOVE_S + 0.6))
    axes.legend(loc="upper center", bbox_to_anchor=(0.45, -0.17))
