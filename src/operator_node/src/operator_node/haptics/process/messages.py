"""What the node and the loop's process say to each other: each message is all there is to know, so the newest does."""

import math
from collections.abc import Mapping
from typing import NamedTuple

from operator_node.haptics.controller import Snapshot
from operator_node.haptics.device import HapticConfig, HapticDevice
from operator_node.haptics.node_config import HapticNodeConfig
from operator_node.haptics.vectors import ZERO
from rpbi.geometry import Vector


class Told(NamedTuple):
    """What the simulator said.

    Attributes:
        value: Force on the tool [N], or way of the tool since the start [m], in its axes.
        at_s: When it came, by the monotonic clock, which all processes share [s].
        delay_s: How old it was then [s].
    """

    value: Vector
    at_s: float
    delay_s: float


class Orders(NamedTuple):
    """What the node wants and knows; said again and again, so that the loop notices when the node stands still.

    Attributes:
        is_on: Whether the device is to be open.
        switched: How often that was changed.
        resets: How often the target was sent back to its start.
        wrench: The newest force on the tool.
        tool: The newest way of the tool.
    """

    is_on: bool = False
    switched: int = 0
    resets: int = 0
    wrench: Told | None = None
    tool: Told | None = None


class Setup(NamedTuple):
    """What the loop's process is told first.

    Attributes:
        device: Class of the device.
        options: Those of the device.
        config: What the person moves and feels, and how often is reported.
        orders: Those of now.
        way: Where the target is, seen from its start [m]; not 0 if an earlier process got it there.
    """

    device: type[HapticDevice]
    options: HapticConfig
    config: HapticNodeConfig
    orders: Orders = Orders()
    way: Vector = ZERO


class Report(NamedTuple):
    """What the loop says of itself.

    Attributes:
        obeyed: `Orders.switched` of what is so already.
        resets: `Orders.resets` of what is done already.
        is_connected: Whether the device is open.
        has_ended: Whether the person is done with it, or a library is missing.
        trouble: Why it is not open; empty if it is.
        samples: How many readings there were.
        lateness_s: The latest that a tick was since the report before [s].
        force: What is sent to the device [N].
        snapshot: What the last good reading led to.
        delay_s: How old what is felt is; infinite without anything [s].
        fault: What was refused last; empty if readings are fine.
        faults: How often what was refused.
        energy_j: What the person has put in, less what was given back [J].
        energy_bound_j: The least that it can be [J].
        interventions: At how many samples the passivity controller changed the force.
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
