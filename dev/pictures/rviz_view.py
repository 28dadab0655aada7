"""RViz configurations for pictures, and the camera of RViz's view."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml
from render import Photographer

FIELD_OF_VIEW_DEG = 45.0
"""Vertical opening of RViz's view [deg]."""
POINT_SIZE = "Size (Pixels)"
WORLDS = "rpbi/markers"
"""End of the topics on which worlds publish their bodies."""
FLOORS = ("floor", "ground", "plane")
"""Bodies that pictures do not show: RViz lights them from the camera, so they are dark in a view from the side."""
GRID = {"Cell Size": 0.25, "Plane Cell Count": 40, "Color": "208; 213; 220", "Offset": {"X": 0.0, "Y": 0.0, "Z": 0.0}}
"""Properties of the grid, which replaces the floor."""


def rviz_content(
    config: Path, displays: Mapping[str, Mapping[str, Any] | None], view: Mapping[str, Any], scale: int = 2
) -> dict[str, Any]:
    """Returns an RViz configuration without panels, images and floors, and with a fine grid instead of a floor.

    Args:
        config: The `.rviz` file.
        displays: Properties that replace those of displays, or None to remove the display, indexed by its name. A
            display with the property `Class` is added.
        view: Properties of the view that replace those of the file.
        scale: Factor of the sizes that RViz has in pixels.

    Raises:
        KeyError: If the file has no such display.
    """
    content: dict[str, Any] = yaml.safe_load(config.read_text(encoding="utf-8"))
    manager = content["Visualization Manager"]
    content["Panels"] = []
    manager["Views"]["Current"].update(view)
    shown = {each["Name"]: each for each in manager["Displays"]}
    for name, properties in displays.items():
        if properties is None:
            del shown[name]
        elif "Class" in properties:
            shown[name] = {"Name": name, "Enabled": True, "Value": True, **properties}
        else:
            shown[name].update(properties)
    for each in shown.values():
        if each["Class"] == "rviz/Grid":
            each.update(GRID)
        if str(each.get("Marker Topic", "")).endswith(WORLDS):
            each["Namespaces"] = {**dict.fromkeys(FLOORS, False), **(each.get("Namespaces") or {})}
        if POINT_SIZE in each:
            each[POINT_SIZE] *= scale
    manager["Displays"] = [each for each in shown.values() if each["Class"] != "rviz/Image"]
    return content


def rviz_camera(
    focus: Sequence[float], distance_m: float, pitch_rad: float, yaw_rad: float, size: tuple[int, int]
) -> Photographer:
    """Returns the camera of an orbit view, for labels at points of the world.

    Args:
        focus: Point that the view turns about, in the world's frame [m].
        distance_m: Distance of the camera from this point [m].
        pitch_rad: Angle of the camera above the horizontal plane [rad].
        yaw_rad: Angle of the camera about the vertical [rad].
        size: Columns and rows of the picture [px].
    """
    level = math.cos(pitch_rad)
    away = (math.cos(yaw_rad) * level, math.sin(yaw_rad) * level, math.sin(pitch_rad))
    position = [centre + distance_m * each for centre, each in zip(focus, away)]
    return Photographer(position, focus, FIELD_OF_VIEW_DEG, size)
