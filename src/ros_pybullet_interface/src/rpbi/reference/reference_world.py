"""A world for the reference pages: one body of each type, with all interfaces that bodies can have."""

import pybullet

from rpbi.bodies import BODY_TYPES
from rpbi.config.sensors import RgbdSensorConfig
from rpbi.config.world import WorldConfig
from rpbi.world import World
from rpbi.world.loading import CameraConfig, LoadedWorld
from rpbi.world.objects import ObjectConfig, load_object

FOLLOWED = "FRAME"
"""TF frame that the world's bodies follow."""
(JOINT,) = BODY_TYPES["robot"].example["enabled_joint_force_torque_sensors"]
"""Joint of the world's robots that has a force-torque sensor."""
CONTROLLERS = tuple(BODY_TYPES["robot"].example["controllers"])
"""Names of the controllers of the world's robots."""

_FILE = "reference"
_MAIN = {
    "resetSimulation": {"flags": "RESET_USE_DEFORMABLE_WORLD"},
    "enable_keyboard_publisher": True,
    "enable_mouse_publisher": True,
    "publish_visualizer_image_hz": 10.0,
    "poses": [{"tf_id": FOLLOWED}],
}
_CAMERA = {"name": "camera", "pointcloud": True, "object_tf": {"tf_id": FOLLOWED}}


def reference_world() -> World:
    """Builds the world without opening PyBullet's window."""
    objects = tuple(
        ObjectConfig(kind, load_object(kind, {"name": kind, **BODY_TYPES[kind].example}, _FILE), _FILE)
        for kind in BODY_TYPES
    )
    camera = CameraConfig(RgbdSensorConfig.parse(_CAMERA, _FILE), _FILE)
    loaded = LoadedWorld(WorldConfig.parse(_MAIN, _FILE), objects, _FILE, (camera,))
    return World(loaded, connection_mode=pybullet.DIRECT)
