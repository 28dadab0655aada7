"""Friction: sliding, sticking, rolling and spinning."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from rpbi.geometry import Pose

from .scene import (
    CLOSED_FORM,
    GRAVITY,
    MAXIMAL,
    Cell,
    Span,
    Table,
    ball,
    box,
    box_floor,
    floor_of_tf,
    plane_floor,
    run,
    scene,
    velocity,
)

FRICTION = 0.5
HALF_M = (0.05, 0.05, 0.02)
DIRECTIONS_DEG = (0, 15, 30, 45, 60, 90)
YAWS_DEG = (0, 15, 30, 45)
SETTINGS: dict[str, dict[str, Any]] = {
    "default; the floor is a `GEOM_PLANE`": {"floor": plane_floor},
    "default": {},
    "`numSolverIterations: 500`": {"engine": {"numSolverIterations": 500, "solverResidualThreshold": 0.0}},
    "`numSubSteps: 4`": {"engine": {"numSubSteps": 4}},
    "`enableConeFriction: false`": {"engine": {"enableConeFriction": False}},
    "`CONSTRAINT_SOLVER_LCP_PGS`": {"engine": {"constraintSolverType": "CONSTRAINT_SOLVER_LCP_PGS"}},
    "`CONSTRAINT_SOLVER_LCP_DANTZIG`": {"engine": {"constraintSolverType": "CONSTRAINT_SOLVER_LCP_DANTZIG"}},
    "only the box has the key `useMaximalCoordinates`": {"box_keys": MAXIMAL},
    "both bodies have the key; the floor is a `GEOM_PLANE`": {
        "floor": plane_floor,
        "floor_keys": MAXIMAL,
        "box_keys": MAXIMAL,
    },
    "both bodies have the key; TF places the floor": {
        "floor": floor_of_tf,
        "floor_keys": MAXIMAL,
        "box_keys": MAXIMAL,
    },
    "both bodies have the key; TF places the floor; `contactBreakingThreshold: 0.1`": {
        "floor": floor_of_tf,
        "floor_keys": MAXIMAL,
        "box_keys": MAXIMAL,
        "engine": {"contactBreakingThreshold": 0.1},
    },
    "**both bodies have the key `useMaximalCoordinates`**": {"floor_keys": MAXIMAL, "box_keys": MAXIMAL},
}


class Slide(NamedTuple):
    """Deceleration of a sliding box.

    Attributes:
        force: Mean deceleration over that of Coulomb's law.
        off_deg: Its direction, from straight against the motion [deg].
    """

    force: float
    off_deg: float


def slide(
    direction_deg: float,
    yaw_deg: float,
    speed_m_s: float = 2.0,
    time_step_s: float = 0.001,
    floor: Any = box_floor,
    floor_keys: dict[str, Any] | None = None,
    box_keys: dict[str, Any] | None = None,
    engine: dict[str, Any] | None = None,
) -> Slide:
    """Slides a box over a floor and returns its deceleration, over up to 0.2 s."""
    x, y = math.cos(math.radians(direction_deg)), math.sin(math.radians(direction_deg))
    start = {"linearVelocity": [speed_m_s * x, speed_m_s * y, 0.0]}
    keys = {"resetBaseVelocity": start, "changeDynamics": {"lateralFriction": FRICTION}, **(box_keys or {})}
    thing = box("box", HALF_M, yaw=math.radians(yaw_deg), **keys)
    with scene(time_step_s, engine, collision_objects=[floor(**(floor_keys or {}))], dynamic_objects=[thing]) as world:
        if floor is floor_of_tf:
            world.put("floor/pose", Pose((0.0, 0.0, -0.5)))
        run(world, 0.02)
        before = velocity(world, "box")[0]
        ticks = round(min(0.2, 0.4 * speed_m_s / (FRICTION * GRAVITY)) / time_step_s)
        run(world, ticks * time_step_s)
        after = velocity(world, "box")[0]
    lost_x, lost_y = ((old - new) / (ticks * time_step_s) for old, new in zip(before[:2], after[:2]))
    off = math.atan2(x * lost_y - y * lost_x, x * lost_x + y * lost_y)
    return Slide(math.hypot(lost_x, lost_y) / (FRICTION * GRAVITY), math.degrees(off))


def sliding() -> Table:
    """Direction of sliding by yaw of the box, by default and in maximal coordinates."""
    rows = []
    for direction in DIRECTIONS_DEG:
        cells = []
        for keys in ({}, {"floor_keys": MAXIMAL, "box_keys": MAXIMAL}):
            for yaw in YAWS_DEG:
                found = slide(direction, yaw, speed_m_s=0.5, **keys)
                cells.append(f"{found.force:.3f}, {abs(found.off_deg):.1f}")
        rows.append((f"{direction} deg", tuple(cells)))
    names = (f"{kind}, yaw {yaw} deg" for kind in ("default", "maximal") for yaw in YAWS_DEG)
    return Table(("direction of motion", *names), rows)


def sliding_by_setting() -> Table:
    """The worst over all directions and yaws, by setting, time step and speed."""
    rows = []
    for name, keys in SETTINGS.items():
        cells: list[Cell] = []
        for time_step_s, speed_m_s in ((0.001, 0.5), (0.001, 2.0), (0.002, 2.0)):
            found = [
                slide(direction, yaw, speed_m_s, time_step_s, **keys)
                for direction in (0, 30, 45, 75)
                for yaw in (0, 15, 45)
            ]
            forces = [each.force for each in found]
            cells += [Span(min(forces), max(forces)), round(max(abs(each.off_deg) for each in found), 1)]
        rows.append((name, tuple(cells)))
    names = ("1 kHz, 0.5 m/s", "1 kHz, 2 m/s", "500 Hz, 2 m/s")
    measured = ("friction / (mu m g)", "direction error [deg]")
    return Table(("setting", *(f"{what}, {name}" for name in names for what in measured)), rows)


KINDS = {"default": {}, "maximal": MAXIMAL}


def slope() -> Table:
    """The angle at which a box on a slope begins to slide, by the direction of the slope and the box's yaw."""
    closed = math.degrees(math.atan(FRICTION))
    rows = []
    for direction, yaw in ((0, 0), (0, 45), (45, 0), (30, 15)):
        found = [_angle_of_slip(direction, yaw, keys) for keys in KINDS.values()]
        rows.append((f"slope direction {direction} deg, yaw {yaw} deg", (*found, closed)))
    return Table(("slip angle [deg]", *KINDS, CLOSED_FORM), rows)


def _angle_of_slip(direction_deg: float, yaw_deg: float, keys: dict[str, Any]) -> float:
    """Returns the angle of slip to 0.05 deg, by bisection."""
    sticks, slides = 20.0, 35.0
    while slides - sticks > 0.05:
        angle = (sticks + slides) / 2
        if _speed_on_slope(angle, direction_deg, yaw_deg, keys, 0.5) > 0.005:
            slides = angle
        else:
            sticks = angle
    return round((sticks + slides) / 2, 1)


def _speed_on_slope(
    angle_deg: float,
    direction_deg: float,
    yaw_deg: float,
    keys: dict[str, Any],
    seconds: float,
    time_step_s: float = 0.001,
) -> float:
    """Returns how fast a box goes after so long on a slope, from rest [m/s]."""
    angle, direction = math.radians(angle_deg), math.radians(direction_deg)
    along = GRAVITY * math.sin(angle)
    gravity = (along * math.cos(direction), along * math.sin(direction), -GRAVITY * math.cos(angle))
    thing = box("box", HALF_M, yaw=math.radians(yaw_deg), changeDynamics={"lateralFriction": FRICTION}, **keys)
    floors = [box_floor(**keys)]
    with scene(time_step_s, gravity=gravity, collision_objects=floors, dynamic_objects=[thing]) as world:
        run(world, seconds)
        return math.hypot(*velocity(world, "box")[0])


def creep() -> Table:
    """How fast a box creeps that should stick, at a share of the slope that it holds on."""
    rows = []
    for share in (0.5, 0.9):
        angle = math.degrees(math.atan(share * FRICTION))
        for time_step_s in (0.001, 0.002, 0.004):
            found = [1000.0 * _speed_on_slope(angle, 30.0, 15.0, keys, 3.0, time_step_s) for keys in KINDS.values()]
            rows.append((f"load {share:.0%}, time step {1000 * time_step_s:g} ms", (*found, 0.0)))
    return Table(("creep speed [mm/s]", *KINDS, CLOSED_FORM), rows)


def turning() -> Table:
    """How a ball of 0.1 m is braked that rolls, and one that spins."""
    radius, coefficient, inertia = 0.1, 0.01, 0.4 * 0.1**2
    rolling = coefficient * GRAVITY / radius / (1.0 + inertia / radius**2)
    spinning = coefficient * GRAVITY / inertia
    cases = {
        "rolling, `rollingFriction: 0.01` [m/s^2]": (
            {"rollingFriction": coefficient},
            {"linearVelocity": [1.0, 0.0, 0.0], "angularVelocity": [0.0, 1.0 / radius, 0.0]},
            lambda world: (1.0 - velocity(world, "ball")[0][0]) / 0.5,
            rolling,
        ),
        "spinning, `spinningFriction: 0.01` [rad/s^2]": (
            {"spinningFriction": coefficient},
            {"angularVelocity": [0.0, 0.0, 30.0]},
            lambda world: (30.0 - velocity(world, "ball")[1][2]) / 0.5,
            spinning,
        ),
        "spinning, `spinningFriction: 0.01`, `rollingFriction: 1.0e-6` [rad/s^2]": (
            {"spinningFriction": coefficient, "rollingFriction": 1e-6},
            {"angularVelocity": [0.0, 0.0, 30.0]},
            lambda world: (30.0 - velocity(world, "ball")[1][2]) / 0.5,
            spinning,
        ),
    }
    rows = []
    for name, (dynamics, start, measure, closed) in cases.items():
        found = []
        for keys in KINDS.values():
            thing = ball("ball", radius, changeDynamics=dynamics, resetBaseVelocity=start, **keys)
            with scene(collision_objects=[box_floor(**keys)], dynamic_objects=[thing]) as world:
                run(world, 0.5)
                found.append(measure(world))
        rows.append((name, (*found, closed)))
    return Table(("deceleration", *KINDS, CLOSED_FORM), rows)
