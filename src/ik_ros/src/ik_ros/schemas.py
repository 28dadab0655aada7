"""JSON Schemas of the YAML files that solver nodes load as their parameters."""

from __future__ import annotations

from custom_ros_tools.errors import MissingDependency
from custom_ros_tools.schema.json_schema import Schema, json_schema

from .lookup import solver_class
from .node_configs import SolverNodeParameters
from .solvers import SOLVERS

LISTS_OF_TASKS = ("constraints", "costs")


def schemas() -> dict[str, Schema]:
    """Returns the schemas by solver, of those whose libraries are installed."""
    found = {}
    for name in SOLVERS:
        try:
            config = solver_class(name).Config
        except MissingDependency:
            continue
        schema = json_schema(config, name)
        node = json_schema(SolverNodeParameters, name)
        if name == "tasks":
            for key in LISTS_OF_TASKS:
                schema["properties"][key]["items"] = {"anyOf": _tasks()}
        found[name] = {**schema, "properties": {**schema["properties"], **node["properties"]}}
    return found


def _tasks() -> list[Schema]:
    """Returns the schemas of the types of tasks, and one for types of others."""
    # Their classes need what the solver needs, which is not asked for before it is known to be there
    from ik_ros.formulation.formulation import task_class

    from .tasks import TASKS

    known = []
    for kind in TASKS:
        schema = json_schema(task_class(kind).Config, kind)
        known.append({**schema, "properties": {**schema["properties"], "type": {"enum": [kind]}}})
    for schema in known:
        del schema["$schema"]
    own_type = {"type": "string", "pattern": r"^[\w.]+:\w+$"}
    return [*known, {"type": "object", "properties": {"type": own_type}, "required": ["type"]}]
