"""JSON Schemas of the YAML files of this package."""

from pathlib import Path

from custom_ros_tools.schema import ConfigModel
from custom_ros_tools.schema.json_schema import json_schema, schema_texts
from rpbi_utils.fake_driver.config import FakeDriverConfig, RobotLimits
from rpbi_utils.interpolation.config import WaypointMotionConfig
from rpbi_utils.tracking.config import TrackingNodeConfig

FILES: dict[str, type[ConfigModel]] = {
    "robot_limits": RobotLimits,
    "stand_in": FakeDriverConfig,
    "tracked_objects": TrackingNodeConfig,
    "trajectory": WaypointMotionConfig,
}


def schema_files(root: Path) -> dict[Path, str]:
    """Returns the text of each schema file, keyed by the file's path. `root` is the workspace folder."""
    found = {name: json_schema(model, name) for name, model in FILES.items()}
    return schema_texts(root / "src/rpbi_utils/schema", found)
