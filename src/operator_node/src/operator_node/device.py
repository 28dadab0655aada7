"""Interface of the input devices."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.schema import ConfigModel


@dataclass(eq=False)
class DeviceError(InterfaceError):
    """A device is absent, has disconnected or sends invalid data. `reason` describes the problem, and a remedy."""

    device: str
    reason: str

    def __str__(self) -> str:
        return f"{self.device}: {self.reason}"


class DeviceClosedError(DeviceError):
    """The user has closed the device, for example its window. The device must not be opened again."""


class Reading(NamedTuple):
    """State of a device at one moment.

    Attributes:
        axes: A number in [-1, 1] for each axis of the device.
        buttons: For each button of the device, 1 while the button is held, otherwise 0.
        events: Device-specific events since the last reading, in order, for the topics of `Device.ros_topics`.
        refused: Reason for each invalid input that was refused since the last reading.
    """

    axes: tuple[float, ...]
    buttons: tuple[int, ...]
    events: tuple[Any, ...] = ()
    refused: tuple[str, ...] = ()


class Device(ABC):
    """Base class of the input devices. The main thread opens, reads and closes a device.

    The constructor of a device has one argument, the options of type `Config`, which come from YAML or from the
    parameters of the device's node. A device only reports the state of its hardware. `DeviceFeed` does the rest: it
    opens the device again after failures, checks that values are finite and within [-1, 1], repeats readings, and
    prevents jumps. When a device disconnects, `DeviceFeed` publishes a last reading at rest.

    Attributes:
        Config: Model of the device's options.
        axes: Names of the axes, in the order of `Reading.axes`. Some devices know the axes only after `open`.
        buttons: Names of the buttons, in the order of `Reading.buttons`. Some devices know the buttons only after
            `open`.
        ros_topics: `module:Class` of a subclass of `DeviceTopics`, which publishes the device's events and subscribes
            to its inputs; empty if the device has no topics other than `sensor_msgs/Joy`.
    """

    Config: ClassVar[type[ConfigModel]]
    axes: Sequence[str]
    buttons: Sequence[str]
    ros_topics: ClassVar[str] = ""

    @abstractmethod
    def open(self) -> None:
        """Connects to the device. May be called again after `close`.

        Raises:
            DeviceError: If the device is absent. The caller tries again later.
            MissingDependency: If the device needs a library that is not installed.
        """

    @abstractmethod
    def read(self, timeout_s: float) -> Reading | None:
        """Waits for a new reading and returns it; None if no new reading arrives within the timeout.

        The first reading after `open` contains the present state, and arrives as soon as the device knows this state.

        Args:
            timeout_s: Longest time to wait [s]; 0 does not wait.

        Raises:
            DeviceError: If the device has disconnected. The caller then closes the device.
            DeviceClosedError: If the user has closed the device.
        """

    @abstractmethod
    def close(self) -> None:
        """Releases the device; may be called at any time, and repeatedly."""

    def at_rest(self) -> Reading:
        """Returns the reading of an untouched device. All values are 0 unless the hardware has other values at rest.

        This reading is published last when the device disconnects or is closed. Its events report the release of all
        held keys.
        """
        return Reading((0.0,) * len(self.axes), (0,) * len(self.buttons))

    def cue(self, force: Sequence[float]) -> None:  # noqa: B027 (most devices have nothing to feel)
        """Renders a force as well as the device can, for example by rumbling.

        Args:
            force: Components x, y, z, each in [-1, 1], as fractions of the device's maximum force.
        """
