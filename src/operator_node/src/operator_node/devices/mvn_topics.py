"""Publishes the messages of MVN as ROS topics and TF."""

import time
from datetime import datetime
from pathlib import Path
from typing import Any

import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PointStamped, PoseArray
from pydantic import Field
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from std_srvs.srv import Trigger, TriggerResponse
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.lifecycle.parameters import private_parameters
from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning, WallRate, WallTimer
from custom_ros_tools.ros.services import ToggleService
from custom_ros_tools.schema import ConfigModel, FrameId, Text
from custom_ros_tools.sockets import flush_buffered_sockets
from operator_node.device import Reading
from operator_node.input_topics import has_begun
from operator_node.input_topics import stamp as present_stamp
from operator_node.mvn.checks import Finding
from operator_node.mvn.frame_messages import FramePacker, PersonMarkers
from operator_node.mvn.receiver import Silence
from operator_node.mvn.segments import CenterOfMass, JointAngles, Message, PersonInfo, SegmentFrame
from rpbi.ros.state_topic import FastTopic

from .device_topics import DeviceTopics
from .mvn import Mvn

MARKER_HZ = 2.0
DIAGNOSTICS_HZ = 1.0
RECENT_S = 5.0
"""Time for which the diagnostics show a finding of the stream's checks [s]."""


class MvnTopicsConfig(ConfigModel):
    """Private parameters of the node that publishes the people captured by MVN."""

    parent_frame_id: FrameId = Field("rpbi/world", description="TF frame that stands for MVN's world frame.")
    recording_folder: Text = Field("~/mvn", description="Folder of the files that `mvn/record` writes.")


class MvnTopics(DeviceTopics):
    """Publishes the events of the device MVN, and provides services for calibration and recording.

    Raises:
        ConfigError: If a parameter is invalid.
    """

    device: Mvn

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._receiver = self.device.receiver
        self._config = private_parameters(MvnTopicsConfig)
        self._warn = ThrottledWarning()
        self._tf = FastTopic("/tf", TFMessage)
        self._first = FastTopic("mvn/segments", PoseArray)
        self._people: dict[int, _Person] = {}
        self._markers = rospy.Publisher("mvn/markers", MarkerArray, queue_size=2)
        self._diagnostics = rospy.Publisher("/diagnostics", DiagnosticArray, queue_size=10)
        self._frames_before = 0
        self._found: dict[str, tuple[float, str]] = {}
        self._services = [
            rospy.Service("mvn/calibrate", Trigger, self._calibrate),
            rospy.Service("mvn/clear_calibration", Trigger, self._clear_calibration),
            ToggleService("mvn/record", self._start_recording, self._stop_recording),
        ]
        WallTimer(DIAGNOSTICS_HZ, self._diagnose)

    def publish(self, reading: Reading, stamp: rospy.Time) -> None:
        """Publishes the events of a reading, with the present time as stamp. The argument `stamp` is not used."""
        for event in reading.events:
            stamp = present_stamp()
            if isinstance(event, SegmentFrame):
                if not has_begun():
                    continue
                self._person(event.person).publish_frame(event, stamp)
            elif isinstance(event, Finding):
                self._found[event.subject] = time.monotonic(), event.message
                self._warn(f"mvn, {event.subject}", event.message)
            elif isinstance(event, Silence):
                self._on_silence(event)
            elif isinstance(event, (JointAngles, CenterOfMass, PersonInfo)):
                self._person(event.person).publish(event, stamp)
        flush_buffered_sockets()

    def _person(self, number: int) -> "_Person":
        if number not in self._people:
            rospy.loginfo("mvn: person %d detected", number)
            self._people[number] = _Person(number, self._config, self._tf, self._first, self._markers)
        return self._people[number]

    def _on_silence(self, silence: Silence) -> None:
        who = f"mvn, person {silence.person}"
        self._warn(who, f"no frame for {silence.seconds:g} s; TF and topics wait for the next one")
        if silence.person in self._people:
            self._people[silence.person].remove_markers()

    def _diagnose(self) -> None:
        stamp, counts = present_stamp(), self._receiver.counts.copy()
        frames, self._frames_before = counts["frames"] - self._frames_before, counts["frames"]
        since_s = time.monotonic() - RECENT_S
        recent = {name: text for name, (when_s, text) in self._found.copy().items() if when_s > since_s}
        status = DiagnosticStatus(name=f"{rospy.get_name()}: stream", hardware_id="mvn", level=DiagnosticStatus.OK)
        status.message = f"{frames} frames a second"
        if not self._receiver.people:
            status.level, status.message = DiagnosticStatus.STALE, "no frames"
        elif recent:
            status.level = DiagnosticStatus.WARN
            status.message = "; ".join(f"{name}: {text}" for name, text in sorted(recent.items()))
        values: dict[str, object] = {
            "people": self._receiver.people,
            "calibrated": self._receiver.calibration.people,
            **{f"name of person {number}": each.name for number, each in self._people.copy().items() if each.name},
            "frames": counts["frames"],
            **{f"last refused, {reason}": text for reason, text in sorted(self._receiver.refusals.copy().items())},
            **{f"datagrams {what}": count for what, count in sorted(counts.items()) if what != "frames"},
        }
        status.values = [KeyValue(key, str(value)) for key, value in values.items()]
        self._diagnostics.publish(DiagnosticArray(Header(stamp=stamp), [status]))

    # --- Services, in threads of their own.

    def _calibrate(self, _: Any) -> TriggerResponse:
        """Calibrates all people, taking the present pose of each person as the T-pose."""
        try:
            return TriggerResponse(True, self._receiver.calibrate())
        except InterfaceError as error:
            return TriggerResponse(False, str(error))

    def _clear_calibration(self, _: Any) -> TriggerResponse:
        """Deletes the calibration of all people."""
        self._receiver.calibration.clear()
        return TriggerResponse(True, "orientations are uncalibrated")

    def _start_recording(self) -> tuple[bool, str]:
        name = datetime.now().strftime("mvn_%Y-%m-%d_%H-%M-%S.mvn")
        path = Path(self._config.recording_folder).expanduser() / name
        try:
            self._receiver.start_recording(path)
        except InterfaceError as error:
            return False, str(error)
        return True, f"recording into {path}"

    def _stop_recording(self) -> tuple[bool, str]:
        try:
            path, count = self._receiver.stop_recording()
        except InterfaceError as error:
            return False, str(error)
        return True, f"{path} has {count} datagrams"


class _Person:
    """Publishes the topics of one person."""

    def __init__(
        self, number: int, config: MvnTopicsConfig, tf: FastTopic, first: FastTopic, markers: rospy.Publisher
    ) -> None:
        self.name = ""
        self._parent, topics = config.parent_frame_id, f"mvn/{number}"
        self._packer = FramePacker(topics, config.parent_frame_id)
        self._tf = tf
        self._segments = FastTopic(f"{topics}/segments", PoseArray)
        self._also = [first] if number == 0 else []
        self._joints = rospy.Publisher(f"{topics}/joint_angles", JointState, queue_size=10)
        self._center = rospy.Publisher(f"{topics}/center_of_mass", PointStamped, queue_size=10)
        self._markers, self._marker_rate = markers, WallRate(MARKER_HZ)
        self._drawing = PersonMarkers(number, topics)
        self._stamp = rospy.Time()

    def publish_frame(self, frame: SegmentFrame, stamp: rospy.Time) -> None:
        """Publishes a frame, unless its stamp equals the last frame's stamp because simulated time is paused."""
        if stamp == self._stamp:
            return
        self._stamp = stamp
        transforms, poses = self._packer.messages(frame, stamp)
        self._tf.publish(transforms)
        for topic in (self._segments, *self._also):
            topic.publish(poses)
        if self._marker_rate.is_due() and self._markers.get_num_connections():
            self._markers.publish(self._drawing.message(frame))

    def publish(self, message: Message, stamp: rospy.Time) -> None:
        """Publishes joint angles or a center of mass, or stores the person's name from a `PersonInfo`."""
        header = Header(stamp=stamp, frame_id=self._parent)
        if isinstance(message, PersonInfo):
            self.name = message.fields.get("name", self.name)
        elif isinstance(message, CenterOfMass):
            center = PointStamped(header=header)
            center.point.x, center.point.y, center.point.z = message.position.tolist()
            self._center.publish(center)
        elif isinstance(message, JointAngles):
            bones = zip(message.parents, message.children)
            names = [f"{parent}_{child}_{axis}" for parent, child in bones for axis in "xyz"]
            self._joints.publish(JointState(header, names, message.angles_rad.ravel().tolist(), [], []))

    def remove_markers(self) -> None:
        """Removes the person's markers from RViz."""
        self._markers.publish(self._drawing.removal())
