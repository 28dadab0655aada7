"""Motion: falling, swinging and bouncing."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from rpbi.config.pybullet_models import ChangeDynamics
from rpbi.world import World

from .friction import KINDS
from .scene import (
    CLOSED_FORM,
    GRAVITY,
    MAXIMAL,
    UNDAMPED,
    Span,
    Table,
    ball,
    box_floor,
    floor_of_tf,
    height,
    plane_floor,
    run,
    scene,
)

TIME_STEPS_S = (1 / 240, 0.002, 0.001)
PYBULLET_DAMPING = 0.04
"""Defaults of PyBullet, except in maximal coordinates."""
LENGTH_M = 0.5
SWING = 0.5
"""Amplitude of the pendulum [rad]."""
PENDULUM = f"""<robot name="pendulum">
<link name="mount"><inertial><mass value="1"/>
  <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
<link name="rod"><inertial><origin xyz="0 0 {-LENGTH_M}"/><mass value="1"/>
  <inertia ixx="1e-9" ixy="0" ixz="0" iyy="1e-9" iyz="0" izz="1e-9"/></inertial></link>
<joint name="hinge" type="continuous"><parent link="mount"/><child link="rod"/><axis xyz="0 1 0"/></joint>
</robot>"""


def falling() -> Table:
    """How far a ball falls in a second."""
    rows = []
    for name, damping in (("damping not given", {}), ("damping 0", UNDAMPED)):
        for kind, keys in KINDS.items():
            found = []
            for time_step_s in TIME_STEPS_S:
                thing = {**ball("ball", 0.1, 100.0, **keys), "changeDynamics": dict(damping)}
                with scene(time_step_s, dynamic_objects=[thing]) as world:
                    run(world, 1.0)
                    found.append(100.0 - height(world, "ball"))
            rows.append((f"{name}, {kind}", (*found, GRAVITY / 2)))
    return Table(("distance fallen in 1 s [m]", *map(step_name, TIME_STEPS_S), CLOSED_FORM), rows)


def swinging() -> Table:
    """Period of a pendulum of 0.5 m, and the energy that it loses in ten periods."""
    closed_s = 2 * math.pi * math.sqrt(LENGTH_M / GRAVITY) / _arithmetic_geometric_mean(1.0, math.cos(SWING / 2))
    periods, kept = [], {"damping not given": [], "damping 0": []}
    for time_step_s in TIME_STEPS_S:
        for name, damping in (("damping not given", {}), ("damping 0", UNDAMPED)):
            thing = {"name": "pendulum", "urdf": PENDULUM, "loadURDF": {"useFixedBase": True}}
            with scene(time_step_s, urdfs=[thing]) as world:
                for link in ("mount", "rod") if damping else ():
                    world.change_dynamics(f"pendulum/{link}", ChangeDynamics(**damping))
                body = world.bodies["pendulum"]
                world.pb.resetJointState(body.body_id, 0, SWING)
                crossings = []
                before = SWING
                while len(crossings) < 21:
                    world.step()
                    angle = world.pb.getJointState(body.body_id, 0)[0]
                    if angle * before < 0:
                        share = before / (before - angle)
                        crossings.append((world.clock.tick - 1 + share) * time_step_s)
                    before = angle
                kept[name].append(_energy_at_bottom(world, crossings))
                if damping:
                    periods.append((crossings[20] - crossings[0]) / 10)
    rows = [
        ("period [s], damping 0", (*periods, closed_s)),
        *((f"energy after 10 periods / initial energy, {name}", (*found, 1.0)) for name, found in kept.items()),
    ]
    return Table(("quantity", *map(step_name, TIME_STEPS_S), CLOSED_FORM), rows)


def _energy_at_bottom(world: World, crossings: list[float]) -> float:
    """Returns the energy now, that is after 10.25 periods, over that at the start."""
    angle, speed = world.pb.getJointState(world.bodies["pendulum"].body_id, 0)[:2]
    now = 0.5 * (LENGTH_M * speed) ** 2 + GRAVITY * LENGTH_M * (1 - math.cos(angle))
    return now / (GRAVITY * LENGTH_M * (1 - math.cos(SWING)))


UNTHROWN = {"useSplitImpulse": True, "splitImpulsePenetrationThreshold": 0.0}
"""Penetration is mended without making things faster, but only in maximal coordinates."""
REBOUND = "rebound height / exact rebound height"
REBOUNDS: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "default": ({}, {}),
    "`numSubSteps: 4`": ({}, {"numSubSteps": 4}),
    "`contactERP: 0.0`": ({}, {"contactERP": 0.0}),
    "maximal": (MAXIMAL, {}),
    "maximal, `useSplitImpulse: true`, `splitImpulsePenetrationThreshold: 0.0`": (MAXIMAL, UNTHROWN),
}


def bouncing() -> Table:
    """How high a ball comes back that fell from 1 m and a little more, over the square of restitution."""
    rows = []
    for name, (keys, engine) in REBOUNDS.items():
        cells = []
        for restitution in (0.5, 0.8, 1.0):
            floor = box_floor(**keys)
            found = [rebound(restitution, 1.0 + 0.0041 * index, keys, engine, floor) for index in range(5)]
            cells.append(Span(min(found), max(found)))
        rows.append((name, tuple(cells)))
    return Table((REBOUND, *(f"`restitution: {each}`" for each in (0.5, 0.8, 1.0))), rows)


FLOORS: dict[str, Callable[..., dict[str, Any]]] = {
    "box moved by `collisionFramePosition`": box_floor,
    "box placed by `basePosition`": lambda **keys: floor_of_tf(basePosition=[0.0, 0.0, -0.5], object_tf=None, **keys),
    "`GEOM_PLANE`": plane_floor,
}


def bouncing_by_floor() -> Table:
    """Measures the rebound ratio of a ball with restitution 1 from ten heights 0.5 mm apart, for each kind of floor."""
    rows = []
    for name, (keys, engine) in REBOUNDS.items():
        cells = []
        for floor in FLOORS.values():
            found = [rebound(1.0, 1.0 + 0.0005 * index, keys, engine, floor(**keys)) for index in range(10)]
            cells.append(Span(min(found), max(found)))
        rows.append((name, tuple(cells)))
    return Table((REBOUND, *FLOORS), rows)


def rebound(
    restitution: float, height_m: float, keys: dict[str, Any], engine: dict[str, Any], floor: dict[str, Any]
) -> float:
    """Returns how high a ball comes back at 1 kHz, over the closed form; 0 if it stays down."""
    thing = ball("ball", 0.05, 0.05 + height_m, changeDynamics={"restitution": restitution}, **keys)
    with scene(engine=engine, collision_objects=[floor], dynamic_objects=[thing]) as world:
        heights = []
        for _ in range(1100):
            world.step()
            heights.append(height(world, "ball") - 0.05)
    lowest = heights.index(min(heights[:600]))
    return max(0.0, *heights[lowest:]) / (restitution**2 * height_m)


def step_name(time_step_s: float) -> str:
    """Returns a time step as the head of a column."""
    return f"time step {1000 * time_step_s:.3g} ms"


def _arithmetic_geometric_mean(a: float, b: float) -> float:
    while abs(a - b) > 1e-15:
        a, b = (a + b) / 2, math.sqrt(a * b)
    return a
