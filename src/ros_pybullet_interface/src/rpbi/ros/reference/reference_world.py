"""A world of one body of each type, with all that it can have in ROS, for the pages that tell of it."""

from __future__ import annotations

from typing import Any

import pybullet

from rpbi.bodies import BODY_TYPES
from rpbi.config.loading import CameraConfig, LoadedWorld
from rpbi.config.objects import ObjectConfig, load_object
from rpbi.config.sensors import RgbdSensorConfig
from rpbi.config.world import WorldConfig
from rpbi.world import World

FOLLOWED = "FRAME"
"""TF frame that its bodies follow."""
JOINT = "lbr_iiwa_joint_7"
"""Joint of its robots that has a force-torque sensor."""

_FILE = "reference"
_SHAPE = {"shapeType": "GEOM_SPHERE", "radius": 0.1}
_TF = {"object_tf": {"tf_id": FOLLOWED}}
_ROBOT: dict[str, Any] = {
    "loadURDF": {"fileName": "kuka_iiwa/model.urdf", "useFixedBase": True},
    "setJointMotorControlArray": {"controlMode": "POSITION_CONTROL"},
    "broadcast_link_states": True,
    "base_state_hz": 50.0,
    "enabled_joint_force_torque_sensors": [JOINT],
    "joint_trajectory_controller": {},
    "start_ik_callback": True,
    "contacts": {},
}
_OBJECTS: dict[str, dict[str, Any]] = {
    "visual": {"createVisualShape": _SHAPE, **_TF},
    "collision": {"createVisualShape": _SHAPE, "createCollisionShape": _SHAPE, "contacts": {}, **_TF},
    "dynamic": {
        "createVisualShape": _SHAPE,
        "createCollisionShape": _SHAPE,
        "changeDynamics": {},
        "baseMass": 1.0,
        "broadcast_hz": 50.0,
        "contacts": {},
    },
    "robot": {**_ROBOT, **_TF},
    "mobile_robot": {**_ROBOT, "planar_base": {}},
    "visual_robot": {
        "is_visual_robot": True,
        "loadURDF": _ROBOT["loadURDF"],
        "broadcast_link_states": True,
        "start_ik_callback": True,
        **_TF,
    },
    "urdf": {
        "loadURDF": {"fileName": "cube.urdf", "useFixedBase": True},
        "broadcast_hz": 50.0,
        "contacts": {},
        **_TF,
    },
    "soft": {"loadSoftBody": {"fileName": "cloth_z_up.obj", "useMassSpring": True}, "contacts": {}},
}
"""What the body of each type has; its name is its type."""
_MAIN = {
    "resetSimulation": {"flags": "RESET_USE_DEFORMABLE_WORLD"},
    "enable_keyboard_publisher": True,
    "enable_mouse_publisher": True,
    "publish_visualizer_image_hz": 10.0,
}
_CAMERA = {"name": "camera", "pointcloud": True, **_TF}


def reference_world() -> World:
    """Builds the world, without a window although its configuration asks for one."""
    objects = tuple(
        ObjectConfig(kind, load_object(kind, {"name": kind, **_OBJECTS[kind]}, _FILE, BODY_TYPES), _FILE)
        for kind in BODY_TYPES
    )
    camera = CameraConfig(RgbdSensorConfig.parse(_CAMERA, _FILE), _FILE)
    loaded = LoadedWorld(WorldConfig.parse(_MAIN, _FILE), objects, _FILE, (camera,))
    return World(loaded, connection_mode=pybullet.DIRECT)
