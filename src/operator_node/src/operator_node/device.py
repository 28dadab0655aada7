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


class Reading(NamedTuple):
    """What a device says at one moment.

    Attributes:
        axes: A number in [-1, 1] for each axis of the device, 0 at rest.
        buttons: 1 for each button that is held, 0 for the others.
        events: What is native to the device and came since the last reading, in order, for topics of its own.
    """

    axes: tuple[float, ...]
    buttons: tuple[int, ...]
    events: tuple[Any, ...] = ()


class Device(ABC):
    """An input device, opened, read and closed by one thread, which is the main one.

    Its options are its `Config`, in YAML or as parameters of its node. It only says what the hardware says: retrying,
    repeating, stamps, time-outs and the reading of zeros when it has gone are up to who reads it, and so are checks
    that what it says is finite and within [-1, 1].

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

        Args:
            timeout_s: How long to wait [s]; 0 does not wait.

        Raises:
            DeviceError: If the device has gone; it is to be closed then.
        """

    @abstractmethod
    def close(self) -> None:
        """Lets go of the device; it may be called at any time, and twice."""

    def cue(self, force: Sequence[float]) -> None:  # noqa: B027 (most devices have nothing to feel)
        """Has the person feel a force as the device can, for instance by rumbling.

        Args:
            force: x, y, z, each in [-1, 1] of what the device can do.
        """
