"""What every haptic device is: pose in, force out."""

from abc import ABC, abstractmethod
from typing import ClassVar, NamedTuple

from pydantic import Field

from custom_ros_tools.schema import ConfigModel, NonNegative, Positive, PositiveMetres
from operator_node.device import DeviceError
from rpbi.geometry import Quaternion, Vector


class HapticReading(NamedTuple):
    """What a haptic device measures at one moment, in its base: x forward (away from the person), y left, z up.

    Attributes:
        position: Of the handle, from the middle of the workspace [m].
        velocity: Of the handle as the device measures it [m/s]; None if it does not.
        quat_xyzw: Orientation of the handle.
        buttons: 1 for each button that is held, 0 for the others.
    """

    position: Vector
    velocity: Vector | None = None
    quat_xyzw: Quaternion = (0.0, 0.0, 0.0, 1.0)
    buttons: tuple[int, ...] = ()


class ReadingError(ValueError):
    """What a device sent makes no sense; `fault` is a short name by which such are counted."""

    def __init__(self, fault: str, message: str) -> None:
        self.fault = fault
        super().__init__(message)


class DeviceEnded(DeviceError):  # noqa: N818 (nothing went wrong)
    """The person is done with the device, for instance closed its window; it is not to be opened again."""


class HapticConfig(ConfigModel):
    """What is known of a haptic device."""

    max_force_n: Positive = Field(description="The largest force that it is sent [N].")
    workspace_m: PositiveMetres = Field(description="Radius of its workspace, which axes of `joy` are parts of.")
    damping: NonNegative = Field(3.0, description="Of the device with a hand on it, for Colgate's bound [N s/m].")
    max_speed: Positive = Field(3.0, description="Faster than this no hand moves it: readings are refused [m/s].")
    max_acceleration: Positive = Field(200.0, description="No hand accelerates it more, for the leak bound [m/s^2].")
    resolution_m: NonNegative = Field(
        5e-5, description="Steps in which it measures each axis, for the leak bound; 0 is exact [m]."
    )


class HapticDevice(ABC):
    """A haptic device, opened, read, sent forces and closed by one thread: that of the loop, in a process of its own.

    It says only what the hardware says, in the axes of `HapticReading`. Checks, limits, retrying and zeros when
    something falls silent are up to the loop; a device itself lets no force outlive its expiry, as far as the hardware
    can.

    Attributes:
        Config: Model of its options.
        faults: How often what makes no sense came, by fault.
    """

    Config: ClassVar[type[HapticConfig]]

    def __init__(self, config: HapticConfig) -> None:
        self.config = config
        self.faults: dict[str, int] = {}

    @abstractmethod
    def open(self) -> None:
        """Connects to the device; after a `close`, once more.

        Raises:
            DeviceError: If it is not there. It may be later.
            MissingDependency: If it needs a library that is not installed.
        """

    @abstractmethod
    def read(self) -> HapticReading | None:
        """Returns the newest reading if there is a new one since the last call; it does not wait.

        Raises:
            DeviceError: If the device has gone; it is to be closed then.
            ReadingError: If what it sent makes no sense; it goes on.
        """

    @abstractmethod
    def send(self, force: Vector, expires_s: float) -> None:
        """Has the person feel a force; it does not wait.

        Args:
            force: x, y, z in the axes of `HapticReading` [N], finite and within the limit.
            expires_s: Until when it counts, by `time.monotonic` [s]; then the force is zero.

        Raises:
            DeviceError: If the device has gone.
        """

    @abstractmethod
    def close(self) -> None:
        """Lets go of the device, with zero force if that can be sent; it may be called at any time, and twice."""

    def silence(self) -> None:  # noqa: B027 (most hardware ends forces by itself)
        """Sends zero, for an instance that is not open, in the node's process: at first, and when the loop's has died.

        It is for devices that would hold the last force for ever.
        """

    def count(self, fault: str) -> None:
        """Counts what made no sense."""
        self.faults[fault] = self.faults.get(fault, 0) + 1
