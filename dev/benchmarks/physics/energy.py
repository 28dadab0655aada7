"""Energy that motion and contact gain or lose: a body that tumbles freely, and Newton's cradle."""

from __future__ import annotations

import math

import numpy as np
import pybullet

from rpbi.world import World

from .friction import KINDS
from .motion import TIME_STEPS_S, step_name
from .scene import CLOSED_FORM, GRAVITY, UNDAMPED, Cell, Table, box, run, scene

BRICK_HALF_M = (0.05, 0.1, 0.15)
SPIN = [0.1, 5.0, 0.1]
"""Angular velocity near the axis of the middle moment of inertia [rad/s], about which the brick flips over."""
BALLS = 5
RADIUS_M = 0.05
ROPE_M = 0.5
RAISED = 0.5
"""Angle from which the first ball of the cradle falls [rad]."""
INERTIA = 0.001
"""Moment of inertia of a ball about its centre [kg m^2]."""
PENDULUM = f"""<robot name="pendulum">
<link name="mount"/>
<link name="ball">
  <inertial><origin xyz="0 0 {-ROPE_M}"/><mass value="1"/>
    <inertia ixx="{INERTIA}" ixy="0" ixz="0" iyy="{INERTIA}" iyz="0" izz="{INERTIA}"/></inertial>
  <collision><origin xyz="0 0 {-ROPE_M}"/><geometry><sphere radius="{RADIUS_M}"/></geometry></collision></link>
<joint name="hinge" type="continuous"><parent link="mount"/><child link="ball"/><axis xyz="0 1 0"/></joint>
</robot>"""
ENGINES = {"default": {}, "`contactERP: 0.0`": {"contactERP": 0.0}}


def tumbling() -> Table:
    """Energy of a brick that flips over again and again without forces, after 10 s."""
    rows = []
    for kind, keys in KINDS.items():
        found = []
        for time_step_s in TIME_STEPS_S:
            brick = box("brick", BRICK_HALF_M, 1.0, **keys)
            brick["resetBaseVelocity"] = {"linearVelocity": [0.0, 0.0, 0.0], "angularVelocity": SPIN}
            with scene(time_step_s, gravity=(0.0, 0.0, 0.0), dynamic_objects=[brick]) as world:
                at_start = _spinning(world)
                run(world, 10.0)
                found.append(_spinning(world) / at_start)
        rows.append((kind, (*found, 1.0)))
    return Table(("energy after 10 s / initial energy", *map(step_name, TIME_STEPS_S), CLOSED_FORM), rows)


def _spinning(world: World) -> float:
    """Returns the energy of the brick's rotation [J]."""
    brick = world.bodies["brick"]
    turned = np.reshape(pybullet.getMatrixFromQuaternion(brick.base_pose().quat_xyzw), (3, 3))
    velocity = turned.T @ brick.base_twist().angular
    return float(0.5 * velocity @ (brick.dynamics_info(-1)[2] * velocity))


def cradling() -> Table:
    """Energy of five balls in a row, of restitution 1, of which the first one swings against the others."""
    rows: list[tuple[str, tuple[Cell, ...]]] = []
    for name, engine in ENGINES.items():
        columns = [_cradle_energies(time_step_s, engine) for time_step_s in TIME_STEPS_S]
        for after, found in zip(("after 1 s", "after 10 s"), zip(*columns)):
            rows.append((f"{name}, {after}", (*found, 1.0)))
    return Table(("energy / initial energy", *map(step_name, TIME_STEPS_S), CLOSED_FORM), rows)


def _cradle_energies(time_step_s: float, engine: dict[str, float]) -> tuple[float, float]:
    """Returns the energy after 1 s and after 10 s, over that at the start."""
    pendulums = [
        {
            "name": f"pendulum{index}",
            "urdf": PENDULUM,
            "loadURDF": {"useFixedBase": True, "basePosition": [2 * RADIUS_M * index, 0.0, 1.0]},
        }
        for index in range(BALLS)
    ]
    with scene(time_step_s, engine=engine, urdfs=pendulums) as world:
        for name in world.bodies:
            world.change_dynamics(f"{name}/mount", UNDAMPED)
            world.change_dynamics(f"{name}/ball", {**UNDAMPED, "restitution": 1.0, "lateralFriction": 0.0})
        world.pb.resetJointState(world.bodies["pendulum0"].body_id, 0, RAISED)
        at_start = _swinging(world)
        run(world, 1.0)
        early = _swinging(world) / at_start
        run(world, 9.0)
        return early, _swinging(world) / at_start


def _swinging(world: World) -> float:
    """Returns the energy of all pendulums [J]."""
    total = 0.0
    for body in world.bodies.values():
        angle, speed = world.pb.getJointState(body.body_id, 0)[:2]
        total += 0.5 * (ROPE_M**2 + INERTIA) * speed**2 + GRAVITY * ROPE_M * (1 - math.cos(angle))
    return total
