"""Generates the reference page of all YAML files and their keys, and the JSON Schemas of these files."""

import re
from collections.abc import Container, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from custom_ros_tools.node_configs import NODE_CONFIGS
from custom_ros_tools.schema.json_schema import (
    Schema,
    json_schema,
    mapping_in,
    name_of,
    resolved,
    schema_texts,
    unit_in,
    yaml_text,
)
from custom_ros_tools.schema.type_names import constants_in, type_name
from rpbi.config.object_entry import FILES
from rpbi.world.legacy import MAIN, old_keys
from rpbi.world.schemas import WORLD, file_schemas, kind_of, schemas, sections

from .markdown import WRITTEN_BY, block, code, link, page, table

INTRODUCTION = """\
Every YAML file of a world and every key in it. For worlds see [worlds.md](worlds.md), for their topics and services
[topics_and_services.md](topics_and_services.md).

- Keys that are not listed here are errors.
- A key may be left out unless it is required. Where the default is empty, the meaning says what holds without it, or
  PyBullet's own default does.
- camelCase keys are arguments of the PyBullet function of the same name.
- Constants are given by name or by PyBullet's number, true and false as 1 and 0 too, whole numbers wherever a number is
  expected. YAML reads `1e-3` as text: write `1.0e-3`.
- An entry of a list of files is a file name, or a mapping with `file` and the keys that differ. `null` removes a
  key of the file, such as `controllers: null`.
- Files are looked for beside the file that names them, in `setAdditionalSearchPath` and in PyBullet's data;
  `{package}/path` and `package://package/path` work everywhere.
- Editors complete, explain and check these keys, see [worlds.md](worlds.md#in-an-editor)."""
NODES = "Keys of nodes in `~config`; for the nodes see [custom_ros_tools.md](custom_ros_tools.md)."
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
    "attachments": "hands.md",
    "coupled_joints": "hands.md",
    "changeDynamics": "dynamics.md",
    "sensors": "extending.md",
}
"""Page that explains the keys under a heading of the reference page, keyed by heading."""
HEAD = ("key", "type", "default", "meaning")
FIRST_EXAMPLES = "basic_example_kuka_lwr"
"""Folder from which the example of each kind of file is taken first; other folders follow."""
_SCHEMA_LINE = re.compile(r"# yaml-language-server: .*/(\w+)\.schema\.json\n")


class Place(NamedTuple):
    """A section of the reference page, about a mapping that occurs inside one or more kinds of files.

    Attributes:
        heading: Heading of the section: the mapping's path in the first file that contains the mapping.
        root: Schema of this first file.
        mapping: Schema of the mapping.
        files: Kinds of all files that contain the mapping.
    """

    heading: str
    root: Schema
    mapping: Schema
    files: list[str]


Places = dict[str, Place]
"""Places, keyed by the name of the mapping's definition, which is the same in all files."""


def config_files(root: Path) -> dict[Path, str]:
    """Returns the texts of the page and of all schemas, keyed by file path.

    Args:
        root: Folder of the workspace.
    """
    nodes = {node: json_schema(model, node) for node, model in NODE_CONFIGS.items()}
    return {
        **schema_texts(root / "src/ros_pybullet_interface/schema", schemas()),
        **schema_texts(root / "src/custom_ros_tools/schema", nodes),
        root / "docs/config_reference.md": config_page(file_schemas(), nodes, _examples(root)),
    }


def _examples(root: Path) -> dict[str, str]:
    """Returns the text of an example for each kind of file.

    Leaves out the first line, a comment that names the schema for editors.
    """
    examples: dict[str, str] = {}
    paths = (root / "src/rpbi_examples/configs").rglob("*.yaml")
    for path in sorted(paths, key=lambda path: (path.parent.name != FIRST_EXAMPLES, len(path.parts), path)):
        text = path.read_text()
        named = _SCHEMA_LINE.match(text)
        if named:
            examples.setdefault(named[1], text[named.end() :])
    return examples


def config_page(files: Mapping[str, Schema], nodes: Mapping[str, Schema], examples: Mapping[str, str]) -> str:
    """Returns the text of the reference page.

    Args:
        files: Schema of each kind of file, keyed by kind.
        nodes: Schema of each node's parameter `~config`, keyed by node.
        examples: YAML text to show for some kinds of files, keyed by kind.
    """
    places = _places(files)
    parts = [WRITTEN_BY, "# Configuration reference", INTRODUCTION, "## Files", _overview(files)]
    for kind, schema in files.items():
        parts += [f"## {kind}", _guide(kind), block("yaml", examples[kind]) if kind in examples else ""]
        parts += [_keys(schema, schema, places), _old_keys(kind)]
        for place in places.values():
            if place.files == [kind]:
                parts += [f"### {place.heading}", _guide(place.heading), _keys(place.mapping, place.root, places)]
    parts += ["## Mappings that several files have"]
    for place in sorted(places.values(), key=lambda place: place.heading.lower()):
        if len(place.files) > 1:
            owners = f"Of {', '.join(map(link, place.files))}. {_guide(place.heading)}"
            parts += [f"### {place.heading}", owners, _keys(place.mapping, place.root, places)]
    families = {each["kind"]: constants_in(each) for each in _constants(list(files.values()))}
    parts += ["## Constants"]
    for kind, names in sorted(families.items()):
        parts += [f"### {kind}s", ", ".join(map(code, names)) + "."]
    parts += ["## Nodes", NODES]
    listed: set[str] = set()
    for node, schema in nodes.items():
        places = _places({node: schema})
        parts += [f"### {node}", _keys(schema, schema, places)]
        for name, place in places.items():
            if name not in listed:  # else another node has the same mapping
                parts += [f"#### {place.heading}", _keys(place.mapping, schema, places)]
        listed.update(places)
    return page(parts)


def _places(files: Mapping[str, Schema]) -> Places:
    """Returns a `Place` for each mapping inside the files."""
    places: Places = {}
    for kind, root in files.items():
        for path, reference in _inside(root, root, "", files):
            known = places.setdefault(name_of(reference), Place(path, root, resolved(reference, root), []))
            known.files.extend({kind}.difference(known.files))
    return places


def _inside(mapping: Schema, root: Schema, path: str, files: Container[str]) -> Iterator[tuple[str, Schema]]:
    """Yields path and schema of each mapping nested in a mapping, except mappings with a file of their own.

    Args:
        mapping: Schema of the outer mapping.
        root: Schema of the whole file.
        path: Prefix of the paths.
        files: Kinds of files; mappings whose path is one of these are left out.
    """
    for key, value in _values(mapping).items():
        inner_path = f"{path}{key}"
        reference = mapping_in(value, root)
        if reference is not None and inner_path not in files:
            yield inner_path, reference
            yield from _inside(resolved(reference, root), root, f"{inner_path}.", files)


def _values(mapping: Schema) -> dict[str, Schema]:
    """Returns the schema of each key's value. If users may add keys, the key `NAME` stands for the added keys."""
    more = mapping.get("additionalProperties")
    return {**mapping["properties"], **({"NAME": more} if isinstance(more, dict) else {})}


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


def _keys(mapping: Schema, root: Schema, places: Places) -> str:
    rows = []
    for key, value in _values(mapping).items():
        meaning = resolved(value, root)["description"] if "description" not in value else value["description"]
        rows.append((code(key), _type(key, value, root, places), _default(key, mapping), meaning))
    if mapping.get("additionalProperties") is True:
        rows.append(("others", "", "", "Keys of its class."))
    return table(HEAD, rows)


def _type(key: str, value: Schema, root: Schema, places: Places) -> str:
    if value.get("items", {}).get("expects") == FILES:
        return f"list of files, each {link(kind_of(key))}"
    families = list(_constants(value))
    if families:
        several = " or several" if any("anyOf" in each for each in families) else ""
        return f"{link(families[0]['kind'] + 's')}, one{several}"
    unit = unit_in(value)
    words = type_name(value, detailed=True).removeprefix("a ") + (f" [{unit}]" if unit else "")
    mapping = mapping_in(value, root)
    if mapping is None:
        return words
    place = places.get(name_of(mapping))
    return f"{words}, see {link(place.heading if place else key)}"


def _default(key: str, mapping: Schema) -> str:
    if key in mapping.get("required", ()):
        return "required"
    value = mapping["properties"].get(key, {})
    return code(yaml_text(value["default"])) if "default" in value else ""


def _old_keys(kind: str) -> str:
    section = next((section for section in sections() if kind_of(section) == kind), MAIN)
    rows = [(code(key), advice) for key, advice in old_keys(section).items()]
    return "Older worlds may also have:\n\n" + table(("key", "what to do"), rows) if rows else ""


def _constants(schema: Any) -> Iterator[Schema]:
    """Yields the schemas of all families of constants inside a schema."""
    if isinstance(schema, dict):
        if isinstance(schema.get("kind"), str):
            yield schema
        schema = list(schema.values())
    for each in schema if isinstance(schema, list) else ():
        yield from _constants(each)
