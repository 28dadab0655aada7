"""What the main YAML file may say."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo

from custom_ros_tools.schema import (
    AlsoTakes,
    ConfigModel,
    FrameId,
    Hz,
    HzOrOff,
    ListOf,
    NonNegative,
    Pixels,
    Seconds,
    Switch,
    Text,
)

from .asset_files import find_folder
from .object_entry import ObjectEntryYaml
from .pybullet_world_models import (
    ConfigureDebugVisualizer,
    Connect,
    ResetDebugVisualizerCamera,
    ResetSimulation,
    SetGravity,
    SetPhysicsEngineParameter,
)
from .sensors import RgbdSensorConfig


def _existing_folder(name: str, info: ValidationInfo) -> str:
    return find_folder(name, (info.context or {}).get("file", "~"))


def _as_list(given: Any) -> Any:
    return [given] if isinstance(given, str) else given


LONGEST_STEP_S = 10.0


def _whole_nanoseconds(seconds: float) -> float:
    if seconds > LONGEST_STEP_S:
        raise ValueError(f"must be at most {LONGEST_STEP_S:g} [s], got {seconds:g}")
    if round(seconds * 1e9) < 1:
        raise ValueError(f"must be at least 1.0e-9 [s], got {seconds:g}")
    return seconds


Folders = Annotated[
    ListOf[Annotated[Text, AfterValidator(_existing_folder)]],
    BeforeValidator(_as_list),
    AlsoTakes({"type": "string", "minLength": 1}),
]


class WorldConfig(ConfigModel):
    """The main YAML file."""

    connect: Connect = Field(Connect(), description="How to reach PyBullet.")
    setAdditionalSearchPath: Folders = Field(
        (), description="Folders to look for files in; `pybullet_data_path` is that of PyBullet's data."
    )
    resetSimulation: ResetSimulation = Field(ResetSimulation(), description="What kind of world it is.")
    setGravity: SetGravity = Field(SetGravity(), description="Gravity; there is none unless given.")
    timeStep: Annotated[Seconds, AfterValidator(_whole_nanoseconds)] = Field(0.02, description="Length of a step.")
    setPhysicsEngineParameter: SetPhysicsEngineParameter = Field(
        SetPhysicsEngineParameter(), description="How contacts and joints are solved."
    )
    real_time_factor: NonNegative = Field(
        1.0, description="Simulated seconds in a second of wall time; 0 is as fast as it goes."
    )
    clock_hz: Hz | None = Field(None, description="Most /clock messages in a second of wall time.")
    tf_prefix: FrameId | None = Field(
        None, description="What to put before all TF frames, so that two worlds can share one TF tree."
    )
    step_pybullet_manually: Switch = Field(
        False, description="Accepted without effect: the interface does every step itself."
    )
    start_pybullet_after_initialization: Switch = Field(
        True, description="Whether the world runs at once, else from the first `rpbi/start`."
    )
    status_hz: Hz = Field(50.0, description="Rate of `rpbi/status`.")
    state_hz: HzOrOff = Field(10.0, description="Rate of `rpbi/state`, in wall time; 0 is off.")
    state_hash_hz: HzOrOff = Field(
        1.0, description="Rate of the hashes in `rpbi/state`, in the world's time, by which recordings are replayed."
    )
    configureDebugVisualizer: ConfigureDebugVisualizer = Field(
        ConfigureDebugVisualizer(), description="What PyBullet's window shows."
    )
    resetDebugVisualizerCamera: ResetDebugVisualizerCamera = Field(
        ResetDebugVisualizerCamera(), description="Where PyBullet's window looks from."
    )
    enable_keyboard_publisher: Switch = Field(
        False, description="Whether keys pressed in PyBullet's window are on `rpbi/keyboard`."
    )
    enable_mouse_publisher: Switch = Field(
        False, description="Whether what the mouse does in PyBullet's window is on `rpbi/mouse`."
    )
    publish_visualizer_image_hz: HzOrOff = Field(
        0.0, description="Rate of `rpbi/visualizer_image`, what PyBullet's window shows, in wall time; 0 is off."
    )
    visualizer_image_width: Pixels = Field(640, description="Columns of that image.")
    visualizer_image_height: Pixels = Field(480, description="Its rows.")
    markers_hz: HzOrOff = Field(10.0, description="How often `rpbi/markers` is looked after, in wall time; 0 is off.")
    visual_objects: ListOf[ObjectEntryYaml] = Field((), description="Files of objects that are seen and never felt.")
    collision_objects: ListOf[ObjectEntryYaml] = Field((), description="Files of objects that nothing moves.")
    dynamic_objects: ListOf[ObjectEntryYaml] = Field((), description="Files of objects that physics moves.")
    robots: ListOf[ObjectEntryYaml] = Field((), description="Files of robots.")
    soft_objects: ListOf[ObjectEntryYaml] = Field((), description="Files of soft bodies.")
    urdfs: ListOf[ObjectEntryYaml] = Field((), description="Files of objects that come from a URDF and have no motors.")
    objects: ListOf[ObjectEntryYaml] = Field(
        (), description="Files of objects of your own types, see docs/extending.md."
    )
    rgbd_sensor: RgbdSensorConfig | None = Field(
        None, description="Camera of colour, depth and segmentation; the first one if there are several."
    )
    rgbd_sensors: ListOf[ObjectEntryYaml] = Field((), description="Files of further cameras.")

    def search_paths(self) -> tuple[str, ...]:
        """Return the folders to look for files in, as absolute paths."""
        return self.setAdditionalSearchPath
