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
    """People as MVN streams them.

    Its axes are how far the right and the left hand of person 0 are forward, left and up from where they were in the
    first frame, in lengths of the arm, seen from the pelvis. After silence they count anew from the next frame. Its
    events are those of `Receiver.poll`. It is there as soon as it listens, whether anybody sends or not: a stream that
    ceases is a `Silence` and a reading at rest, and goes on with the first frame that comes.
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
        """What became of the datagrams, by what."""
        return self.receiver.counts

    def open(self) -> None:
        """Listens; whether anybody sends, only frames tell."""
        config = self.receiver.config
        self._release()
        try:
            self.receiver.open()
        except OSError as error:
            in_use = "; does another program take the stream?" if error.errno == errno.EADDRINUSE else ""
            raise DeviceError(
                "mvn", f"cannot listen at {config.host}:{config.port}: {error.strerror}{in_use}"
            ) from None
        logger.info("mvn: listening at %s:%d", config.host, self.receiver.port)

    def read(self, timeout_s: float) -> Reading | None:
        """Returns the hands at the newest frame, and all that came; zeros when the frames of person 0 cease."""
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
        """Listens no more."""
        self.receiver.close()
        self._release()

    def _release(self) -> None:
        self._hands.release()
        self._values = (0.0,) * len(AXES)
