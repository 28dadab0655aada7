"""Generates docs/plugins.md, the page that lists all plug-ins."""

from collections.abc import Iterator
from pathlib import Path

from custom_ros_tools.plugin_table import PluginTable
from ik_ros.solvers import SOLVERS
from ik_ros.tasks import TASKS
from motion_primitives.primitives import PRIMITIVES
from operator_node.devices import DEVICES
from operator_node.haptics.devices import HAPTIC_DEVICES
from operator_node.mappings import MAPPINGS
from rpbi.bodies import BODY_TYPES
from rpbi.control.controllers import CONTROLLERS
from rpbi.gym.tasks import TASKS as GYM_TASKS
from rpbi.reference.markdown import WRITTEN_BY, code, page, table
from rpbi.sensors import SENSOR_TYPES
from rpbi_data.datasets.formats import FORMATS
from rpbi_examples.scenes import SCENES
from safe_robot.checks import CHECKS

TABLES: tuple[tuple[str, PluginTable, str], ...] = (
    ("Objects", BODY_TYPES, "[worlds](worlds.md)"),
    ("Sensors", SENSOR_TYPES, "[worlds](worlds.md)"),
    ("Controllers", CONTROLLERS, "[controllers](controllers.md)"),
    ("Solvers", SOLVERS, "[solvers](ik.md#solvers)"),
    ("Tasks", TASKS, "[tasks](ik_tasks.md)"),
    ("Tasks of environments", GYM_TASKS, "[environments](gym.md)"),
    ("Scenes", SCENES, "[examples](examples.md)"),
    ("Devices", DEVICES, "[devices](devices.md)"),
    ("Haptic devices", HAPTIC_DEVICES, "[haptics](haptics.md)"),
    ("Mappings", MAPPINGS, "[teleoperation](teleoperation.md)"),
    ("Checks", CHECKS, "[safety](safety.md)"),
    ("Primitives", PRIMITIVES, "[learning](learning.md)"),
    ("Data set formats", FORMATS, "[data sets](datasets.md)"),
)
"""For each kind of plug-in: heading, table of the plug-ins, and link to a page about them."""
HEAD = """\
The names below are valid as a `type` in YAML, or as a parameter of a node. A class of your own package is valid in the
same places, as `my_package.my_module:MyClass`; see [extending.md](extending.md)."""


def plugins_page() -> str:
    """Returns the text of docs/plugins.md."""
    return page([WRITTEN_BY, "# Plug-ins", HEAD, *_sections()])


def plugin_files(root: Path) -> dict[Path, str]:
    """Returns a dict with the page's text, indexed by the page's path in the workspace `root`."""
    return {root / "docs/plugins.md": plugins_page()}


def _sections() -> Iterator[str]:
    for heading, plugins, link in TABLES:
        yield f"## {heading}"
        yield f"More about them: {link}."
        yield table(("name", "class"), ((code(name), text) for name, text in plugins.summaries().items()))
