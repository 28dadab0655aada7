"""Starts RViz with displays for the contact forces and camera images of the running world."""

import logging
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import rospkg
import rospy
import yaml

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.files import atomic_file
from rpbi.config.sensors import FIRST_TOPIC_NAME
from rpbi.world.loading import LoadedWorld, load_world

_log = logging.getLogger(__name__)
CONFIG = "-d"
"""Option of RViz for the configuration file."""


def main() -> None:
    """Replaces this process with RViz. RViz receives this process's arguments, and displays for the running world.

    RViz starts without these displays if no simulator runs, if the simulator's world was not loaded from a file, or if
    this file is invalid. The simulator reports an invalid file.
    """
    arguments = sys.argv[1:]
    place = arguments.index(CONFIG) + 1
    config = yaml.safe_load(Path(arguments[place]).read_text(encoding="utf-8"))
    try:
        world = _world()
        config["Visualization Manager"]["Displays"] += _displays_of(world)
        target = Path(rospkg.get_ros_home()) / "rviz" / f"{Path(world.file).parent.name}_{Path(world.file).stem}.rviz"
        target.parent.mkdir(parents=True, exist_ok=True)
        with atomic_file(target) as part:
            part.write_text(yaml.safe_dump(config, sort_keys=False), encoding="utf-8")
        arguments[place] = str(target)
    except (InterfaceError, OSError, KeyError) as error:
        _log.warning("RViz has no displays for contacts and cameras: %s", error)
    os.execvp("rviz", ["rviz", *arguments])


def _world() -> LoadedWorld:
    """Loads the files of the world that the simulator in this namespace runs."""
    logging.getLogger("rpbi").setLevel(logging.ERROR)  # warnings are logged by the simulator
    given = rospy.get_param("ros_pybullet_interface")
    file = given["config_file"]
    if not file.startswith(("{", "package://")):
        file = os.path.join(str(given.get("working_directory", "")).rstrip("\n"), file)
    return load_world(file, overrides=given.get("config") or {})


def _displays_of(world: LoadedWorld) -> Iterator[dict[str, Any]]:
    """Yields RViz displays for contact forces and camera images. Only the first camera's display is switched on."""
    for each in world.objects:
        contacts = getattr(each.config, "contacts", None)
        if contacts is not None and contacts.arrows_hz:
            topic = f"rpbi/{each.config.name}/contacts/arrows"
            yield _display(
                "MarkerArray", f"Forces on {each.config.name}", True, {"Marker Topic": topic, "Queue Size": 10}
            )
    for number, camera in enumerate(world.cameras):
        name = FIRST_TOPIC_NAME if number == 0 else camera.config.name
        options = {"Image Topic": f"rpbi/{name}/colour/image", "Transport Hint": "raw", "Queue Size": 2}
        yield _display("Image", f"Image of {camera.config.name}", number == 0, options)


def _display(kind: str, name: str, is_on: bool, options: dict[str, Any]) -> dict[str, Any]:
    return {"Class": f"rviz/{kind}", "Name": name, "Enabled": is_on, "Value": is_on, **options}
