"""`calibrate_wrench_node.py`: subtracts a sensor's zero offset and a payload's weight from measured wrenches."""

from __future__ import annotations

import threading
import time

import numpy as np
import rospy
import tf2_ros
from geometry_msgs.msg import InertiaStamped, Vector3, WrenchStamped
from std_msgs.msg import Header
from std_srvs.srv import Trigger, TriggerRequest, TriggerResponse

from custom_ros_tools.ros.lifecycle.parameters import kept_parameters, private_parameters
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning
from custom_ros_tools.ros.tf_interface import TfListener
from robot_model.geometry import Pose, Vector

from .calibration import (
    Array,
    CalibrationParameters,
    MovedError,
    PayloadConfig,
    RestingMean,
    WrenchCalibration,
    gravity_in,
    listed,
)
from .identification import PoseSample, UndeterminedError, identify_payload

QUEUE_SIZE = 100
MAX_SILENCE_S = 5.0
"""Time without a message after which the computation of a mean fails [s of wall time]."""
RETRY_S = 0.2
"""Time between two attempts to zero a sensor that is not at rest [s]."""
MAX_TF_AGE_S = 0.5
"""Largest difference between the stamps of a wrench and of the sensor's pose [s]."""


class SilentError(ValueError):
    """No wrench has arrived, or another service call is already computing a mean."""


class CalibrateWrenchNode:
    """Subtracts zero offset and payload weight from wrenches on `wrench`. Publishes the results on `wrench/calibrated`.

    Raises:
        ConfigError: If a parameter is invalid.
    """

    def __init__(self) -> None:
        self._parameters = private_parameters(CalibrationParameters)
        self._calibration = WrenchCalibration(self._parameters.payload)
        self._samples: list[PoseSample] = []
        self._frame_id = ""
        self._lock = threading.Lock()
        self._mean: RestingMean | None = None
        """Mean that a service is computing now; None otherwise."""
        self._is_complete = threading.Condition(self._lock)
        self._arrived_s = time.monotonic()
        self._warn = ThrottledWarning()
        self._buffer = tf2_ros.Buffer()
        self._listener = TfListener(self._buffer)
        self._calibrated = rospy.Publisher("wrench/calibrated", WrenchStamped, queue_size=QUEUE_SIZE, tcp_nodelay=True)
        self._payload = rospy.Publisher("wrench/payload", InertiaStamped, queue_size=1, latch=True)
        self._topic = rospy.Subscriber(
            "wrench", WrenchStamped, self._on_wrench, queue_size=QUEUE_SIZE, tcp_nodelay=True
        ).resolved_name
        rospy.Service("wrench/zero", Trigger, self._zero)
        rospy.Service("wrench/payload/sample", Trigger, self._sample)
        rospy.Service("wrench/payload/identify", Trigger, self._identify)
        rospy.Service("wrench/payload/clear", Trigger, self._clear)

    def run(self) -> None:
        """Sets the zero offset as soon as the sensor is at rest. Does nothing if a parameter gives the offset."""
        while self._calibration.offset is None and not rospy.is_shutdown():
            answer = self._zero(None)
            if not answer.success and not rospy.is_shutdown():
                self._warn("wrench/zero", f"{answer.message}; tries again")
                time.sleep(RETRY_S)

    def _on_wrench(self, message: WrenchStamped) -> None:
        force, torque = message.wrench.force, message.wrench.torque
        wrench = np.array([force.x, force.y, force.z, torque.x, torque.y, torque.z])
        if not np.isfinite(wrench).all():
            self._warn(self._topic, f"left out: expected finite numbers, got {listed(wrench.tolist())}")
            return
        with self._lock:
            calibration, self._arrived_s = self._calibration, time.monotonic()
            pose = None
            if self._mean is not None or calibration.payload is not None:
                pose = self._pose(message.header)
            if self._mean is not None and not self._mean.is_complete:
                self._mean.add(wrench, pose)
                self._is_complete.notify_all()
            if calibration.offset is None:
                return
            if calibration.payload is not None and pose is None:
                self._warn(self._topic, f"left out: {self._missing()}, which the payload's weight depends on")
                return
            rest = calibration.calibrated(wrench, self._gravity(pose)).tolist()
        message.wrench.force, message.wrench.torque = Vector3(*rest[:3]), Vector3(*rest[3:])
        self._calibrated.publish(message)

    def _pose(self, header: Header) -> Pose | None:
        """Returns the sensor's pose in the gravity frame at a wrench's stamp; None if TF lacks this pose."""
        self._frame_id = self._parameters.sensor_frame or header.frame_id.strip("/")
        frames = self._parameters.gravity_frame, self._frame_id
        try:
            found = self._buffer.lookup_transform(*frames, header.stamp)
        except tf2_ros.ExtrapolationException:
            try:
                found = self._buffer.lookup_transform(*frames, rospy.Time(0))
            except tf2_ros.TransformException:
                return None
            if found.header.stamp and abs((header.stamp - found.header.stamp).to_sec()) > MAX_TF_AGE_S:
                return None
        except tf2_ros.TransformException:
            return None
        p, q = found.transform.translation, found.transform.rotation
        return Pose((p.x, p.y, p.z), (q.x, q.y, q.z, q.w))

    def _missing(self) -> str:
        return f"no TF from '{self._parameters.gravity_frame}' to '{self._frame_id}' of that time"

    def _gravity(self, pose: Pose | None) -> Vector | None:
        return None if pose is None else gravity_in(pose, self._parameters.gravity)

    def _rest(self) -> tuple[Array, Pose | None]:
        """Waits for `max_samples` wrenches. Returns their mean and the sensor's pose; the pose is None if unknown.

        The caller must hold the lock.

        Raises:
            MovedError: If the sensor moved, or the wrench changed by more than the limits.
            SilentError: If no wrenches arrive, or another service call is already computing a mean.
        """
        if self._mean is not None:
            raise SilentError("another service is reading the sensor; try again")
        mean = self._mean = RestingMean(self._parameters)
        self._arrived_s = time.monotonic()
        try:
            while not mean.is_complete:
                self._is_complete.wait(0.2)
                if rospy.is_shutdown() or time.monotonic() - self._arrived_s > MAX_SILENCE_S:
                    raise SilentError(f"expected a message on '{self._topic}', got none for {MAX_SILENCE_S:g} s")
            return mean.result()
        finally:
            self._mean = None

    def _zero(self, _: TriggerRequest | None) -> TriggerResponse:
        """Service callback that sets the zero offset to the mean wrench minus the payload's weight.

        The sensor has to be at rest and without contact.
        """
        with self._lock:
            try:
                mean, pose = self._rest()
            except (MovedError, SilentError) as error:
                return TriggerResponse(False, f"not zeroed: {error}")
            if self._calibration.payload is not None and pose is None:
                return TriggerResponse(False, f"not zeroed: {self._missing()}, which the payload's weight depends on")
            self._calibration.zero(mean, self._gravity(pose))
            assert self._calibration.offset is not None
            offset = self._calibration.offset.tolist()
        message = f"zero is {listed(offset[:3])} N and {listed(offset[3:], 4)} N m"
        rospy.loginfo(message)
        return TriggerResponse(True, message)

    def _sample(self, _: TriggerRequest) -> TriggerResponse:
        """Service callback that adds the mean wrench in the present pose to the samples for the identification.

        The sensor has to be at rest.
        """
        with self._lock:
            try:
                mean, pose = self._rest()
            except (MovedError, SilentError) as error:
                return TriggerResponse(False, f"no pose added: {error}")
            gravity = self._gravity(pose)
            if gravity is None:
                return TriggerResponse(False, f"no pose added: {self._missing()}")
            self._samples.append(PoseSample(mean, gravity))
            return TriggerResponse(True, f"pose {len(self._samples)}: gravity is {listed(gravity)} m/s^2 in the sensor")

    def _identify(self, _: TriggerRequest) -> TriggerResponse:
        """Service callback that identifies payload and zero offset from the samples, and starts to use both."""
        with self._lock:
            try:
                found = identify_payload(self._samples, self._parameters)
            except UndeterminedError as error:
                return TriggerResponse(False, f"not identified: {error}")
            self._calibration.use(found.payload)
        self._publish_payload(found.payload)
        kept_parameters.set("~identified_payload", found.payload.model_dump(mode="json"))
        rospy.loginfo("payload: %s", found)
        return TriggerResponse(True, str(found))

    def _clear(self, _: TriggerRequest) -> TriggerResponse:
        """Service callback that removes all samples. An identified payload is kept."""
        with self._lock:
            count = len(self._samples)
            self._samples.clear()
        return TriggerResponse(True, f"{count} poses removed")

    def _publish_payload(self, payload: PayloadConfig) -> None:
        message = InertiaStamped(header=Header(stamp=rospy.Time.now(), frame_id=self._frame_id))
        message.inertia.m, message.inertia.com = abs(payload.mass), Vector3(*payload.centre)
        self._payload.publish(message)


def main() -> None:
    """Runs the node."""
    run_node("calibrate_wrench_node", CalibrateWrenchNode, CalibrateWrenchNode.run, anonymous=True)
