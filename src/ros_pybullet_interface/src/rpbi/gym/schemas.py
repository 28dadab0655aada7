"""JSON Schemas of the YAML files of environments: tasks and random variation."""

from pathlib import Path

from custom_ros_tools.schema.json_schema import Schema, json_schema, schema_texts

from .randomization import Randomization
from .tasks import TASKS

TYPE = "type"


def schemas() -> dict[str, Schema]:
    """Returns the schemas indexed by kind of file: `gym_TASK` for each task, and `gym_randomization`.

    If Gymnasium is not installed, the schemas of tasks are left out.
    """
    found = {f"gym_{name}": _of_task(name, schema) for name, schema in TASKS.schemas().items()}
    return {**found, "gym_randomization": json_schema(Randomization, "gym_randomization")}


def _of_task(name: str, schema: Schema) -> Schema:
    kind = {"description": "Type of the task.", "enum": [name]}
    return {
        **schema,
        "properties": {TYPE: kind, **schema["properties"]},
        "required": [TYPE, *schema.get("required", ())],
    }


def schema_files(root: Path) -> dict[Path, str]:
    """Returns the text of each schema file, indexed by path; `root` is the root folder of the workspace."""
    return schema_texts(root / "src/ros_pybullet_interface/schema", schemas())
