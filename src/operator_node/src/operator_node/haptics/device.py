"""Interface of all haptic devices: pose in, force out."""

from abc import ABC, abstractmethod
from typing import ClassVar, NamedTuple

from pydantic import Field

from custom_ros_tools.schema import ConfigModel, NonNegative, Positive, PositiveMetres
from operator_node.device import DeviceError
from robot_model.geometry import Quaternion, Vector


class HapticReading(NamedTuple):
    """Measurement of a haptic device, in the axes of its base: x forward (away from the user), y left, z up.

    Attributes:
        position: Position of the handle, from the middle of the workspace [m].
        velocity: Velocity of the handle as measured by the device [m/s]; None if it does not measure it.
        quat_xyzw: Orientation of the handle.
        buttons: 1 for each button that is held, 0 for the others.
    """

    position: Vector
    velocity: Vector | None = None
    quat_xyzw: Quaternion = (0.0, 0.0, 0.0, 1.0)
    buttons: tuple[int, ...] = ()


class ReadingError(ValueError):
    """A device sent invalid data; `fault` is a short name under which such data are counted."""

    def __init__(self, fault: str, message: str) -> None:
        self.fault = fault
        super().__init__(message)


class DeviceEnded(DeviceError):  # noqa: N818 (nothing went wrong)
    """The user has finished with the device, for example closed its window; it must not be opened again."""


class HapticConfig(ConfigModel):
    """Properties of a haptic device."""

    max_force_n: Positive = Field(description="Largest force that is sent to it [N].")
    workspace_m: PositiveMetres = Field(description="Radius of its workspace, the unit of the axes of `joy`.")
    damping: NonNegative = Field(
        3.0, description="Damping of the device with a hand on it, for Colgate's bound [N s/m]."
    )
    max_speed: Positive = Field(3.0, description="Largest speed of a hand; faster readings are refused [m/s].")
    max_acceleration: Positive = Field(200.0, description="Largest acceleration of a hand, for the leak bound [m/s^2].")
    resolution_m: NonNegative = Field(
        5e-5, description="Resolution of each measured axis, for the leak bound; 0 is exact [m]."
    )


class HapticDevice(ABC):
    """A haptic device; one thread, that of the loop in a process of its own, opens it, reads it, sends forces and
    closes it.

    A device only reports the state of its hardware, in the axes of `HapticReading`. The loop does the rest: checks,
    limits, retries, and zero forces when an input falls silent. The device itself ends each force at its expiry, as far
    as the hardware can.

    Attributes:
        Config: Model of its options.
        faults: Number of invalid inputs, by fault.
    """

    Config: ClassVar[type[HapticConfig]]

    def __init__(self, config: HapticConfig) -> None:
        self.config = config
        self.faults: dict[str, int] = {}

    @abstractmethod
    def open(self) -> None:
        """Connects to the device; reconnects after `close`.

        Raises:
            DeviceError: If it is absent. It may appear later.
            MissingDependency: If it needs a library that is not installed.
        """

    @abstractmethod
    def read(self) -> HapticReading | None:
        """Returns the newest reading if there is a new one since the last call; does not wait.

        Raises:
            DeviceError: If the device has gone; the caller closes it then.
            ReadingError: If it sent invalid data; it remains usable.
        """

    @abstractmethod
    def send(self, force: Vector, expires_s: float) -> None:
        """Renders a force; does not wait.

        Args:
            force: x, y, z in the axes of `HapticReading` [N], finite and within the limit.
            expires_s: Time until which it is valid, by `time.monotonic` [s]; then the force is zero.

        Raises:
            DeviceError: If the device has gone.
        """

    @abstractmethod
    def close(self) -> None:
        """Releases the device, with zero force if that can be sent; may be called at any time, and repeatedly."""

    def silence(self) -> None:  # noqa: B027 (most hardware ends forces by itself)
        """Sends zero force from an instance that is not open, in the node's process: at the start, and after the loop's
        process died.

        Implemented by devices that would otherwise hold the last force forever.
        """

    def count(self, fault: str) -> None:
        """Counts an invalid input."""
        self.faults[fault] = self.faults.get(fault, 0) + 1
