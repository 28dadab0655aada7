"""Writes the JSON Schemas and the pages of the documentation that follow from the code."""

from __future__ import annotations

import argparse
from pathlib import Path

from custom_ros_tools.node_configs import NODE_CONFIGS
from custom_ros_tools.schema.json_schema import Schema, explained, json_schema, schema_text
from rpbi.config.schemas import schemas
from rpbi.reference.config_page import config_page

from .interface_page import interface_page
from .reference_world import reference_world

PACKAGES = ("ros_pybullet_interface", "custom_ros_tools")
"""Those with messages and services of ours."""
EXAMPLES = {
    "world": "basic_example_kuka_lwr/config.yaml",
    "visual_object": "basic_example_kuka_lwr/work_area.yaml",
    "collision_object": "floor.yaml",
    "dynamic_object": "basic_example_kuka_lwr/box.yaml",
    "robot": "basic_example_kuka_lwr/kuka_lwr.yaml",
    "urdf": "soft_body/cube.yaml",
    "soft_object": "soft_body/torus.yaml",
}
"""File in rpbi_examples/configs that is shown for each kind."""


def reference_files(root: Path) -> dict[Path, str]:
    """Returns what the files should have that are written from the code.

    Args:
        root: The workspace.
    """
    worlds, nodes = schemas(), {node: json_schema(model, node) for node, model in NODE_CONFIGS.items()}
    examples = {kind: _example(root / "src/rpbi_examples/configs" / name) for kind, name in EXAMPLES.items()}
    world = reference_world()
    try:
        topics = interface_page(world, _definitions(root))
    finally:
        world.close()
    return {
        **_schema_files(root / "src/ros_pybullet_interface/schema", worlds),
        **_schema_files(root / "src/custom_ros_tools/schema", nodes),
        root / "docs/config_reference.md": config_page(worlds, nodes, examples),
        root / "docs/topics_and_services.md": topics,
    }


def main() -> None:
    """Runs the command."""
    parser = argparse.ArgumentParser(prog="./rpbi docs", description="Writes schemas and reference pages anew.")
    parser.add_argument("root", type=Path, help="the workspace")
    root = parser.parse_args().root
    for path, text in reference_files(root).items():
        path.parent.mkdir(exist_ok=True)
        is_new = not path.exists() or path.read_text() != text
        path.write_text(text)
        print(f"{'written' if is_new else 'as it was'}: {path.relative_to(root)}")


def _example(path: Path) -> str:
    """Returns the text of a file without the first line, which is for editors only and right for that place only."""
    return path.read_text().split("\n", 1)[1]


def _schema_files(folder: Path, by_name: dict[str, Schema]) -> dict[Path, str]:
    return {folder / f"{name}.schema.json": schema_text(explained(schema)) for name, schema in by_name.items()}


def _definitions(root: Path) -> dict[str, str]:
    files = [path for package in PACKAGES for path in sorted((root / "src" / package).glob("[ms][sr][gv]/*"))]
    return {f"{path.parent.parent.name}/{path.stem}": path.read_text() for path in files}
