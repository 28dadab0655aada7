"""Picture of a plan in RViz: a Panda with a box in its fingers, between two bookcases."""

from __future__ import annotations

import copy
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import rospy
from files import write_png
from geometry_msgs.msg import Point, Quaternion
from geometry_msgs.msg import Pose as PoseMessage
from labels import label, with_legend
from rviz_worlds import RVIZ, WORLD, View
from screen import Latest, Stage, wait_until
from sensor_msgs.msg import JointState
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from custom_ros_tools.ros.tf_interface import TfInterface
from robot_model.geometry import Pose
from rpbi_examples.ros.planning_example import FINGER, FINGERS_S, motion_request
from rpbi_examples.shelving import LEFT, RIGHT, carry
from rpbi_planning.srv import PlanAndMove, PlanMotion

BOX = "box_3"
FINGERTIPS_M = 0.105
"""Distance of the point between the fingertips from the hand's frame [m]."""
SHARES, GHOST, GOAL = (0.36, 0.64), ColorRGBA(0.15, 0.45, 0.85, 0.4), ColorRGBA(0.18, 0.62, 0.32, 0.5)
"""Places of the drawn postures on the path, and the colours of postures and goal."""
UPPER_ARM = re.compile(r"link[0-4]\.")
"""Meshes of the links that the postures leave out, so that they do not hide each other."""


def planning(path: Path) -> None:
    """A plan that carries a box from one bookcase into the other: its path, postures along it, and the goal."""
    view = View((0.2, 0.0, 0.48), 1.85, 0.4, 0.08)
    shown = {
        "Goal": None,
        "Ghost": None,
        "Postures": {"Class": "rviz/MarkerArray", "Marker Topic": "/pictures/postures"},
        "Plan": {"Namespaces": {"goal": False}},
        "World": {"Namespaces": {"panda": False, LEFT.name: False, RIGHT.name: False}},
    }
    with Stage(1280, 760) as stage:
        stage.launch("planning_example.launch", "move:=false")
        publisher = rospy.Publisher("/pictures/postures", MarkerArray, queue_size=1, latch=True)
        fingers = rospy.Publisher("rpbi/panda/joint_states/target", JointState, queue_size=1, latch=True)
        tf, bodies, plan = TfInterface(), Latest("rpbi/markers", MarkerArray), Latest("planner/markers", MarkerArray)
        moments: list[list[Marker]] = []
        rospy.wait_for_service("planner/plan_and_move")
        move = rospy.ServiceProxy("planner/plan_and_move", PlanAndMove)
        box, _ = wait_until(lambda: (at := tf.get_tf(WORLD, f"rpbi/{BOX}"))[0] is not None and at, "the box is there")
        *steps, transport = carry(tuple(map(float, box)), LEFT, RIGHT)[:6]
        for step in steps:
            if step.finger is None:
                wait_until(lambda step=step: move(motion_request(BOX, step, 1)).success, "the hand moves")
            else:
                fingers.publish(JointState(name=[FINGER], position=[step.finger]))
                rospy.sleep(FINGERS_S)
        stage.rviz(RVIZ / "planning_example.rviz", shown, **view.of_rviz)
        rospy.Subscriber("planner/ghost", MarkerArray, lambda each: moments.append(each.markers), queue_size=100)
        trajectory = rospy.ServiceProxy("planner/plan", PlanMotion)(motion_request(BOX, transport, 1)).trajectory
        rospy.sleep(trajectory.points[-1].time_from_start.to_sec() + 4.0)
        stage.stop_world()
        line = next(each.points for each in plan.message.markers if each.ns == "path")
        goal = [each for each in plan.message.markers if each.ns == "goal"]
        start = nearest(moments, line[0])
        held = hand_of(start).inverse() @ Pose(*tf.get_tf(WORLD, f"rpbi/{BOX}"))
        postures = [nearest(moments, line[round(share * (len(line) - 1))]) for share in SHARES]
        body = next(each for each in bodies.message.markers if each.ns == BOX)
        markers = [
            *(each for posture in postures for each in posture if not UPPER_ARM.search(each.mesh_resource)),
            *(coloured(each, GOAL) for each in goal if not UPPER_ARM.search(each.mesh_resource)),
            *(coloured(placed(body, hand_of(posture) @ held), GHOST) for posture in postures),
            coloured(placed(body, hand_of(goal) @ held), GOAL),
            *(faded(each) for each in bodies.message.markers if each.ns in (LEFT.name, RIGHT.name)),
        ]
        publisher.publish(MarkerArray(numbered(markers)))
        picture = stage.still_picture()
    camera = view.camera(picture.size)
    for text, at, offset in (
        ("box in the fingers", (hand_of(start) @ held).position, (60, -130)),
        ("goal of the box", (hand_of(goal) @ held).position, (-60, -130)),
    ):
        column, row = camera.pixel(at)
        label(picture, text, (column + offset[0], row + offset[1]), (column, row))
    lines = (("#2673d9", "path of the box, and postures of the hand along it"), ("#2e9e52", "posture at the goal"))
    write_png(path, with_legend(picture, lines))


def hand_of(posture: Iterable[Marker]) -> Pose:
    """Returns the pose of the hand in the world."""
    return pose_of(next(each.pose for each in posture if "hand" in each.mesh_resource))


def nearest(postures: list[list[Marker]], place: Point) -> list[Marker]:
    """Returns the posture whose fingertips are nearest to a place."""

    def distance_m(posture: list[Marker]) -> float:
        tip = (hand_of(posture) @ Pose((0.0, 0.0, FINGERTIPS_M))).position
        return float(np.linalg.norm(np.subtract(tip, (place.x, place.y, place.z))))

    return min(postures, key=distance_m)


def pose_of(message: PoseMessage) -> Pose:
    """Converts a message to a pose."""
    at, turned = message.position, message.orientation
    return Pose((at.x, at.y, at.z), (turned.x, turned.y, turned.z, turned.w))


def placed(body: Marker, pose: Pose) -> Marker:
    """Returns the marker of a body with one shape, at a pose of the body in the world."""
    whole = pose @ pose_of(body.pose)
    return changed(body, pose=PoseMessage(Point(*whole.position), Quaternion(*whole.quat_xyzw)), frame=WORLD)


def coloured(marker: Marker, colour: ColorRGBA) -> Marker:
    """Returns a marker in another colour."""
    return changed(marker, color=colour)


def faded(marker: Marker) -> Marker:
    """Returns a marker that hides little."""
    colour = marker.color
    return changed(marker, color=ColorRGBA(colour.r, colour.g, colour.b, 0.25))


def changed(marker: Marker, frame: str = "", **values: Any) -> Marker:
    """Returns a copy of a marker with other values, and in another frame if `frame` is not empty."""
    other = copy.deepcopy(marker)
    other.header.frame_id = frame or other.header.frame_id
    for name, value in values.items():
        setattr(other, name, value)
    return other


def numbered(markers: Iterable[Marker]) -> list[Marker]:
    """Returns copies of markers in one namespace, each with its own id."""
    return [changed(each, ns="postures", id=number) for number, each in enumerate(markers)]
