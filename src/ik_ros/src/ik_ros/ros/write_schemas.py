"""Writes the JSON Schemas that follow from the code."""

from __future__ import annotations

import argparse
from pathlib import Path

from custom_ros_tools.schema.json_schema import explained, schema_text
from ik_ros.schemas import schemas


def schema_files(root: Path) -> dict[Path, str]:
    """Returns what the files should have.

    Args:
        root: The workspace.
    """
    folder = root / "src/ik_ros/schema"
    return {folder / f"{name}.schema.json": schema_text(explained(schema)) for name, schema in schemas().items()}


def main() -> None:
    """Runs the command."""
    parser = argparse.ArgumentParser(description="Writes schemas anew.")
    parser.add_argument("root", type=Path, help="the workspace")
    for path, text in schema_files(parser.parse_args().root).items():
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
