"""Generates the reference pages of all YAML files and their keys, and the JSON Schemas of these files."""

import re
import textwrap
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

from .config_texts import (
    BEGINNINGS,
    COMMON,
    GUIDES,
    INTRODUCTION,
    NODES,
    NODES_EXAMPLE,
    OBJECTS,
    OVERVIEW,
    PAGES,
    SHARED,
)
from .markdown import WRITTEN_BY, block, code, link, page, table

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
Homes = Mapping[str, str]
"""Page of each section, keyed by heading."""


def config_files(root: Path) -> dict[Path, str]:
    """Returns the texts of the pages and of all schemas, keyed by file path.

    Args:
        root: Folder of the workspace.
    """
    nodes = {node: json_schema(model, node) for node, model in NODE_CONFIGS.items()}
    return {
        **schema_texts(root / "src/ros_pybullet_interface/schema", schemas()),
        **schema_texts(root / "src/custom_ros_tools/schema", nodes),
        **{root / "docs" / name: text for name, text in config_pages(file_schemas(), nodes, _examples(root)).items()},
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


def config_pages(
    files: Mapping[str, Schema], nodes: Mapping[str, Schema], examples: Mapping[str, str]
) -> dict[str, str]:
    """Returns the texts of the reference pages, keyed by page.

    Args:
        files: Schema of each kind of file, keyed by kind.
        nodes: Schema of each node's parameter `~config`, keyed by node.
        examples: YAML text to show for some kinds of files, keyed by kind.
    """
    places = _places(files)
    constants = {each["kind"] + "s": constants_in(each) for each in _constants(list(files.values()))}
    homes = {
        **dict.fromkeys(constants, COMMON),
        **{each.heading: _home(each) for each in places.values()},
        **{kind: PAGES.get(kind, OBJECTS) for kind in files},
    }
    parts: dict[str, list[str]] = {name: [] for name in BEGINNINGS}
    for kind, schema in files.items():
        shown = block("yaml", examples[kind]) if kind in examples else ""
        parts[homes[kind]] += [f"## {kind}", _guide(kind), shown, _keys(schema, schema, places, homes), _old_keys(kind)]
        for place in places.values():
            if place.files == [kind]:
                keys = _keys(place.mapping, place.root, places, homes)
                parts[homes[kind]] += [f"### {place.heading}", _guide(place.heading), keys]
    for place in sorted(places.values(), key=lambda place: place.heading.lower()):
        if len(place.files) > 1:
            owners = ", ".join(link(kind, homes[kind]) for kind in place.files)
            about = f"A mapping of {owners}. {_guide(place.heading)}"
            keys = _keys(place.mapping, place.root, places, homes)
            parts[homes[place.heading]] += [f"## {place.heading}", about, keys]
    parts[COMMON] += ["## Constants"]
    for family, names in sorted(constants.items()):
        parts[COMMON] += [f"### {family}", ", ".join(map(code, names)) + "."]
    parts[NODES] += [block("xml", NODES_EXAMPLE), *_nodes(nodes)]
    overview = [WRITTEN_BY, "# Configuration reference", INTRODUCTION, "## Files", _overview(files, homes), _others()]
    return {OVERVIEW: page(overview), **{name: _page(name, each) for name, each in parts.items()}}


def _home(place: Place) -> str:
    """Returns the page of a mapping: that of its only kind of file, or a page of shared mappings."""
    if len(place.files) == 1:
        return PAGES.get(place.files[0], OBJECTS)
    return SHARED.get(place.heading, COMMON)


def _page(name: str, parts: list[str]) -> str:
    title, beginning = BEGINNINGS[name]
    rules = f"For rules that hold for all files see [{OVERVIEW}]({OVERVIEW})."
    first = textwrap.fill(f"{beginning} {rules}", 120, break_on_hyphens=False)
    return page([WRITTEN_BY, f"# {title}", first, *parts]).replace(f"]({name}#", "](#")


def _nodes(nodes: Mapping[str, Schema]) -> Iterator[str]:
    """Yields headings and tables of the nodes' keys."""
    listed: set[str] = set()
    for node, schema in nodes.items():
        places = _places({node: schema})
        homes = {place.heading: NODES for place in places.values()}
        yield f"## {node}"
        yield _keys(schema, schema, places, homes)
        for name, place in places.items():
            if name not in listed:  # else another node has the same mapping
                yield f"### {place.heading}"
                yield _keys(place.mapping, schema, places, homes)
        listed.update(places)


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


def _overview(files: Mapping[str, Schema], homes: Homes) -> str:
    lists = {kind_of(section): section for section in sections()}
    rows = []
    for kind, schema in files.items():
        named_by = "the main file itself" if kind == WORLD else code(lists[kind])
        rows.append((link(kind, homes[kind]), named_by, schema["description"], code(f"{kind}.schema.json")))
    return table(("file", "named in the main file by", "meaning", "schema for editors"), rows)


def _others() -> str:
    """Returns a sentence with links to the pages that are not about kinds of files."""
    common, nodes = (f"[{BEGINNINGS[name][0].partition(': ')[2]}]({name})" for name in (COMMON, NODES))
    return f"Two more pages have {common}, and the configuration of {nodes}."


def _keys(mapping: Schema, root: Schema, places: Places, homes: Homes) -> str:
    rows = []
    for key, value in _values(mapping).items():
        meaning = resolved(value, root)["description"] if "description" not in value else value["description"]
        linked = re.sub(r"\bdocs/(\w+\.md)", r"[\1](\1)", meaning)
        rows.append((code(key), _type(key, value, root, places, homes), _default(key, mapping), linked))
    if mapping.get("additionalProperties") is True:
        rows.append(("others", "", "", "Keys of its class."))
    return table(HEAD, rows)


def _type(key: str, value: Schema, root: Schema, places: Places, homes: Homes) -> str:
    if value.get("items", {}).get("expects") == FILES:
        return f"list of files, each {link(kind_of(key), homes[kind_of(key)])}"
    families = list(_constants(value))
    if families:
        several = " or several" if any("anyOf" in each for each in families) else ""
        return f"{link(families[0]['kind'] + 's', COMMON)}, one{several}"
    unit = unit_in(value)
    words = type_name(value, detailed=True).removeprefix("a ") + (f" [{unit}]" if unit else "")
    mapping = mapping_in(value, root)
    if mapping is None:
        return words
    place = places.get(name_of(mapping))
    heading = place.heading if place else key
    return f"{words}, see {link(heading, homes[heading])}"


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
