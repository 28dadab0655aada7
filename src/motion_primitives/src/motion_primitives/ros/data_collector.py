"""Records demonstrations, with the same interface as the original package's module `dmp.data_collector`."""

import threading

import numpy as np
import rospy

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.lifecycle.wall_time import WallTimer
from custom_ros_tools.ros.tf_interface import TfInterface
from custom_ros_tools.transforms import Array


class EmptyRecordingError(InterfaceError):
    """Samples were requested from an empty recording."""

    def __str__(self) -> str:
        return "nothing was recorded: expected samples between start and stop"


class DMPDataCollector:
    """Stores samples over time. Subclasses call `append` for each sample while `is_on` is true.

    Args:
        zero_time: Whether the times that `get` returns begin at 0.
        interpolate: Number of equally spaced samples that `get` interpolates. None: `get` returns the recorded samples.
    """

    def __init__(self, zero_time: bool = True, interpolate: int | None = None) -> None:
        self._zero_time, self._interpolate = zero_time, interpolate
        self._lock = threading.Lock()
        self._times: list[float] = []
        self._samples: list[list[float]] = []
        self.is_on = False

    def is_empty(self) -> bool:
        """Returns whether the recording is empty."""
        return not self._times

    def reset(self) -> None:
        """Deletes all samples."""
        with self._lock:
            self._times, self._samples = [], []

    def start(self) -> None:
        """Starts recording without deleting earlier samples."""
        self.is_on = True

    def stop(self) -> None:
        """Stops recording."""
        self.is_on = False

    def append(self, time_s: float, sample: list[float]) -> None:
        """Adds a sample if it is newer than the last sample.

        Args:
            time_s: Time of the sample [s].
            sample: The numbers of the sample, shape (dims,).
        """
        with self._lock:
            if not self._times or time_s > self._times[-1]:
                self._times.append(time_s)
                self._samples.append(sample)

    def get(self) -> tuple[Array, Array]:
        """Returns N times [s], and N samples, shape (dims, N).

        Raises:
            EmptyRecordingError: If the recording is empty.
        """
        with self._lock:
            times, samples = np.array(self._times), np.array(self._samples).T
        if not len(times):
            raise EmptyRecordingError()
        if self._interpolate is not None:
            even = np.linspace(times[0], times[-1], self._interpolate)
            times, samples = even, np.array([np.interp(even, times, row) for row in samples])
        return (times - times[0] if self._zero_time else times), samples

    def get_first(self) -> Array:
        """Returns the first sample, shape (dims,); raises an EmptyRecordingError if the recording is empty."""
        return self.get()[1][:, 0]

    def get_last(self) -> Array:
        """Returns the last sample, shape (dims,); raises an EmptyRecordingError if the recording is empty."""
        return self.get()[1][:, -1]


class TFPositionDMPDataCollector(DMPDataCollector):
    """Records the position of a TF frame in another frame [m].

    Args:
        parent: Name of the reference frame.
        child: Name of the frame whose position is recorded.
        hz: Rate at which TF is read [Hz]. A transform is recorded only if its stamp has increased.
        zero_time: See `DMPDataCollector`.
        collect_x: Whether x is recorded.
        collect_y: Whether y is recorded.
        collect_z: Whether z is recorded.
        interpolate: See `DMPDataCollector`.
    """

    def __init__(
        self,
        parent: str,
        child: str,
        hz: float = 100,
        zero_time: bool = True,
        collect_x: bool = True,
        collect_y: bool = True,
        collect_z: bool = True,
        interpolate: int | None = None,
    ) -> None:
        super().__init__(zero_time, interpolate)
        self._parent, self._child = parent, child
        self._axes = [index for index, is_on in enumerate((collect_x, collect_y, collect_z)) if is_on]
        self._tf = TfInterface()
        self._timer = WallTimer(hz, self._collect)

    def _collect(self) -> None:
        message = self._tf.get_tf_msg(self._parent, self._child) if self.is_on else None
        if message is not None:
            position = self._tf.msg_to_pos(message)
            stamp = message.header.stamp or rospy.Time.now()  # static transforms may have stamp 0
            self.append(stamp.to_sec(), [float(position[index]) for index in self._axes])
