"""Motion: falling, swinging and bouncing."""

from __future__ import annotations

import math

from rpbi.config.pybullet_models import ChangeDynamics
from rpbi.world import World

from .friction import KINDS
from .scene import CLOSED_FORM, GRAVITY, UNDAMPED, Table, ball, box_floor, height, run, scene

TIME_STEPS_S = (1 / 240, 0.002, 0.001)
PYBULLET_DAMPING = 0.04
"""What PyBullet gives to whatever does not say otherwise, but not in maximal coordinates."""
LENGTH_M = 0.5
SWING = 0.5
"""Amplitude of the pendulum [rad]."""
PENDULUM = f"""<robot name="pendulum">
<link name="mount"/>
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
    return Table(("fallen in 1 s [m]", *map(_step_name, TIME_STEPS_S), CLOSED_FORM), rows)


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
        *((f"energy kept over 10 periods, {name}", (*found, 1.0)) for name, found in kept.items()),
    ]
    return Table(("pendulum", *map(_step_name, TIME_STEPS_S), CLOSED_FORM), rows)


def _energy_at_bottom(world: World, crossings: list[float]) -> float:
    """Returns the energy now, that is after 10.25 periods, over that at the start."""
    angle, speed = world.pb.getJointState(world.bodies["pendulum"].body_id, 0)[:2]
    now = 0.5 * (LENGTH_M * speed) ** 2 + GRAVITY * LENGTH_M * (1 - math.cos(angle))
    return now / (GRAVITY * LENGTH_M * (1 - math.cos(SWING)))


def bouncing() -> Table:
    """How high a ball comes back that fell from 1 m, by restitution and time step."""
    rows = []
    for restitution in (0.2, 0.5, 0.8, 1.0):
        found = []
        for time_step_s in TIME_STEPS_S:
            thing = ball("ball", 0.05, 1.05, changeDynamics={"restitution": restitution})
            with scene(time_step_s, collision_objects=[box_floor()], dynamic_objects=[thing]) as world:
                heights = []
                for _ in range(round(1.2 / time_step_s)):
                    world.step()
                    heights.append(height(world, "ball") - 0.05)
            lowest = heights.index(min(heights[: round(0.6 / time_step_s)]))
            found.append(max(heights[lowest:]))
        rows.append((f"`restitution: {restitution:g}`", (*found, restitution**2)))
    return Table(("rebound [m]", *map(_step_name, TIME_STEPS_S), CLOSED_FORM), rows)


def _step_name(time_step_s: float) -> str:
    return f"{1000 * time_step_s:.3g} ms"


def _arithmetic_geometric_mean(a: float, b: float) -> float:
    while abs(a - b) > 1e-15:
        a, b = (a + b) / 2, math.sqrt(a * b)
    return a
