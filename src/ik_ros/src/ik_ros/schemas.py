"""JSON Schemas of the YAML files that solver nodes load as their parameters."""

from contextlib import suppress
from pathlib import Path

from pydantic import create_model

from custom_ros_tools.errors import MissingDependency
from custom_ros_tools.schema.json_schema import (
    DEFINITIONS,
    Schema,
    explained,
    json_schema,
    json_schemas,
    schema_text,
    with_definitions,
    write_schemas,
)

from .lookup import solver_class
from .node_configs import SolverNodeParameters
from .solvers import SOLVERS
from .tasks import TASKS

_OWN_TYPE = "own_type"
LISTS_OF_TASKS = ("constraints", "costs")


def schemas() -> dict[str, Schema]:
    """Returns the schemas by solver, of those whose libraries are installed."""
    found = {}
    for name in SOLVERS:
        with suppress(MissingDependency):
            config = solver_class(name).Config
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
    """Returns the definitions of the types of tasks, one for types of others, and those that they refer to."""
    # Their classes need what the solver needs, which is not asked for before it is known to be there
    from ik_ros.formulation.formulation import task_class

    own_type = {"type": "string", "pattern": r"^[\w.]+:\w+$"}
    definitions: dict[str, Schema] = {
        _OWN_TYPE: {"type": "object", "properties": {"type": own_type}, "required": ["type"]}
    }
    for kind, schema in json_schemas({kind: task_class(kind).Config for kind in TASKS}).items():
        definitions |= schema.pop(DEFINITIONS, {})
        schema["properties"] = {**schema["properties"], "type": {"enum": [kind]}}
        definitions[kind] = {key: value for key, value in schema.items() if key != "$schema"}
    return definitions


def schema_files(root: Path) -> dict[Path, str]:
    """Returns what the files should have.

    Args:
        root: The workspace.
    """
    folder = root / "src/ik_ros/schema"
    return {folder / f"{name}.schema.json": schema_text(explained(schema)) for name, schema in schemas().items()}


def main() -> None:
    """Runs the command that writes the schemas anew."""
    write_schemas(schema_files)
