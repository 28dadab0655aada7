"""An arm draws a sleeve over that of a person who is in the world by their avatar."""

import json
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pybullet_data
import rospy
from geometry_msgs.msg import Point
from pydantic import Field
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64
from visualization_msgs.msg import Marker

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.lifecycle.parameters import private_parameters
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.tf_interface import TfInterface
from custom_ros_tools.schema import ConfigModel, Positive
from operator_node.msg import SegmentForces
from rpbi.config.asset_files import find_file
from rpbi.kinematics import Kinematics
from rpbi_examples.dressing import (
    ARM_SEGMENTS,
    ROBOT,
    TARGET_HZ,
    ArmPosition,
    Dressing,
    HandSolver,
    MeanForce,
    Outcome,
    is_held_out,
    outcome,
)

JOINTS_OF_ARM = ("RightUpperArm", "RightForeArm", "RightHand")
STILL_S = 1.0
"""For so long the person holds out the arm before the robot begins [s]."""
SEES_NOTHING_S = 1.0
"""Without news of the arm for so long, the robot waits [s]."""


class TelepresenceParameters(ConfigModel):
    """Private parameters of `telepresence_node.py`."""

    force_limit: Positive = Field(15.0, description="Force on the arm above which the cuff goes back [N].")
    speed: Positive = Field(0.1, description="Of the cuff where nothing is touched [m/s].")
    out: str = Field("", description="File that the outcome is written to, as JSON; empty: none.")


class TelepresenceNode:
    """Waits until the person holds out the right arm, then has the robot draw the sleeve over it, and says how it went.

    Raises:
        ConfigError: If a parameter is wrong.
    """

    def __init__(self) -> None:
        self._config = config = private_parameters(TelepresenceParameters)
        self._dressing, self._forces = Dressing(config.force_limit, config.speed), MeanForce()
        self._kinematics = Kinematics(find_file(ROBOT, ".", (pybullet_data.getDataPath(),)))
        self._solver = HandSolver(self._kinematics)
        self._tf, self._lock = TfInterface(), threading.Lock()
        self._force_n = 0.0
        self._positions: tuple[float, ...] | None = None
        self._corners: list[tuple[float, float, float]] = []
        self._targets = rospy.Publisher("rpbi/panda/joint_states/target", JointState, queue_size=1, tcp_nodelay=True)
        self._force_topic = rospy.Publisher("telepresence/force", Float64, queue_size=10)
        self._marker = rospy.Publisher("telepresence/marker", Marker, queue_size=10)
        rospy.Subscriber("rpbi/panda/joint_states", JointState, self._take_state, queue_size=1)
        rospy.Subscriber("rpbi/sleeve/surface", Marker, self._take_surface, queue_size=1)
        rospy.Subscriber("avatar/segment_forces", SegmentForces, self._take_forces, queue_size=100)

    def run(self) -> None:
        """Dresses the person, and returns when the sleeve is on, or ROS shuts down."""
        rate, still_s, last_s = rospy.Rate(TARGET_HZ), 0.0, rospy.get_time()
        rospy.loginfo("waiting for the person to hold out the right arm")
        while not (rospy.is_shutdown() or self._dressing.is_done):
            rate.sleep()
            now_s = rospy.get_time()
            dt, last_s = min(max(now_s - last_s, 0.0), 0.1), now_s
            arm = self._arm()
            if arm is None or self._positions is None:
                continue
            still_s = still_s + dt if is_held_out(arm) else 0.0
            if not self._dressing.has_begun and still_s < STILL_S:
                continue
            if not self._dressing.has_begun:
                rospy.loginfo("drawing the sleeve over the arm, with at most %g N", self._config.force_limit)
            self._lead(arm, dt)
        if not rospy.is_shutdown():
            self._tell(self._outcome())

    def _lead(self, arm: ArmPosition, dt: float) -> None:
        with self._lock:
            force_n = self._force_n
        assert self._positions is not None
        found = self._solver.solve(self._dressing.target(arm, force_n, dt), self._positions)
        if found is not None:
            target = JointState(name=list(found), position=list(found.values()))
            target.header.stamp = rospy.Time.now()
            self._targets.publish(target)
        self._show(arm, force_n)

    def _arm(self) -> ArmPosition | None:
        """Returns where the arm is, None if that is not known or too old."""
        places = []
        for name in JOINTS_OF_ARM:
            message = self._tf.get_tf_msg("rpbi/world", f"rpbi/human/{name}")
            if message is None or (rospy.Time.now() - message.header.stamp).to_sec() > SEES_NOTHING_S:
                return None
            place = message.transform.translation
            places.append(np.array((place.x, place.y, place.z)))
        return ArmPosition(*places)

    def _show(self, arm: ArmPosition, force_n: float) -> None:
        self._force_topic.publish(force_n)
        marker = Marker(type=Marker.TEXT_VIEW_FACING, text=f"{force_n:.1f} N of {self._config.force_limit:g} N")
        marker.header.frame_id, marker.header.stamp = "rpbi/world", rospy.Time.now()
        marker.pose.position = Point(*(arm.elbow + (0.0, 0.0, 0.2)).tolist())
        marker.pose.orientation.w = 1.0
        marker.scale.z, marker.color.a = 0.06, 1.0
        self._marker.publish(marker)

    def _outcome(self) -> Outcome:
        arm = self._arm()
        if arm is None or not self._corners:
            raise InterfaceError("the sleeve or the arm has gone: rpbi/sleeve/surface or TF of rpbi/human ceased")
        return outcome(self._corners, arm, self._forces.peak_n)

    def _tell(self, found: Outcome) -> None:
        words = "is past the elbow" if found.is_dressed else "is NOT past the elbow"
        rospy.loginfo("the sleeve %s (%.3f m); peak force %.2f N", words, found.past_elbow_m, found.peak_force_n)
        if self._config.out:
            figures: dict[str, Any] = {**found._asdict(), "is_dressed": found.is_dressed}
            Path(self._config.out).write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")

    def _take_state(self, message: JointState) -> None:
        positions = dict(zip(message.name, message.position))
        self._positions = tuple(positions[name] for name in self._kinematics.joint_names)

    def _take_surface(self, message: Marker) -> None:
        self._corners = [(point.x, point.y, point.z) for point in message.points]

    def _take_forces(self, message: SegmentForces) -> None:
        forces = dict(zip(message.segments, message.forces))
        total = np.sum([(forces[name].x, forces[name].y, forces[name].z) for name in ARM_SEGMENTS], axis=0)
        with self._lock:
            self._force_n = self._forces.add(message.header.stamp.to_sec(), total)


def main() -> None:
    """Runs the node."""
    run_node("telepresence", TelepresenceNode, TelepresenceNode.run)
