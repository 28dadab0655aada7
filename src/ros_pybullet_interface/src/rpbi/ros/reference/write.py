"""JSON Schemas and pages of the documentation that follow from the code."""

import re
from pathlib import Path

from custom_ros_tools.node_configs import NODE_CONFIGS
from custom_ros_tools.schema.json_schema import json_schema, schema_texts
from rpbi.reference.config_page import config_page
from rpbi.world.schemas import file_schemas, schemas

from .interface_page import interface_page
from .reference_world import reference_world

PACKAGES = ("ros_pybullet_interface", "compatibility/cob_srvs", "compatibility/custom_srvs")
"""Folders with the messages and services that the node has."""
FAVOURITE = "basic_example_kuka_lwr"
"""Folder of the examples that are shown first."""
_FIRST_LINE = re.compile(r"# yaml-language-server: .*/(\w+)\.schema\.json\n")


def reference_files(root: Path) -> dict[Path, str]:
    """Returns the text of each file that follows from the code, by its path.

    Args:
        root: The workspace.
    """
    nodes = {node: json_schema(model, node) for node, model in NODE_CONFIGS.items()}
    world = reference_world()
    try:
        topics = interface_page(world, _definitions(root))
    finally:
        world.close()
    return {
        **schema_texts(root / "src/ros_pybullet_interface/schema", schemas()),
        **schema_texts(root / "src/custom_ros_tools/schema", nodes),
        root / "docs/config_reference.md": config_page(file_schemas(), nodes, _examples(root)),
        root / "docs/topics_and_services.md": topics,
    }


def _examples(root: Path) -> dict[str, str]:
    """Returns an example of each kind of file; its first line, which names the schema, is for editors only."""
    examples: dict[str, str] = {}
    paths = (root / "src/rpbi_examples/configs").rglob("*.yaml")
    for path in sorted(paths, key=lambda path: (path.parent.name != FAVOURITE, len(path.parts), path)):
        text = path.read_text()
        named = _FIRST_LINE.match(text)
        if named:
            examples.setdefault(named[1], text[named.end() :])
    return examples


def _definitions(root: Path) -> dict[str, str]:
    files = [path for package in PACKAGES for path in sorted((root / "src" / package).glob("[ms][sr][gv]/*"))]
    return {f"{path.parent.parent.name}/{path.stem}": path.read_text() for path in files}
