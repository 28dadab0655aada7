"""JSON Schema of the YAML file that a guard loads as its parameters."""

from pathlib import Path
from typing import Any

from pydantic import Field, create_model

from custom_ros_tools.schema import ConfigModel
from custom_ros_tools.schema.json_schema import DEFINITIONS, Schema, explained, json_schema, schema_text, write_schemas

from .checks import CHECKS
from .config import GuardConfig, NodeConfig
from .lookup import check_class

TITLE = "guard"
_OWN_CHECK = r"^[\w.]+:\w+$"


def schema() -> Schema:
    """Returns what parameters of a guard and its node may be, with the options of all checks of the table."""
    text = "Options of checks by name."
    known: dict[str, Any] = {name: (check_class(name).Config, Field(default_factory=dict)) for name in CHECKS}
    model = create_model("Checks", __base__=ConfigModel, __doc__=text, **known)
    checks: Any = model, Field(default_factory=dict, description=text)
    both = create_model("Guard", __base__=(GuardConfig, NodeConfig), __doc__=GuardConfig.__doc__, checks=checks)
    found = json_schema(both, TITLE)
    found[DEFINITIONS]["Checks"]["patternProperties"] = {_OWN_CHECK: {"type": "object"}}
    return found


def schema_files(root: Path) -> dict[Path, str]:
    """Returns what the files should have.

    Args:
        root: The workspace.
    """
    return {root / f"src/safe_robot/schema/{TITLE}.schema.json": schema_text(explained(schema()))}


def main() -> None:
    """Runs the command that writes the schema anew."""
    write_schemas(schema_files)
