"""`telepresence_node.py`: a robot pulls a sleeve over the arm of a person's avatar."""

import json
import math
import threading
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import rospy
from geometry_msgs.msg import Point
from pydantic import Field
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64
from visualization_msgs.msg import Marker

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.joint_states import resolve_joint_order
from custom_ros_tools.ros.lifecycle.parameters import private_parameters
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning
from custom_ros_tools.ros.tf_interface import TfInterface
from custom_ros_tools.schema import ConfigModel, Positive
from operator_node.msg import SegmentForces
from ros_pybullet_interface.msg import SimulationState
from rpbi_examples.dressing.cuff_path import ArmPosition, Array, is_held_out
from rpbi_examples.dressing.hand import TARGET_HZ, Dressing, HandSolver
from rpbi_examples.dressing.outcome import ArmForce, Outcome, forces_on_arm, outcome, rings_of

from .joint_targets import wait_until_ready

JOINTS_OF_ARM = ("RightUpperArm", "RightForeArm", "RightHand")
STILL_S = 1.0
"""Time for which the person must hold out the arm before the robot begins [s]."""
SEES_NOTHING_S = 1.0
"""Age of the latest pose of the arm, or of the latest force, above which the robot waits [s]."""


class TelepresenceParameters(ConfigModel):
    """Private parameters of `telepresence_node.py`."""

    force_limit: Positive = Field(15.0, description="Sum of the forces on the arm above which the cuff moves back [N].")
    speed: Positive = Field(0.1, description="Speed of the cuff without contact [m/s].")
    ready: str = Field(
        "",
        description="Topic of a real robot's commands; the node waits for the first message. If empty, the node does "
        "not wait.",
    )
    out: str = Field("", description="JSON file for the outcome. If empty, no file is written.")


class TelepresenceNode:
    """Waits until the person holds out the right arm, then pulls the sleeve over the arm, and reports the result.

    Raises:
        ConfigError: If a parameter is wrong.
    """

    def __init__(self) -> None:
        self._config = config = private_parameters(TelepresenceParameters)
        self._dressing, self._force = Dressing(config.speed), ArmForce(config.force_limit)
        self._solver = HandSolver()
        self._tf, self._lock = TfInterface(), threading.Lock()
        self._felt_s = -math.inf
        self._world_pace = 1.0
        self._positions: tuple[float, ...] | None = None
        self._rings: Array | None = None
        self._targets = rospy.Publisher("rpbi/panda/joint_states/target", JointState, queue_size=1, tcp_nodelay=True)
        self._force_topic = rospy.Publisher("telepresence/force", Float64, queue_size=10)
        self._marker = rospy.Publisher("telepresence/marker", Marker, queue_size=10)
        self._warn = ThrottledWarning()
        self._subscribe("rpbi/panda/joint_states", JointState, self._on_state, queue_size=1)
        self._subscribe("rpbi/sleeve/surface", Marker, self._on_surface, queue_size=1)
        if not rospy.get_param("/use_sim_time", False):
            self._subscribe("rpbi/state", SimulationState, self._on_world_state, queue_size=1)
        self._subscribe("avatar/segment_forces", SegmentForces, self._on_forces, queue_size=100)

    def run(self) -> None:
        """Dresses the person and reports the result. Returns at the end of the cuff's path, or when ROS shuts down.

        Raises:
            InterfaceError: If the pose of the arm or the sleeve is unknown at the end.
        """
        wait_until_ready()
        rate, still_s, last_s = rospy.Rate(TARGET_HZ), 0.0, rospy.get_time()
        rospy.loginfo("waiting for the person to hold out the right arm")
        while not (rospy.is_shutdown() or self._dressing.is_done):
            rate.sleep()
            now_s = rospy.get_time()
            dt, last_s = min(max(now_s - last_s, 0.0), 0.1) * self._world_pace, now_s
            arm = self._arm()
            if arm is None or self._positions is None or now_s - self._felt_s > SEES_NOTHING_S:
                continue
            still_s = still_s + dt if is_held_out(arm) else 0.0
            if not self._dressing.has_begun and still_s < STILL_S:
                continue
            if not self._dressing.has_begun:
                rospy.loginfo("drawing the sleeve over the arm, with at most %g N", self._config.force_limit)
            self._lead(arm, dt)
        if not rospy.is_shutdown():
            self._report(self._outcome())

    def _lead(self, arm: ArmPosition, dt: float) -> None:
        with self._lock:
            force_n, share = self._force.arm_n, self._force.share
        assert self._positions is not None
        target = self._dressing.target(arm, self._solver.cuff(self._positions), share, dt)
        found = self._solver.solve(target, self._positions)
        if found is None:
            self._warn("waiting", f"no joint positions nearby bring the robot's hand to {_rounded(target.position)} m")
        else:
            message = JointState(name=list(found), position=list(found.values()))
            message.header.stamp = rospy.Time.now()
            self._targets.publish(message)
        self._show(arm, force_n)

    def _arm(self) -> ArmPosition | None:
        """Looks up shoulder, elbow and wrist of the person's arm on TF. None if a pose is missing or too old."""
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
        marker = Marker(
            type=Marker.TEXT_VIEW_FACING, text=f"force {force_n:.1f} N, limit {self._config.force_limit:g} N"
        )
        marker.header.frame_id, marker.header.stamp = "rpbi/world", rospy.Time.now()
        marker.pose.position = Point(*(arm.elbow + (0.0, 0.0, 0.2)).tolist())
        marker.pose.orientation.w = 1.0
        marker.scale.z, marker.color.a = 0.05, 1.0
        self._marker.publish(marker)

    def _outcome(self) -> Outcome:
        arm = self._arm()
        if arm is None or self._rings is None:
            raise InterfaceError("the sleeve or the arm has gone: rpbi/sleeve/surface or TF of rpbi/human ceased")
        return outcome(self._rings, arm, self._force)

    def _report(self, found: Outcome) -> None:
        words = "is past the elbow" if found.is_dressed else "is NOT past the elbow"
        force = f"peak force {found.peak_force_n:.2f} N, {found.peak_share:.0%} of a limit"
        rospy.loginfo("the sleeve %s (%.3f m); %s", words, found.past_elbow_m, force)
        if self._config.out:
            figures: dict[str, Any] = {**found._asdict(), "is_dressed": found.is_dressed}
            Path(self._config.out).write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")

    def _subscribe(self, topic: str, kind: type, on_message: Callable[[Any], None], queue_size: int) -> None:
        rospy.Subscriber(
            topic, kind, partial(self._receive, rospy.resolve_name(topic), on_message), queue_size=queue_size
        )

    def _receive(self, topic: str, on_message: Callable[[Any], None], message: Any) -> None:
        try:
            on_message(message)
        except (InterfaceError, ValueError) as error:
            self._warn(topic, f"message refused: {error}")

    def _on_state(self, message: JointState) -> None:
        positions = resolve_joint_order(message, self._solver.joint_names).position
        if not positions:
            raise ValueError("expected positions of the joints, got none")
        self._positions = tuple(positions)

    def _on_world_state(self, message: SimulationState) -> None:
        """Stores the world's real-time factor, at most 1. The robot slows down by this factor."""
        self._world_pace = min(message.real_time_factor, 1.0)

    def _on_surface(self, message: Marker) -> None:
        self._rings = rings_of([(point.x, point.y, point.z) for point in message.points])

    def _on_forces(self, message: SegmentForces) -> None:
        forces = forces_on_arm(message.segments, message.sums, message.largest)
        with self._lock:
            self._felt_s = message.header.stamp.to_sec()
            self._force.add(self._felt_s, forces)


def _rounded(position: tuple[float, ...]) -> str:
    return f"({', '.join(f'{value:.2f}' for value in position)})"


def main() -> None:
    """Runs the node."""
    run_node("telepresence", TelepresenceNode, TelepresenceNode.run)
