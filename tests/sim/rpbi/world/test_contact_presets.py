"""Contact presets and the centre of mass of dynamic objects."""

from __future__ import annotations

import numpy as np
import pybullet
import pytest

from custom_ros_tools.errors import ConfigError
from rpbi.bodies.dynamic import DynamicObjectConfig
from rpbi.config.contact_presets import CONTACT_PRESETS
from rpbi.config.world import WorldConfig
from rpbi.geometry import Pose
from rpbi.world import World
from rpbi.world.loading import LoadedWorld, load_object

BALL = {"shapeType": "GEOM_SPHERE", "radius": 0.05}
FLOOR = {"shapeType": "GEOM_BOX", "halfExtents": [2.0, 2.0, 0.5], "collisionFramePosition": [0.0, 0.0, -0.5]}


def ball(**keys) -> DynamicObjectConfig:
    config = {"name": "ball", "createVisualShape": BALL, "createCollisionShape": BALL, "baseMass": 0.5, **keys}
    return DynamicObjectConfig.parse(config, "ball.yaml")


def test_preset_gives_defaults_that_own_keys_replace():
    preset = CONTACT_PRESETS["impact"].body["changeDynamics"]
    dynamics = ball(contact_preset="impact", changeDynamics={"lateralFriction": 0.9}).changeDynamics
    assert dynamics.lateralFriction == 0.9 and dynamics.contactStiffness == preset["contactStiffness"]
    assert ball().changeDynamics is None
    world = WorldConfig.parse({"contact_preset": "bounce", "setPhysicsEngineParameter": {"erp": 0.1}}, "world.yaml")
    assert world.timeStep == CONTACT_PRESETS["bounce"].world["timeStep"]
    assert world.setPhysicsEngineParameter.kwargs() == {"contactERP": 0.0, "erp": 0.1}
    assert WorldConfig.parse({"contact_preset": "bounce", "timeStep": 0.002}, "world.yaml").timeStep == 0.002
    assert WorldConfig.parse({}, "world.yaml").timeStep == 0.02


def test_unknown_preset_is_refused_with_a_suggestion():
    with pytest.raises(
        ConfigError, match="ball.yaml: contact_preset: there is no preset 'impakt'; did you mean 'impact'"
    ):
        ball(contact_preset="impakt")


def _world(main: dict) -> World:
    world = World(LoadedWorld(WorldConfig.parse(main, "world.yaml"), (), "world.yaml"), connection_mode=pybullet.DIRECT)
    visual = {"shapeType": "GEOM_BOX", "halfExtents": [2.0, 2.0, 0.5]}
    floor = {"name": "floor", "createVisualShape": visual, "createCollisionShape": FLOOR}
    world.add("collision", load_object("collision", {**floor, "changeDynamics": {"restitution": 1.0}}, "floor.yaml"))
    return world


def _rebound(main: dict, height: float) -> float:
    """Returns the rebound height of a ball with restitution 0.5, divided by the exact one."""
    world = _world({"setGravity": {"gravZ": -9.81}, **main})
    try:
        keys = {"contact_preset": "bounce", "changeDynamics": {"restitution": 0.5}}
        body, top = world.add("dynamic", ball(basePosition=[0.0, 0.0, height + 0.05], **keys)), 0.0
        for _ in range(int(0.8 / world.clock.dt_s)):
            world.step()
            if world.clock.time_s > 0.4:
                top = max(top, body.base_pose().position[2] - 0.05)
        return top / (0.25 * height)
    finally:
        world.close()


def test_rebound_with_the_preset_does_not_depend_on_the_tick():
    heights = 0.6 + 0.00037 * np.arange(6)
    assert [_rebound({"contact_preset": "bounce"}, height) for height in heights] == pytest.approx([1.0] * 6, abs=0.03)
    plain = [_rebound({"timeStep": 0.001}, height) for height in heights]
    assert max(plain) - min(plain) > 0.1


def test_body_turns_about_its_centre_of_mass():
    world = _world({"timeStep": 0.001})
    try:
        spin = {"angularVelocity": [0.0, 0.0, 2.0]}
        keys = {"changeDynamics": {"angularDamping": 0.0, "linearDamping": 0.0}, "resetBaseVelocity": spin}
        body = world.add(
            "dynamic", ball(basePosition=[0.0, 0.0, 1.0], baseInertialFramePosition=[0.01, 0.0, 0.0], **keys)
        )
        assert body.base_pose().position == pytest.approx((0.0, 0.0, 1.0), abs=1e-6)
        centres = []
        for _ in range(500):
            world.step()
            pose = body.base_pose()
            centres.append((pose @ Pose((0.01, 0.0, 0.0))).position)
        assert np.array(centres) == pytest.approx(np.tile([0.01, 0.0, 1.0], (500, 1)), abs=1e-5)
        assert body.base_pose().position[1] == pytest.approx(-0.01 * np.sin(1.0), abs=1e-4)
    finally:
        world.close()


def test_centre_of_mass_is_refused_in_maximal_coordinates():
    world = _world({})
    try:
        with pytest.raises(ConfigError, match="baseInertialFramePosition: the centre of mass"):
            world.add("dynamic", ball(baseInertialFramePosition=[0.01, 0.0, 0.0], useMaximalCoordinates=True))
    finally:
        world.close()


@pytest.mark.parametrize("keys", [{"contactFriction": {"edge": 0.3, "face": 0.5}}, {}])
def test_friction_on_faces_differs_from_friction_on_corners(keys):
    world = _world({"timeStep": 0.001, "setGravity": {"gravZ": -9.81}})
    world.change_dynamics("floor", {"lateralFriction": 1.0})
    try:
        box = {"shapeType": "GEOM_BOX", "halfExtents": [0.05, 0.05, 0.02]}
        shapes = {"createVisualShape": box, "createCollisionShape": box, "basePosition": [0.0, 0.0, 0.02]}
        moving = {"resetBaseVelocity": {"linearVelocity": [1.0, 0.0, 0.0]}, "changeDynamics": {"lateralFriction": 0.1}}
        body = world.add("dynamic", ball(**shapes, **moving, **keys))
        for _ in range(100):
            world.step()
        lost = 1.0 - body.base_twist().linear[0]
        assert lost == pytest.approx((0.5 if keys else 0.1) * 0.981, rel=0.1)
    finally:
        world.close()


@pytest.mark.parametrize("keyframe", [False, True])
def test_friction_by_contacts_is_restored_exactly(keyframe):
    world = _world({"timeStep": 0.002, "setGravity": {"gravZ": -9.81}})
    try:
        box = {"shapeType": "GEOM_BOX", "halfExtents": [0.05, 0.05, 0.05]}
        shapes = {"createVisualShape": box, "createCollisionShape": box, "basePosition": [0.0, 0.0, 0.15]}
        turned = {"baseOrientation": [0.3, 0.1, 0.2, np.sqrt(0.86)], "contactFriction": {"edge": 0.3, "face": 0.6}}
        moving = {"resetBaseVelocity": {"linearVelocity": [1.0, 0.3, 0.0]}, "changeDynamics": {"lateralFriction": 0.1}}
        world.add("dynamic", ball(**shapes, **turned, **moving))
        for _ in range(120):
            world.step()
        state = world.save(keyframe=keyframe)
        for _ in range(80):
            world.step()
        after = world.state_hash()
        world.restore(state)
        for _ in range(80):
            world.step()
        assert world.state_hash() == after
    finally:
        world.close()
