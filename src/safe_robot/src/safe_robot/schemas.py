"""JSON Schema of the YAML file that a guard loads as its parameters."""

from pathlib import Path
from typing import Any

from pydantic import Field, create_model

from custom_ros_tools.schema import ConfigModel
from custom_ros_tools.schema.json_schema import DEFINITIONS, Schema, json_schema, schema_texts

from .checks import CHECKS
from .config import GuardConfig, NodeConfig

TITLE = "guard"
_OWN_CHECK = r"^[\w.]+:\w+$"


def schema() -> Schema:
    """Returns the schema of the parameters of a guard and its node, with the options of all checks in `CHECKS`."""
    text = "Options of checks by name."
    known: dict[str, Any] = {name: (config, Field(default_factory=dict)) for name, config in CHECKS.configs().items()}
    model = create_model("Checks", __base__=ConfigModel, __doc__=text, **known)
    checks: Any = model, Field(default_factory=dict, description=text)
    both = create_model("Guard", __base__=(GuardConfig, NodeConfig), __doc__=GuardConfig.__doc__, checks=checks)
    found = json_schema(both, TITLE)
    found[DEFINITIONS]["Checks"]["patternProperties"] = {_OWN_CHECK: {"type": "object"}}
    return found


def schema_files(root: Path) -> dict[Path, str]:
    """Returns the text of each schema file, indexed by the file's path.

    Args:
        root: Root folder of the workspace.
    """
    return schema_texts(root / "src/safe_robot/schema", {TITLE: schema()})
