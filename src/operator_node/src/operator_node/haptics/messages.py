"""Messages between the node and the loop's process; each one is complete, so that only the newest counts."""

import math
from collections.abc import Mapping
from typing import NamedTuple

from operator_node.haptics.controller import Snapshot
from operator_node.haptics.device import HapticConfig, HapticDevice
from operator_node.haptics.node_config import HapticNodeConfig
from robot_model.geometry import ZERO, Vector


class LoopInput(NamedTuple):
    """A sample of the tool from the simulator.

    Attributes:
        value: Force on the tool [N], or displacement of the tool since the start [m], in its axes.
        at_s: Time of arrival, by the monotonic clock, which all processes share [s].
        delay_s: Age of the sample at arrival [s].
    """

    value: Vector
    at_s: float
    delay_s: float


class LoopCommand(NamedTuple):
    """Command of the node to the loop; repeated, so that the loop detects when the node has stopped.

    Attributes:
        is_on: Whether the device is to be open.
        switched: Number of times that this was changed.
        resets: Number of times that the target was returned to its start.
        wrench: The newest force on the tool.
        tool: The newest displacement of the tool.
    """

    is_on: bool = False
    switched: int = 0
    resets: int = 0
    wrench: LoopInput | None = None
    tool: LoopInput | None = None


class Setup(NamedTuple):
    """First message to the loop's process.

    Attributes:
        device: Class of the device.
        options: Options of the device.
        config: The mapping, the forces, and the rate of reports.
        orders: The present command.
        way: Displacement of the target from its start [m]; not 0 if an earlier process has moved it.
    """

    device: type[HapticDevice]
    options: HapticConfig
    config: HapticNodeConfig
    orders: LoopCommand = LoopCommand()
    way: Vector = ZERO


class LoopReport(NamedTuple):
    """State of the loop.

    Attributes:
        obeyed: `LoopCommand.switched` of the command that has been carried out.
        resets: `LoopCommand.resets` of the command that has been carried out.
        is_connected: Whether the device is open.
        has_ended: Whether the user has finished with it, or a library is missing.
        trouble: Why it is not open; empty if it is.
        samples: Number of readings.
        lateness_s: Largest lateness of a tick since the last report [s].
        force: Force that is sent to the device [N].
        snapshot: Result of the last valid reading.
        delay_s: Age of the sample that is rendered; infinite without any [s].
        fault: Last fault of a refused reading; empty if readings are valid.
        faults: Number of refused readings, by fault.
        energy_j: Energy that the user has put in, less the energy given back [J].
        energy_bound_j: Least value of that energy [J].
        interventions: Number of samples at which the passivity controller changed the force.
    """

    obeyed: int = 0
    resets: int = 0
    is_connected: bool = False
    has_ended: bool = False
    trouble: str = "not opened yet"
    samples: int = 0
    lateness_s: float = 0.0
    force: Vector = ZERO
    snapshot: Snapshot | None = None
    delay_s: float = math.inf
    fault: str = ""
    faults: Mapping[str, int] = {}
    energy_j: float = 0.0
    energy_bound_j: float = 0.0
    interventions: int = 0
