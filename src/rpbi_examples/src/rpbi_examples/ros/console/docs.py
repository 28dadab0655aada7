"""The command `docs`."""

import pkgutil
from pathlib import Path

from custom_ros_tools.console.modules import workspace

WRITERS = (
    "ik_ros.node_configs:schema_files",
    "motion_primitives.node_configs:schema_files",
    "rpbi_mpc.node_configs:schema_files",
    "rpbi_utils.schemas:schema_files",
    "safe_robot.schemas:schema_files",
    "rpbi.gym.schemas:schema_files",
    "rpbi.reference.config_page:config_files",
    "rpbi.ros.interface_page:interface_files",
    "custom_ros_tools.console.page:console_files",
    "rpbi_examples.plugins_page:plugin_files",
)
"""Functions that return the text of each file, given the workspace."""


def files(root: Path) -> dict[Path, str]:
    """Returns the text of each file of a workspace that is generated from the code."""
    return {path: text for writer in WRITERS for path, text in pkgutil.resolve_name(writer)(root).items()}


def docs() -> None:
    """Generates the schemas for editors and the reference pages from the code."""
    root = workspace()
    for path, text in files(root).items():
        path.parent.mkdir(exist_ok=True)
        is_new = not path.exists() or path.read_text(encoding="utf-8") != text
        path.write_text(text, encoding="utf-8")
        print(f"{'written' if is_new else 'as it was'}: {path.relative_to(root)}")
