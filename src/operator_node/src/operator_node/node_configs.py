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
    Text,
    Unit,
)

from .key_axes import KeyName, KeyPair

SecondsOrOff = Annotated[float, Field(ge=0), Unit("s")]
"""A time [s]; 0 means forever."""


class InputParameters(ConfigModel):
    """Time after which input counts as lost; it also does once it has no publisher."""

    input_timeout_s: SecondsOrOff = Field(
        0.0,
        description="Time without input after which it counts as lost; 0 waits forever, for devices that report "
        "changes only.",
    )


class OperatorParameters(StartParameters, InputParameters):
    """Parameters of the nodes that map a device."""

    repeat_hz: HzOrOff = Field(
        20.0, description="Rate at which a nonzero signal is repeated while the input stays the same; 0 never repeats."
    )


class LoggerParameters(ConfigModel):
    """Time span of the window, and how often it is published."""

    window_duration: Seconds = Field(1.0, description="Time span shown in the window.")
    hz: HzOrOff = Field(
        0.0, description="Rate at which the window is published, in wall time; 0 publishes it with each signal."
    )


class JoyRemapParameters(InputParameters):
    """Rate at which the reading of a device that reports changes only is repeated."""

    hz: Hz = Field(100.0, description="Rate, in wall time.")


class KeyboardToJoyConfig(ConfigModel):
    """Keys of axes and buttons."""

    axes: ListOf[KeyPair] = Field(description="For each axis, the key that makes it -1 and the key that makes it 1.")
    buttons: ListOf[KeyName] = Field((), description="The key of each button.")


class KeyboardToJoyParameters(ConfigModel):
    """Rate of the messages, and time for which keys count as held."""

    hz: Hz = Field(100.0, description="Rate, in wall time; a key that goes down or up is published at once.")
    key_timeout_s: SecondsOrOff = Field(
        0.0,
        description="Time for which a key counts as held after it went down, for keyboards that repeat keys but may "
        "miss "
        "a release; 0 means until it is released.",
    )


class TeleopParameters(StartParameters):
    """Time after which a teleoperated frame stops without a signal."""

    input_timeout_s: SecondsOrOff = Field(
        0.5,
        description="Time for which a signal stays in force when no other follows; then the frame stops. 0 means "
        "forever.",
    )


class InteractiveTargetConfig(ConfigModel):
    """A TF frame that is dragged in RViz."""

    parent_frame_id: FrameId = Field(description="Parent frame.")
    child_frame_id: FrameId = Field(description="Its name.")
    position: Position = Field((0.0, 0.0, 0.0), description="Initial position.")
    quat_xyzw: Quat = Field((0.0, 0.0, 0.0, 1.0), description="Initial orientation.")
    size_m: PositiveMetres = Field(0.2, description="Size of the handles.")
    hz: Hz = Field(50.0, description="Rate at which it is broadcast, in wall time.")


class MvnTopicsConfig(ConfigModel):
    """Private parameters of the node that publishes people from MVN."""

    parent_frame_id: FrameId = Field("rpbi/world", description="TF frame of MVN's world.")
    recording_folder: Text = Field("~/mvn", description="Folder for the files that `mvn/record` writes.")
