"""Contact: resting, soft contacts, stacks, and heavy things on light ones."""

from __future__ import annotations

from typing import Any

from rpbi.samples import ContactsSample
from rpbi.world import World

from .friction import KINDS
from .scene import CLOSED_FORM, GRAVITY, MAXIMAL, Table, ball, box, box_floor, height, run, scene

HALF_M = 0.05
TOLD = {"contacts": {"hz": 100, "arrows_hz": 0}}


def floor_force(world: World, seconds: float) -> float:
    """Returns the mean downward force on the floor over a time [N]."""
    forces = []
    for _ in range(round(seconds / world.config.timeStep)):
        forces += [each.force[2] for each in world.step() if isinstance(each, ContactsSample) and each.name == "floor"]
    return -sum(forces) / len(forces)


def resting() -> Table:
    """Penetration of a resting box of 1 kg in the floor, and the force on the floor."""
    depths, forces = [], []
    steps_s = (1 / 240, 0.002, 0.001)
    for time_step_s in steps_s:
        for keys in KINDS.values():
            thing = box("box", (HALF_M, HALF_M, HALF_M), **keys)
            with scene(time_step_s, collision_objects=[box_floor(**TOLD, **keys)], dynamic_objects=[thing]) as world:
                run(world, 2.0)
                depths.append(1000.0 * (HALF_M - height(world, "box")))
                forces.append(floor_force(world, 0.5))
    names = tuple(f"time step {1000 * step:.3g} ms, {kind}" for step in steps_s for kind in KINDS)
    rows = [("penetration depth [mm]", (*depths, 0.0)), ("force on the floor [N]", (*forces, GRAVITY))]
    return Table(("quantity", *names, CLOSED_FORM), rows)


def stiffness() -> Table:
    """Penetration of a ball and a box at rest with `contactStiffness`; a box has four contacts with this stiffness
    each.
    """
    rows = []
    for name, contacts in (("ball", 1), ("box", 4)):
        for value in (1e3, 1e4, 1e5):
            dynamics = {"contactStiffness": value, "contactDamping": 2.0 * (value * 1.0) ** 0.5}
            found = []
            for time_step_s in (0.002, 0.001):
                for keys in KINDS.values():
                    more = {"changeDynamics": dynamics, **keys}
                    thing = ball("it", HALF_M, **more) if name == "ball" else box("it", (HALF_M,) * 3, **more)
                    with scene(time_step_s, collision_objects=[box_floor(**keys)], dynamic_objects=[thing]) as world:
                        run(world, 3.0)
                        found.append(1000.0 * (HALF_M - height(world, "it")))
            closed = 1000.0 * GRAVITY / (contacts * value)
            rows.append((f"{name}, `contactStiffness: {value:.1e}`", (*found, closed)))
    names = tuple(f"time step {step}, {kind}" for step in ("2 ms", "1 ms") for kind in KINDS)
    return Table(("penetration depth [mm]", *names, CLOSED_FORM), rows)


def stacking() -> Table:
    """How far ten boxes of 1 kg sink and lean in 5 s, by iterations of the solver."""
    rows = []
    for time_step_s in (0.001, 1 / 240):
        for iterations in (10, 50, 200):
            cells: list[float | str] = []
            for keys in KINDS.values():
                with _stack([1.0] * 10, time_step_s, {"numSolverIterations": iterations}, keys) as world:
                    run(world, 5.0)
                    x, y, z = world.bodies["box9"].base_pose().position
                cells += [1000.0 * (19 * HALF_M - z), 1000.0 * (x * x + y * y) ** 0.5]
            name = f"time step {1000 * time_step_s:.3g} ms, `numSolverIterations: {iterations}`"
            rows.append((name, tuple(cells)))
    names = tuple(f"{what} of the top box [mm], {kind}" for kind in KINDS for what in ("sinking", "lateral shift"))
    return Table(("setting", *names), rows)


def loading() -> Table:
    """Penetration of a light box of 1 kg under a heavy one in the floor, after 2 s."""
    rows = []
    settings: dict[str, tuple[float, dict[str, Any]]] = {
        "time step 1 ms": (0.001, {}),
        "time step 1 ms, `numSolverIterations: 500`": (
            0.001,
            {"numSolverIterations": 500, "solverResidualThreshold": 0.0},
        ),
        "time step 0.25 ms": (0.00025, {}),
        "time step 1 ms, `numSubSteps: 4`": (0.001, {"numSubSteps": 4}),
    }
    for name, (time_step_s, engine) in settings.items():
        found = []
        for mass in (10.0, 100.0, 1000.0):
            with _stack([1.0, mass], time_step_s, engine, MAXIMAL) as world:
                run(world, 2.0)
                found.append(1000.0 * (HALF_M - height(world, "box0")))
        rows.append((name, tuple(found)))
    return Table(("penetration depth of the light box [mm]", "under 10 kg", "under 100 kg", "under 1000 kg"), rows)


def _stack(masses: list[float], time_step_s: float, engine: dict[str, Any], keys: dict[str, Any]) -> Any:
    boxes = []
    for index, mass in enumerate(masses):
        where = [0.0, 0.0, (2 * index + 1) * HALF_M]
        more = {"basePosition": where, "baseMass": mass, "changeDynamics": {"lateralFriction": 0.5}, **keys}
        boxes.append(box(f"box{index}", (HALF_M,) * 3, **more))
    return scene(time_step_s, engine, collision_objects=[box_floor(**keys)], dynamic_objects=boxes)
