"""The page of all YAML files and their keys."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from custom_ros_tools.schema.json_schema import Schema, yaml_text
from rpbi.config.schemas import WORLD, kind_of, sections

from .mappings import Mappings, is_list_of_files
from .markdown import WRITTEN_BY, block, code, link, page, table
from .type_words import constants_in, heading_of, mapping_in, type_in_words

INTRODUCTION = """\
Every YAML file of a world and every key in it. How to write worlds is told in [worlds.md](worlds.md), what they then
have in ROS in [topics_and_services.md](topics_and_services.md).

- Keys that are not listed here are errors.
- A key may be left out unless it is required. Where the default is empty, the meaning says what holds without it, or
  PyBullet's own default does.
- camelCase keys are arguments of the PyBullet function of the same name.
- Constants are given by name or by PyBullet's number, true and false as 1 and 0 too, whole numbers wherever a number is
  expected. YAML reads `1e-3` as text: write `1.0e-3`.
- An entry of a list of files is a file name, or a mapping with `file` and the keys that differ.
- Files are looked for beside the file that names them, in `setAdditionalSearchPath` and in PyBullet's data;
  `{package}/path` and `package://package/path` work everywhere.
- Editors complete, explain and check these keys, see [worlds.md](worlds.md#in-an-editor)."""
NODES = "What nodes read from `~config`; what they do is told in [custom_ros_tools.md](custom_ros_tools.md)."
GUIDES = {
    "world": "worlds.md",
    "robot": "robots.md",
    "urdf": "worlds.md",
    "soft_object": "soft_bodies.md",
    "object": "extending.md",
    "rgbd_sensor": "cameras.md",
    "configureDebugVisualizer": "gui.md",
    "resetDebugVisualizerCamera": "gui.md",
    "planar_base": "bases.md",
    "enabled_joint_force_torque_sensors": "force_torque.md",
    "joint_trajectory_controller": "trajectories.md",
    "contacts": "contacts.md",
    "changeDynamics": "dynamics.md",
    "sensors": "extending.md",
}
"""Page that tells how to use what is under a heading."""
HEAD = ("key", "type", "default", "meaning")


def config_page(files: Mapping[str, Schema], nodes: Mapping[str, Schema], examples: Mapping[str, str]) -> str:
    """Returns the page.

    Args:
        files: Schema of each kind of file.
        nodes: Schema of the parameter `~config` of each node that has one.
        examples: YAML text to show for some of the files.
    """
    mappings = Mappings(files)
    parts = [WRITTEN_BY, "# Configuration reference", INTRODUCTION, "## Files", _overview(files)]
    for kind, schema in files.items():
        parts += [f"## {kind}", _guide(kind), block("yaml", examples[kind]) if kind in examples else ""]
        parts += [_keys(schema, mappings), _old_keys(schema)]
        for place in mappings.of(kind):
            parts += [f"### {place.heading}", _guide(place.heading), _keys(place.schema, mappings)]
    parts += ["## Mappings that several files have"]
    for place in mappings.shared():
        owners = f"Of {', '.join(map(link, place.files))}. {_guide(place.heading)}"
        parts += [f"### {place.heading}", owners, _keys(place.schema, mappings)]
    parts += ["## Constants", *_constants(files)]
    parts += ["## Nodes", NODES]
    for node, schema in nodes.items():
        parts += [f"### {node}", *_node(node, schema)]
    return page(parts)


def _guide(heading: str) -> str:
    page_name = GUIDES.get(heading)
    return f"How to use it: [{page_name}]({page_name})." if page_name else ""


def _overview(files: Mapping[str, Schema]) -> str:
    lists = {kind_of(section): section for section in sections()}
    rows = []
    for kind, schema in files.items():
        named_by = "the main file itself" if kind == WORLD else code(lists[kind])
        rows.append((link(kind), named_by, schema["description"], code(f"{kind}.schema.json")))
    return table(("file", "named in the main file by", "what it is", "schema for editors"), rows)


def _keys(schema: Schema, mappings: Mappings) -> str:
    rows = []
    for key, value in schema["properties"].items():
        if "deprecated" not in value:
            rows.append((code(key), _type(key, value, mappings), _default(key, schema), value["description"]))
    more = schema.get("additionalProperties")
    if more is True:
        rows.append(("others", "", "", "What its class reads."))
    if isinstance(more, dict):
        rows.append((code("NAME"), _type("", more, mappings), "", more["description"]))
    return table(HEAD, rows)


def _type(key: str, value: Schema, mappings: Mappings) -> str:
    if is_list_of_files(value):
        return f"list of files, each {link(kind_of(key))}"
    words = type_in_words(value)
    mapping = mapping_in(value)
    return words if mapping is None else f"{words}, see {link(mappings.heading_of(mapping))}"


def _default(key: str, schema: Schema) -> str:
    if key in schema.get("required", ()):
        return "required"
    value = schema["properties"][key]
    return code(yaml_text(value["default"])) if "default" in value else ""


def _old_keys(schema: Schema) -> str:
    rows = [(code(key), advice) for key, advice in _deprecated(schema, "")]
    return "Older worlds may also have:\n\n" + table(("key", "what to do"), rows) if rows else ""


def _deprecated(schema: Schema, path: str) -> Iterator[tuple[str, str]]:
    for key, value in schema.get("properties", {}).items():
        if "deprecated" in value:
            yield f"{path}{key}", value["description"]
        elif not is_list_of_files(value):
            yield from _deprecated(value, f"{path}{key}.")


def _constants(files: Mapping[str, Schema]) -> Iterator[str]:
    families = {kind: names for schema in files.values() for kind, names in constants_in(schema)}
    for kind, names in sorted(families.items()):
        yield f"### {heading_of(kind)}"
        yield ", ".join(map(code, names)) + "."


def _node(node: str, schema: Schema) -> Iterator[str]:
    mappings = Mappings({node: schema})
    yield _keys(schema, mappings)
    for place in mappings.of(node):
        yield f"#### {place.heading}"
        yield _keys(place.schema, mappings)
