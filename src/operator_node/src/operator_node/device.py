"""Interface of all input devices."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.schema import ConfigModel


@dataclass(eq=False)
class DeviceError(InterfaceError):
    """A device is absent, has disconnected or sends invalid data; `reason` states which, and a remedy."""

    device: str
    reason: str

    def __str__(self) -> str:
        return f"{self.device}: {self.reason}"


class DeviceClosedError(DeviceError):
    """The user has closed the device, for example its window; it must not be opened again."""


class Reading(NamedTuple):
    """State of a device at one moment.

    Attributes:
        axes: A number in [-1, 1] for each axis of the device.
        buttons: 1 for each button that is held, 0 for the others.
        events: Native events of the device since the last reading, in order; for topics of its own.
        refused: Reason for each invalid input since the last reading.
    """

    axes: tuple[float, ...]
    buttons: tuple[int, ...]
    events: tuple[Any, ...] = ()
    refused: tuple[str, ...] = ()


class Device(ABC):
    """An input device; one thread, the main thread, opens, reads and closes it.

    Its options are its `Config`, read from YAML or from parameters of its node; they are the only argument of its
    constructor. A device only reports the state of its hardware. `DeviceFeed` does the rest: it retries, repeats,
    stamps and publishes the last reading when a device has gone; it checks that values are finite and within [-1, 1],
    and prevents jumps.

    Attributes:
        Config: Model of its options.
        axes: Names of its axes, in the order of the message; some devices know them only once they are open.
        buttons: Names of its buttons, likewise.
        ros_topics: `module:Class` that publishes its events on topics of their own and subscribes to its inputs; empty
            if the device has no topics other than `sensor_msgs/Joy`.
    """

    Config: ClassVar[type[ConfigModel]]
    axes: Sequence[str]
    buttons: Sequence[str]
    ros_topics: ClassVar[str] = ""

    @abstractmethod
    def open(self) -> None:
        """Connects to the device; reconnects after `close`.

        Raises:
            DeviceError: If it is absent. It may appear later: the caller tries again.
            MissingDependency: If it needs a library that is not installed.
        """

    @abstractmethod
    def read(self, timeout_s: float) -> Reading | None:
        """Returns the next new reading, or None if there is none within the timeout.

        The first reading after `open` is the present state, as soon as it is known.

        Args:
            timeout_s: Longest time to wait [s]; 0 does not wait.

        Raises:
            DeviceError: If the device has gone; the caller closes it then.
            DeviceClosedError: If the user has closed it.
        """

    @abstractmethod
    def close(self) -> None:
        """Releases the device; may be called at any time, and repeatedly."""

    def at_rest(self) -> Reading:
        """Returns the reading of an untouched device: 0 everywhere, unless its hardware differs.

        It is published last when the device goes or is closed; its events release all keys and buttons that are held.
        """
        return Reading((0.0,) * len(self.axes), (0,) * len(self.buttons))

    def cue(self, force: Sequence[float]) -> None:  # noqa: B027 (most devices have nothing to feel)
        """Renders a force as well as the device can, for example by rumbling.

        Args:
            force: x, y, z, each in [-1, 1], as a share of the largest force of the device.
        """
