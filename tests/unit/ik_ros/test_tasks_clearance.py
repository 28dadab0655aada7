"""Distances between spheres, capsules and boxes."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pybullet
import pytest

from ik_ros.shape import RoundedCore, ShapeConfig
from ik_ros.tasks.clearance import clearance

SHAPES = {"sphere": {"sphere": 0.1}, "capsule": {"capsule": [0.1, 0.6]}, "box": {"box": [0.3, 0.5, 0.7]}}


def placed(kind: str, position: np.ndarray, rotation: np.ndarray) -> tuple[RoundedCore, pin.SE3]:
    return ShapeConfig.parse({"name": kind, **SHAPES[kind]}, "test").core, pin.SE3(rotation, position)


@pytest.fixture(scope="module")
def client():
    client = pybullet.connect(pybullet.DIRECT)
    yield client
    pybullet.disconnect(client)


def body(kind: str, client: int) -> int:
    if kind == "sphere":
        shape = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=0.1, physicsClientId=client)
    elif kind == "capsule":
        shape = pybullet.createCollisionShape(pybullet.GEOM_CAPSULE, radius=0.1, height=0.6, physicsClientId=client)
    else:
        half = [0.15, 0.25, 0.35]
        shape = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half, physicsClientId=client)
    return pybullet.createMultiBody(0, shape, physicsClientId=client)


@pytest.mark.parametrize("first", SHAPES)
@pytest.mark.parametrize("second", SHAPES)
def test_distances_agree_with_pybullet(client, first, second):
    generator = np.random.default_rng(0)
    bodies = [body(kind, client) for kind in (first, second)]
    apart = 0
    for _ in range(200):
        poses = [(generator.normal(0.0, 0.7, 3), generator.normal(size=4)) for _ in bodies]
        rotations = [np.array(pybullet.getMatrixFromQuaternion(quat / np.linalg.norm(quat))) for _, quat in poses]
        for one, (position, quat) in zip(bodies, poses):
            pybullet.resetBasePositionAndOrientation(one, position, quat / np.linalg.norm(quat), physicsClientId=client)
        shapes = [
            placed(kind, position, rotation.reshape(3, 3))
            for kind, (position, _), rotation in zip((first, second), poses, rotations)
        ]
        found = clearance(*shapes[0], *shapes[1])
        closest = pybullet.getClosestPoints(*bodies, distance=10.0, physicsClientId=client)
        expected = min(point[8] for point in closest)
        if expected > 0.02:  # PyBullet is exact outside only
            assert found.distance == pytest.approx(expected, abs=2e-3)
            assert np.linalg.norm(found.direction) == pytest.approx(1.0)
            apart += 1
        else:
            assert found.distance < 0.03
    assert apart > 50


@pytest.mark.parametrize("kinds", [("sphere", "box"), ("box", "box"), ("sphere", "sphere"), ("capsule", "capsule")])
def test_coinciding_shapes_have_a_direction_of_separation(kinds):
    shapes = [placed(kind, np.zeros(3), np.eye(3)) for kind in kinds]
    found = clearance(*shapes[0], *shapes[1])
    assert found.distance < -0.05
    assert np.linalg.norm(found.direction) == pytest.approx(1.0)
    assert np.isfinite(np.concatenate((found.first, found.second))).all()


def test_directions_point_from_the_first_to_the_second():
    box, ball = placed("box", np.zeros(3), np.eye(3)), placed("sphere", np.array((1.0, 0.0, 0.0)), np.eye(3))
    assert clearance(*box, *ball).direction == pytest.approx([1.0, 0.0, 0.0], abs=1e-6)
    assert clearance(*ball, *box).direction == pytest.approx([-1.0, 0.0, 0.0], abs=1e-6)
    assert clearance(*ball, *box).distance == pytest.approx(1.0 - 0.15 - 0.1)
