"""The measured worlds: the example's arm on the example's floor, and others."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

CONFIGS = Path(__file__).parents[2] / "src" / "rpbi_examples" / "configs"
CAMERA = {
    "name": "camera",
    "hz": 30,
    "intrinsics": {"width": 640, "height": 480, "fov": 40, "range": [0.1, 10.0]},
    "object_tf": {"tf_id": "rpbi/camera"},
}


def arm_world(
    folder: Path, hz: float, joint_states_hz: float | None = None, tf: bool = True, **main: Any
) -> dict[str, Any]:
    """Returns the main configuration of the arm on the floor, at rest.

    Args:
        folder: Where its files are written to.
        hz: Steps a second.
        joint_states_hz: Rate of the joint states; without it, that of the steps.
        tf: Whether the links are on TF, 50 times a second.
        main: Further keys of the main configuration.
    """
    arm = yaml.safe_load((CONFIGS / "basic_example_kuka_lwr" / "kuka_lwr.yaml").read_text())
    arm |= {"joint_state_publisher_hz": joint_states_hz or hz, "broadcast_link_states": tf}
    del arm["enabled_joint_force_torque_sensors"]
    return {
        "connect": {"connection_mode": "DIRECT"},
        "setGravity": {"gravZ": -9.81},
        "timeStep": 1.0 / hz,
        "collision_objects": [str(CONFIGS / "floor.yaml")],
        "robots": [_write(folder, arm)],
        **main,
    }


def crowded_world(folder: Path, hz: float, count: int = 30, **main: Any) -> dict[str, Any]:
    """Returns the arm among balls and boxes that bounce in a pen and never come to rest.

    Args:
        folder: Where its files are written to.
        hz: Steps and joint states a second.
        count: How many objects move, each with its pose on TF 50 times a second.
        main: Further keys of the main configuration.
    """
    world = arm_world(folder, hz, **main)
    bouncy = {"restitution": 1.0, "lateralFriction": 0.2, "linearDamping": 0.0, "angularDamping": 0.0}
    floor = yaml.safe_load((CONFIGS / "floor.yaml").read_text())
    floor["changeDynamics"] = {"restitution": 1.0}
    world["collision_objects"] = [_write(folder, floor)]
    for index, (x, y) in enumerate([(0.8, 0.0), (-0.8, 0.0), (0.0, 0.8), (0.0, -0.8)]):
        wide, long = 0.05 if x else 0.8, 0.05 if y else 0.8
        wall = {
            "name": f"wall_{index}",
            "createCollisionShape": {
                "shapeType": "GEOM_BOX",
                "halfExtents": [wide, long, 2.0],
                "collisionFramePosition": [x, y, 2.0],
            },
            "createVisualShape": {
                "shapeType": "GEOM_BOX",
                "halfExtents": [wide, long, 0.05],
                "visualFramePosition": [x, y, 0.05],
            },
            "changeDynamics": {"restitution": 1.0},
        }
        world["collision_objects"].append(_write(folder, wall))
    world["dynamic_objects"] = []
    for index in range(count):
        shape: dict[str, Any] = {"shapeType": "GEOM_SPHERE", "radius": 0.05}
        if index % 2:
            shape = {"shapeType": "GEOM_BOX", "halfExtents": [0.05, 0.04, 0.06]}
        item = {
            "name": f"object_{index:02}",
            "createVisualShape": shape,
            "createCollisionShape": shape,
            "changeDynamics": bouncy,
            "baseMass": 0.2,
            "basePosition": [-0.55 + 0.22 * (index % 6), -0.5 + 0.25 * (index // 6), 0.8 + 0.02 * index],
            "resetBaseVelocity": {"linearVelocity": [0.3, -0.2, 0.0], "angularVelocity": [3.0, 5.0, 2.0]},
            "broadcast_hz": 50,
        }
        world["dynamic_objects"].append(_write(folder, item))
    return world


def write_main(folder: Path, world: dict[str, Any]) -> Path:
    """Writes a main configuration as a file and returns its path."""
    path = folder / "world.yaml"
    path.write_text(yaml.safe_dump(world))
    return path


def _write(folder: Path, item: dict[str, Any]) -> str:
    path = folder / f"{item['name']}.yaml"
    path.write_text(yaml.safe_dump(item))
    return str(path)
