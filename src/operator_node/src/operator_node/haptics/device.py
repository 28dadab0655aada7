"""Interface of haptic devices, which measure the pose of a handle and render forces."""

from abc import ABC, abstractmethod
from typing import ClassVar, NamedTuple

from pydantic import Field

from custom_ros_tools.schema import ConfigModel, NonNegative, Positive, PositiveMetres
from operator_node.device import DeviceError
from robot_model.geometry import Quaternion, Vector


class HapticReading(NamedTuple):
    """Measurement of a haptic device, in the axes of its base: x forward (away from the user), y left, z up.

    Attributes:
        position: Position of the handle relative to the middle of the workspace [m].
        velocity: Velocity of the handle as measured by the device [m/s]; None if the device does not measure velocity.
        quat_xyzw: Orientation of the handle, x, y, z, w.
        buttons: For each button, 1 while the button is held, otherwise 0.
    """

    position: Vector
    velocity: Vector | None = None
    quat_xyzw: Quaternion = (0.0, 0.0, 0.0, 1.0)
    buttons: tuple[int, ...] = ()


class ReadingError(ValueError):
    """A device sent invalid data. `fault` is a short name for the kind of error, by which errors are counted."""

    def __init__(self, fault: str, message: str) -> None:
        self.fault = fault
        super().__init__(message)


class DeviceEnded(DeviceError):  # noqa: N818 (nothing went wrong)
    """The user has closed the device, for example its window. The device must not be opened again."""


class HapticConfig(ConfigModel):
    """Options that all haptic devices have: force limit, workspace, and properties of the device and of a hand."""

    max_force_n: Positive = Field(description="Largest force that is sent to the device [N].")
    workspace_m: PositiveMetres = Field(
        description="Radius of the device's workspace; the axes of `joy` are displacements divided by this radius."
    )
    damping: NonNegative = Field(
        3.0, description="Damping of the device together with a hand, for Colgate's bound on the stiffness [N s/m]."
    )
    max_speed: Positive = Field(
        3.0, description="Largest speed of a hand [m/s]; readings with a larger speed are refused."
    )
    max_acceleration: Positive = Field(
        200.0,
        description="Largest acceleration of a hand, for the bound on the energy that the device can leak [m/s^2].",
    )
    resolution_m: NonNegative = Field(
        5e-5,
        description="Resolution of each measured axis, for the bound on the energy that the device can leak [m]; 0 "
        "means exact measurements.",
    )


class HapticDevice(ABC):
    """Base class of haptic devices. Only the haptic loop, in a separate process, opens, reads and closes a device.

    A device reports the state of its hardware in the axes of `HapticReading`, and renders forces. The loop checks
    readings, limits forces, opens the device again after failures, and sends zero force when inputs cease. The device
    ends each force at its expiry time, as far as the hardware allows.

    Attributes:
        Config: Model of the device's options.
        faults: Number of invalid inputs, keyed by fault.
    """

    Config: ClassVar[type[HapticConfig]]

    def __init__(self, config: HapticConfig) -> None:
        self.config = config
        self.faults: dict[str, int] = {}

    @abstractmethod
    def open(self) -> None:
        """Connects to the device. May be called again after `close`.

        Raises:
            DeviceError: If the device is absent. The caller tries again later.
            MissingDependency: If the device needs a library that is not installed.
        """

    @abstractmethod
    def read(self) -> HapticReading | None:
        """Returns the newest reading; None if no new reading has arrived since the last call. Does not wait.

        Raises:
            DeviceError: If the device has disconnected. The caller then closes the device.
            ReadingError: If the device sent invalid data. The device remains usable.
        """

    @abstractmethod
    def send(self, force: Vector, expires_s: float) -> None:
        """Renders a force; does not wait.

        Args:
            force: x, y, z in the axes of `HapticReading` [N], finite and within the limit.
            expires_s: Time at which the force becomes zero, by `time.monotonic` [s].

        Raises:
            DeviceError: If the device has disconnected.
        """

    @abstractmethod
    def close(self) -> None:
        """Sends zero force if possible, and releases the device. May be called at any time, and repeatedly."""

    def silence(self) -> None:  # noqa: B027 (most hardware ends forces by itself)
        """Sends zero force without opening the device.

        The node's process calls this method at its start, and after the loop's process has crashed. Devices implement
        it if their hardware would otherwise hold the last force forever.
        """

    def count(self, fault: str) -> None:
        """Counts an invalid input in `faults`."""
        self.faults[fault] = self.faults.get(fault, 0) + 1
