"""Input device for motion capture with Xsens MVN. Its axes are the hand displacements of person 0."""

import errno
import logging
from collections import Counter

import numpy as np

from custom_ros_tools.transforms import Array
from operator_node.device import Device, DeviceError, Reading
from operator_node.mvn.orientations import about_z, heading_rad, inverse, rotate
from operator_node.mvn.packets import REASONS
from operator_node.mvn.receiver import MvnConfig, Receiver, Refused, Silence
from operator_node.mvn.segments import INDEX, SegmentFrame

AXES = tuple(f"{side}_{axis}" for side in ("right", "left") for axis in "xyz")
MIN_ARM_M = 0.05
_HANDS = [INDEX["RightHand"], INDEX["LeftHand"]]
_ARMS = np.array([[INDEX[f"{side}{bone}"] for bone in ("UpperArm", "ForeArm", "Hand")] for side in ("Right", "Left")])
logger = logging.getLogger(__name__)


class HandAxes:
    """Computes how far both hands have moved forward, left and up since the hands were engaged.

    The displacements are relative to the pelvis and its heading, and are divided by the arm's length.
    """

    def __init__(self) -> None:
        self._engaged: tuple[Array, Array] | None = None
        """Positions of the hands [m], shape (2, 3), and arm lengths [m], shape (2, 1), when the hands were engaged."""

    def release(self) -> None:
        """Disengages the hands. The next frame engages the hands at their positions in that frame."""
        self._engaged = None

    def axes(self, frame: SegmentFrame) -> tuple[float, ...]:
        """Returns the values of `AXES`, each in [-1, 1]. Disengaged hands are engaged; all values are then 0."""
        places = _places(frame)
        if self._engaged is None:
            lengths = np.linalg.norm(np.diff(frame.positions[_ARMS], axis=1), axis=2).sum(axis=1)
            self._engaged = places, np.maximum(lengths, MIN_ARM_M)[:, None]
        before, lengths = self._engaged
        return tuple(np.clip((places - before) / lengths, -1.0, 1.0).ravel().tolist())


def _places(frame: SegmentFrame) -> Array:
    """Returns the positions of both hands relative to the pelvis and its heading [m], shape (2, 3)."""
    ahead = np.tile(about_z(heading_rad(frame.quats_xyzw[0])), (2, 1))
    return rotate(inverse(ahead), frame.positions[_HANDS] - frame.positions[0])


class Mvn(Device):
    """Hands of a person whose motion Xsens MVN captures and streams.

    The axes are the displacements of the right and the left hand of person 0, forward, left and up, since the first
    frame. The displacements are relative to the pelvis and its heading, and are divided by the arm's length. The events
    are those of `Receiver.poll` except `Refused`. The device is open as soon as it listens, even without a sender.

    When the stream ceases, the device reports a `Silence` and a reading at rest. Displacements then count from the next
    frame.
    """

    Config = MvnConfig
    axes = AXES
    buttons = ()
    ros_topics = "operator_node.devices.mvn_topics:MvnTopics"

    def __init__(self, config: MvnConfig) -> None:
        self.receiver = Receiver(config)
        self._hands = HandAxes()
        self._values = (0.0,) * len(AXES)

    @property
    def counts(self) -> Counter[str]:
        """Number of datagrams, keyed by result, see `StreamDecoder`."""
        return self.receiver.counts

    def open(self) -> None:
        """Starts to listen; succeeds even if there is no sender."""
        config = self.receiver.config
        self._release()
        try:
            self.receiver.open()
        except OSError as error:
            in_use = "; does another program receive the stream?" if error.errno == errno.EADDRINUSE else ""
            raise DeviceError(
                "mvn", f"cannot listen at {config.host}:{config.port}: {error.strerror}{in_use}"
            ) from None
        logger.info("mvn: listening at %s:%d", config.host, self.receiver.port)

    def read(self, timeout_s: float) -> Reading | None:
        """Returns the hand displacements in the newest frame, and all events since the last call.

        The displacements are 0 once the frames of person 0 have ceased. Returns None if there are no events.
        """
        if not self.receiver.port:
            raise DeviceError("mvn", "it is closed")
        try:
            events = self.receiver.poll(timeout_s)
        except OSError as error:
            raise DeviceError("mvn", f"its socket has failed: {error}") from None
        for event in events:
            if isinstance(event, SegmentFrame) and event.person == 0:
                self._values = self._hands.axes(event)
            elif isinstance(event, Silence) and event.person == 0:
                self._release()
        if not events:
            return None
        refused = tuple(REASONS[event.reason] for event in events if isinstance(event, Refused))
        return Reading(self._values, (), tuple(event for event in events if not isinstance(event, Refused)), refused)

    def close(self) -> None:
        """Stops listening."""
        self.receiver.close()
        self._release()

    def _release(self) -> None:
        self._hands.release()
        self._values = (0.0,) * len(AXES)
