"""The nodes of ik_ros, as tests start them."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import rospy
from geometry_msgs.msg import Point, Pose, Quaternion, TransformStamped
from ros_system import wait_until
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage

from ik_ros.msg import IKProblem
from rpbi.kinematics import Kinematics

ARM = str(Path(__file__).resolve().parents[3] / "src/rpbi_examples/robots/kuka_lwr.urdf")
TIP = "end_effector_ball"
CHAIN = {"urdf_filename": ARM, "base_link": "lwr_arm_0_link", "tip_link": TIP}
JOINTS = [f"lwr_arm_{number}_joint" for number in range(7)]
BENT = (0.3, 0.6, 0.2, -1.2, 0.1, 0.8, 0.4)
FAR = Pose(Point(5.0, 0.0, 0.5), Quaternion(0.0, 0.0, 0.0, 1.0))
"""Out of reach."""
HOME = (0.0, 0.52, 0.0, -1.57, 0.0, 1.05, 0.0)


def start_node(ros: Any, executable: str, solver: str, services: str, **parameters: Any) -> Any:
    """Starts one of the nodes under the name of its executable and waits until it is up."""
    name = executable.removesuffix(".py")
    rospy.set_param(f"/{name}", parameters)
    process = ros.start(["rosrun", "ik_ros", executable, solver, f"__name:={name}"])
    rospy.wait_for_service(services, timeout=60.0)
    return process


def start_solver(ros: Any, solver: str = "kdl", start_on_init: bool = True, **parameters: Any) -> Any:
    """Starts `ik_solver_node.py` for the arm."""
    given = {**CHAIN, "start_on_init": start_on_init, **parameters}
    return start_node(ros, "ik_solver_node.py", solver, f"ik/solver/{solver}/solve", **given)


def start_setup(ros: Any, solver: str = "kdl", start_on_init: bool = True, **parameters: Any) -> Any:
    """Starts `ik_setup_node.py`, which does not wait for a start unless parameters say so."""
    given = {"start_on_init": start_on_init, "wait_for_start": False, **parameters}
    return start_node(ros, "ik_setup_node.py", solver, f"ik/setup/{solver}/toggle", **given)


def forward(positions: Any) -> Pose:
    """Returns where the tip is."""
    kinematics = Kinematics(ARM)
    (x, y, z), quat_xyzw = kinematics.forward(positions, TIP)
    kinematics.close()
    return Pose(Point(x, y, z), Quaternion(*quat_xyzw))


def problem(positions: Any = HOME, **fields: Any) -> IKProblem:
    """Returns the problem whose solution may be these positions."""
    return IKProblem(has_target=True, target=forward(positions), **fields)


def start_at(positions: Any) -> JointState:
    """Returns where a search starts."""
    return JointState(name=JOINTS, position=positions)


_stamps = itertools.count(1000)


def send_until(publisher: rospy.Publisher, message: Any, listener: Any, count: int = 1) -> Any:
    """Publishes a problem until so many answers to it have come; returns the first of them.

    Answers have the stamp of their problem, by which those to problems of an earlier test are told apart; a problem
    without one is given its own.
    """
    message.header.stamp = message.header.stamp or rospy.Time(next(_stamps))
    wait_until(lambda: publisher.publish(message) or len(answers(listener, message)) >= count, "an answer to it comes")
    return answers(listener, message)[0]


def answers(listener: Any, message: Any) -> list[Any]:
    """Returns what has come in answer to a problem."""
    return [each for each in list(listener.messages) if each.header.stamp == message.header.stamp]


@contextlib.contextmanager
def static_transform(parent: str, child: str, pose: Pose) -> Iterator[None]:
    """Broadcasts a fixed transform, and takes it back at the end: it would stay for all later tests."""
    publisher = rospy.Publisher("/tf_static", TFMessage, latch=True, queue_size=1)
    publisher.publish(TFMessage([transform(parent, child, pose, rospy.Time(0))]))
    try:
        yield
    finally:
        publisher.unregister()


def transform(parent: str, child: str, pose: Pose, stamp: rospy.Time) -> TransformStamped:
    """Returns a transform."""
    message = TransformStamped(child_frame_id=child)
    message.header.frame_id, message.header.stamp = parent, stamp
    p = pose.position
    message.transform.translation.x, message.transform.translation.y, message.transform.translation.z = p.x, p.y, p.z
    message.transform.rotation = pose.orientation
    return message
