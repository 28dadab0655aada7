"""What every input device is."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.schema import ConfigModel


@dataclass(eq=False)
class DeviceError(InterfaceError):
    """A device is not there, has gone, or sends what makes no sense; `reason` says which, and what to do about it."""

    device: str
    reason: str

    def __str__(self) -> str:
        return f"{self.device}: {self.reason}"


class DeviceClosedError(DeviceError):
    """The person has closed the device, as by the cross of its window: it is not to be opened again."""


class Reading(NamedTuple):
    """What a device says at one moment.

    Attributes:
        axes: A number in [-1, 1] for each axis of the device.
        buttons: 1 for each button that is held, 0 for the others.
        events: What is native to the device and came since the last reading, in order, for topics of its own.
        refused: What came since the last reading and makes no sense, as the reason for each.
    """

    axes: tuple[float, ...]
    buttons: tuple[int, ...]
    events: tuple[Any, ...] = ()
    refused: tuple[str, ...] = ()


class Device(ABC):
    """An input device, opened, read and closed by one thread, which is the main one.

    Its options are its `Config`, in YAML or as parameters of its node, and the only argument that it is made with. It
    only says what the hardware says: retrying, repeating, stamps and the last reading when it has gone are up to
    `DeviceFeed`, and so are checks that what it says is finite and within [-1, 1], and that nothing jumps.

    Attributes:
        Config: Model of its options.
        axes: Names of its axes, in the order of the message; of some devices known once they are open.
        buttons: Names of its buttons, likewise.
        ros_topics: `module:Class` of what publishes its events on topics of their own, and takes what it is sent; empty
            if a `sensor_msgs/Joy` is all that there is.
    """

    Config: ClassVar[type[ConfigModel]]
    axes: Sequence[str]
    buttons: Sequence[str]
    ros_topics: ClassVar[str] = ""

    @abstractmethod
    def open(self) -> None:
        """Connects to the device; after a `close`, once more.

        Raises:
            DeviceError: If it is not there. It may be later: whoever reads it tries again.
            MissingDependency: If it needs a library that is not installed.
        """

    @abstractmethod
    def read(self, timeout_s: float) -> Reading | None:
        """Returns the newest reading once there is a new one, or None after some time without.

        The first reading after `open` is the present state, as soon as it is known.

        Args:
            timeout_s: How long to wait [s]; 0 does not wait.

        Raises:
            DeviceError: If the device has gone; it is to be closed then.
            DeviceClosedError: If the person has closed it.
        """

    @abstractmethod
    def close(self) -> None:
        """Lets go of the device; it may be called at any time, and twice."""

    def at_rest(self) -> Reading:
        """Returns the reading when nobody touches the device: 0 everywhere, unless it is built otherwise.

        It is the last one when the device goes or is closed; its events let go of what is held.
        """
        return Reading((0.0,) * len(self.axes), (0,) * len(self.buttons))

    def cue(self, force: Sequence[float]) -> None:  # noqa: B027 (most devices have nothing to feel)
        """Has the person feel a force as the device can, for instance by rumbling.

        Args:
            force: x, y, z, each in [-1, 1] of what the device can do.
        """
