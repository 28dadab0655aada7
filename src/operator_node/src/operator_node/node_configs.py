"""Private parameters of the nodes."""

from typing import Annotated

from pydantic import Field

from custom_ros_tools.node_configs import StartParameters
from custom_ros_tools.schema import (
    ConfigModel,
    FrameId,
    Hz,
    HzOrOff,
    ListOf,
    Position,
    PositiveMetres,
    Quat,
    Seconds,
    Unit,
)

from .key_axes import KeyName, KeyPair

SecondsOrOff = Annotated[float, Field(ge=0), Unit("s")]
"""A time, where 0 is for ever."""


class InputParameters(ConfigModel):
    """When input counts as ceased; when nobody publishes it any more, it has in any case."""

    input_timeout_s: SecondsOrOff = Field(
        0.0,
        description="After how long without input it has ceased; 0 waits for ever, for devices that tell changes only.",
    )


class OperatorParameters(StartParameters, InputParameters):
    """Of the nodes that map a device."""

    repeat_hz: HzOrOff = Field(
        20.0, description="How often a signal that is not zero is repeated while input stays the same; 0 is never."
    )


class LoggerParameters(ConfigModel):
    """What is kept of a signal, and how often it is said."""

    window_duration: Seconds = Field(1.0, description="How long a signal is kept.")
    hz: HzOrOff = Field(0.0, description="How often the window is published, in wall time; 0 with each signal.")


class JoyRemapParameters(InputParameters):
    """How often a device that tells changes only is repeated."""

    hz: Hz = Field(100.0, description="How often, in wall time.")


class KeyboardToJoyConfig(ConfigModel):
    """Which keys are axes and buttons."""

    axes: ListOf[KeyPair] = Field(description="For each axis the key that makes it -1 and the one that makes it 1.")
    buttons: ListOf[KeyName] = Field((), description="The key of each button.")


class KeyboardToJoyParameters(ConfigModel):
    """How often keys are told, and how long they count as held."""

    hz: Hz = Field(100.0, description="How often, in wall time; a key that goes down or up is told at once.")
    key_timeout_s: SecondsOrOff = Field(
        0.0,
        description="How long a key counts as held after it went down, for keyboards that repeat keys but may lose "
        "that one comes up; 0 is until it comes up.",
    )


class TeleopParameters(StartParameters):
    """When a frame that is teleoperated moves."""

    input_timeout_s: SecondsOrOff = Field(
        0.5, description="How long a signal lasts when no other comes; then the frame stands still. 0 is for ever."
    )


class InteractiveTargetConfig(ConfigModel):
    """A TF frame that is dragged in RViz."""

    parent_frame_id: FrameId = Field(description="The frame that it is in.")
    child_frame_id: FrameId = Field(description="Its name.")
    position: Position = Field((0.0, 0.0, 0.0), description="Where it is at first.")
    quat_xyzw: Quat = Field((0.0, 0.0, 0.0, 1.0), description="How it is turned at first.")
    size_m: PositiveMetres = Field(0.2, description="Size of the handles.")
    hz: Hz = Field(50.0, description="How often it is broadcast, in wall time.")
