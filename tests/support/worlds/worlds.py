"""Small worlds for tests."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

FLOOR: dict[str, Any] = {
    "name": "floor",
    "createVisualShape": {"shapeType": "GEOM_BOX", "halfExtents": [2.0, 2.0, 0.005]},
    "createCollisionShape": {"shapeType": "GEOM_PLANE", "planeNormal": [0.0, 0.0, 1.0]},
    "changeDynamics": {"lateralFriction": 1.0},
}

BOX_FLOOR: dict[str, Any] = {
    **FLOOR,
    "createCollisionShape": {
        "shapeType": "GEOM_BOX",
        "halfExtents": [2.0, 2.0, 0.5],
        "collisionFramePosition": [0.0, 0.0, -0.5],
    },
}


def ball(name: str = "ball", radius_m: float = 0.1, **more: Any) -> dict[str, Any]:
    """Returns the configuration of a ball."""
    shape = {"shapeType": "GEOM_SPHERE", "radius": radius_m}
    return {
        "name": name,
        "createVisualShape": shape,
        "createCollisionShape": shape,
        "changeDynamics": {"linearDamping": 0.0, "angularDamping": 0.0, "rollingFriction": 0.0},
        "baseMass": 1.0,
        **more,
    }


def box(name: str = "box", half_extents_m: tuple[float, float, float] = (0.1, 0.1, 0.1), **more: Any) -> dict[str, Any]:
    """Returns the configuration of a box."""
    shape = {"shapeType": "GEOM_BOX", "halfExtents": list(half_extents_m)}
    return {
        "name": name,
        "createVisualShape": shape,
        "createCollisionShape": shape,
        "changeDynamics": {"lateralFriction": 0.5},
        "baseMass": 1.0,
        **more,
    }


def iiwa(name: str = "iiwa", **more: Any) -> dict[str, Any]:
    """Returns the configuration of PyBullet's own KUKA iiwa."""
    return {
        "name": name,
        "loadURDF": {"fileName": "kuka_iiwa/model.urdf", "useFixedBase": True},
        "setJointMotorControlArray": {"controlMode": "POSITION_CONTROL"},
        **more,
    }


def write_world(
    folder: Path,
    visual: tuple[dict[str, Any], ...] = (),
    collision: tuple[dict[str, Any], ...] = (),
    dynamic: tuple[dict[str, Any], ...] = (),
    robots: tuple[dict[str, Any], ...] = (),
    soft: tuple[dict[str, Any], ...] = (),
    urdfs: tuple[dict[str, Any], ...] = (),
    **main: Any,
) -> str:
    """Writes a world's files into a folder and returns the path of the main one."""
    config: dict[str, Any] = {
        "connect": {"connection_mode": "DIRECT"},
        "setGravity": {"gravZ": -9.81},
        "timeStep": 0.001,
        **main,
    }
    sections = {
        "visual_objects": visual,
        "collision_objects": collision,
        "dynamic_objects": dynamic,
        "robots": robots,
        "soft_objects": soft,
        "urdfs": urdfs,
    }
    for section, objects in sections.items():
        for item in objects:
            (folder / f"{item['name']}.yaml").write_text(yaml.safe_dump(item))
        if objects:
            config[section] = [f"{item['name']}.yaml" for item in objects]
    path = folder / "world.yaml"
    path.write_text(yaml.safe_dump(config))
    return str(path)
