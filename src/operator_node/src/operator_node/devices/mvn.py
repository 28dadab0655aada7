"""Motion capture by Xsens MVN; the hands of the first person are its axes."""

import errno
import logging
from collections import Counter

from operator_node.device import Device, DeviceError, Reading
from operator_node.mvn.hands import AXES, HandAxes
from operator_node.mvn.packets import REASONS
from operator_node.mvn.receiver import MvnConfig, Receiver, Refused, Silence
from operator_node.mvn.segments import SegmentFrame

logger = logging.getLogger(__name__)


class Mvn(Device):
    """People as streamed by MVN.

    Its axes are the displacements of the right and the left hand of person 0 forward, left and up since the first
    frame, in arm lengths, relative to the pelvis. After a silence they are measured from the next frame. Its events are
    those of `Receiver.poll`. The device is open as soon as it listens, whether there is a sender or not. A stream that
    ceases is reported as a `Silence` and a reading at rest; it resumes with the next frame.
    """

    Config = MvnConfig
    axes = AXES
    buttons = ()
    ros_topics = "operator_node.ros.mvn.topics:MvnTopics"

    def __init__(self, config: MvnConfig) -> None:
        self.receiver = Receiver(config)
        self._hands = HandAxes()
        self._values = (0.0,) * len(AXES)

    @property
    def counts(self) -> Counter[str]:
        """Number of datagrams by result."""
        return self.receiver.counts

    def open(self) -> None:
        """Starts to listen; only frames show whether there is a sender."""
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
        """Returns the hands at the newest frame, and all events; zeros once frames of person 0 have ceased."""
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
