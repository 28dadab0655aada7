"""`run_human_interaction.py`: a haptic device Touch X moves an arm up and down, and renders the force on the tool.

Topics, frames and parameters have the same names as in the original release of this project (docs/from_the_release.md).
"""

import math
import threading
import time

import rospy
from geometry_msgs.msg import WrenchStamped
from std_msgs.msg import Float64

from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning, WallTimer
from operator_node.haptics.haptic_node import HapticNode

SENSOR = "rpbi/kuka_lwr/force_torque_sensor_mount/ft_sensor"
SAMPLES = 100
"""Number of initial samples of the sensor. Their mean is the weight of the tool."""
REPEAT_HZ, EXPIRY_S = 250.0, 0.06
"""Rate at which the latest force is published again [Hz], since the sensor may be slow, and its largest age [s]."""
HZ = 400.0
PARAMETERS = {
    "device": "touch",
    "target_frame_id": "teleop_target",
    "tool_frame_id": "teleop_origin",
    "hz": HZ,
    "motion_scale": [0.0, 0.0, 12.0],
    "way_low": [0.0, 0.0, -0.18],
    "way_high": [0.0, 0.0, 0.3],
    "force_axes": [0.0, 0.0, 1.0],
    "energy_allowance_j": 0.05,
    "energy_refill_w": 0.05,
}
"""Defaults of the node's private parameters."""


class TouchXExample(HapticNode):
    """A haptic node for the device `~device_name` (default: `Left`) that renders the force from the wrist's sensor.

    The sensor measures the force of the wrist on the tool. The rendered force is the opposite: the force of the
    environment on the tool.
    """

    def __init__(self) -> None:
        options = {"driver": "pose", "name": rospy.get_param("~device_name", "Left")}
        for key, value in {**PARAMETERS, "device_options": options}.items():
            if not rospy.has_param(f"~{key}"):
                rospy.set_param(f"~{key}", value)
        super().__init__()
        self._lock, self._warn_of = threading.Lock(), ThrottledWarning()
        self._samples_n: list[float] = []
        self._newest: tuple[WrenchStamped, float] | None = None
        self._reading = rospy.Publisher("ft_reading", Float64, queue_size=10)
        self._on_tool = rospy.Publisher("haptics/wrench", WrenchStamped, queue_size=1, tcp_nodelay=True)
        rospy.Subscriber(SENSOR, WrenchStamped, self._measure, queue_size=1, tcp_nodelay=True)
        WallTimer(REPEAT_HZ, self._repeat)

    def _measure(self, message: WrenchStamped) -> None:
        measured_n = message.wrench.force.z
        if not math.isfinite(measured_n):
            self._warn_of(SENSOR, f"refused, expected a finite force, got {measured_n:g}")
            return
        if len(self._samples_n) < SAMPLES:
            self._samples_n.append(measured_n)
            return
        corrected_n = measured_n - sum(self._samples_n) / SAMPLES
        self._reading.publish(Float64(corrected_n))
        force = WrenchStamped(header=message.header)
        force.header.stamp = rospy.Time()  # its age is checked here, by the wall clock
        force.wrench.force.z = -corrected_n
        with self._lock:
            self._newest = force, time.monotonic()

    def _repeat(self) -> None:
        with self._lock:
            newest = self._newest
        if newest is not None and time.monotonic() - newest[1] < EXPIRY_S:
            self._on_tool.publish(newest[0])


def main() -> None:
    """Runs the node."""
    run_node("run_human_interaction", TouchXExample, TouchXExample.run)
