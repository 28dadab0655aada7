"""JSON Schemas of the YAML files that solver nodes load as their parameters."""

from pathlib import Path

from pydantic import create_model

from custom_ros_tools.schema.json_schema import (
    DEFINITIONS,
    Schema,
    json_schema,
    schema_texts,
    with_definitions,
)

from .node_configs import SolverNodeParameters
from .solvers import SOLVERS
from .tasks import TASKS

_OWN_TYPE = "own_type"
LISTS_OF_TASKS = ("constraints", "costs")


def schemas() -> dict[str, Schema]:
    """Returns the schemas by solver, of those whose libraries are installed."""
    found = {}
    for name, config in SOLVERS.configs().items():
        both = create_model(config.__name__, __base__=(config, SolverNodeParameters), __doc__=config.__doc__)
        found[name] = json_schema(both, name)
    if "tasks" in found:
        definitions = {**found["tasks"].get(DEFINITIONS, {}), **_tasks()}
        any_task = {"anyOf": [{"$ref": f"#/{DEFINITIONS}/{kind}"} for kind in (*TASKS, _OWN_TYPE)]}
        for key in LISTS_OF_TASKS:
            found["tasks"]["properties"][key]["items"] = any_task
        found["tasks"] = with_definitions(found["tasks"], definitions)
    return found


def _tasks() -> dict[str, Schema]:
    """Returns the definitions of all types of tasks, with the definitions that they refer to."""
    own_type = {"type": "string", "pattern": r"^[\w.]+:\w+$"}
    definitions: dict[str, Schema] = {
        _OWN_TYPE: {"type": "object", "properties": {"type": own_type}, "required": ["type"]}
    }
    for kind, schema in TASKS.schemas().items():
        definitions |= schema.pop(DEFINITIONS, {})
        schema["properties"] = {**schema["properties"], "type": {"enum": [kind]}}
        definitions[kind] = {key: value for key, value in schema.items() if key != "$schema"}
    return definitions


def schema_files(root: Path) -> dict[Path, str]:
    """Returns the text of each file of a workspace."""
    return schema_texts(root / "src/ik_ros/schema", schemas())
