"""JSON Schemas of the YAML files of this package."""

from pathlib import Path

from custom_ros_tools.schema import ConfigModel
from custom_ros_tools.schema.json_schema import explained, json_schema, schema_text, write_schemas
from rpbi_utils.stand_in.config import RobotLimits, StandInConfig
from rpbi_utils.tracking.config import TrackingNodeConfig

FILES: dict[str, type[ConfigModel]] = {
    "robot_limits": RobotLimits,
    "stand_in": StandInConfig,
    "tracked_objects": TrackingNodeConfig,
}


def schema_files(root: Path) -> dict[Path, str]:
    """Returns what the files should have.

    Args:
        root: The workspace.
    """
    folder = root / "src/rpbi_utils/schema"
    return {
        folder / f"{name}.schema.json": schema_text(explained(json_schema(model, name)))
        for name, model in FILES.items()
    }


def main() -> None:
    """Runs the command that writes the schemas anew."""
    write_schemas(schema_files)
