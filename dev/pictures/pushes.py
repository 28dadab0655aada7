"""The arm of the demo pushes its box, tick by tick, with one setting or another."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import yaml

from rpbi.samples import ContactsSample
from rpbi.world import World
from rpbi_examples.motions import PlanarPose
from rpbi_examples.pushing import CLEARANCE_M, GAP_M, PLACES, PUSH_SPEED, Pusher, ball_solver, next_push

CONFIGS = Path(__file__).resolve().parents[2] / "src/rpbi_examples/configs"
TARGET_HZ = 50.0
SETTLED_S = 0.5
"""Time after the first touch from which the push counts as steady [s]."""
PLANE = {"createCollisionShape": {"shapeType": "GEOM_PLANE"}}
"""Keys of the floor with which it is a plane."""
COMPLIANT = {"changeDynamics": {"lateralFriction": 0.7, "contactStiffness": 1.0e4, "contactDamping": 200.0}}
"""Keys of the box with which its contacts give way."""


class Force(NamedTuple):
    """Forces on the box during a push, n samples of its contacts.

    Attributes:
        time_s: Simulated time since the push began [s].
        push: Normal force of the arm [N].
        friction: Largest friction of the floor, mu N [N].
        points: Contact points that carry the box.
    """

    time_s: npt.NDArray[np.float64]
    push: npt.NDArray[np.float64]
    friction: npt.NDArray[np.float64]
    points: npt.NDArray[np.float64]

    def steady(self) -> Force:
        """Returns the part in which the box slides at constant speed."""
        since = self.time_s[np.argmax(self.push > 0.0)] + SETTLED_S
        keep = (self.time_s > since) & (self.time_s < self.time_s[-1] - 0.1)
        return Force(*(column[keep] for column in self))


def example(folder: Path, time_step_s: float = 0.001, **objects: Mapping[str, Any]) -> World:
    """Builds the world of the demo.

    Args:
        folder: Where its files are written to.
        time_step_s: Length of a tick [s].
        objects: Keys of `floor`, `box` and `kuka_lwr` that replace those of their files, and further objects.
    """
    here = CONFIGS / "basic_example_kuka_lwr"
    files = {"floor": CONFIGS / "floor.yaml", "box": here / "box.yaml", "kuka_lwr": here / "kuka_lwr.yaml"}
    for name in {**files, **objects}:
        keys = yaml.safe_load(files[name].read_text()) if name in files else {}
        keys |= {"contacts": {"hz": 1.0 / time_step_s}} if name == "box" else {}
        (folder / f"{name}.yaml").write_text(yaml.safe_dump({**keys, "name": name, **objects.get(name, {})}))
    further = [f"{name}.yaml" for name in objects if name not in files]
    main = {
        "connect": {"connection_mode": "DIRECT"},
        "setGravity": {"gravZ": -9.81},
        "timeStep": time_step_s,
        "poses": [{"tf_id": "rpbi/floor"}],
        "collision_objects": ["floor.yaml", *further],
        "dynamic_objects": ["box.yaml"],
        "robots": ["kuka_lwr.yaml"],
    }
    (folder / "world.yaml").write_text(yaml.safe_dump(main))
    return World.from_file(str(folder / "world.yaml"))


def push(
    world: World,
    target_hz: float = TARGET_HZ,
    late_s: Callable[[], float] = lambda: 0.0,
    length_m: float = 0.3,
    run_up_m: float = 0.0,
) -> Force:
    """Pushes the box by the arm along a straight line at constant speed, PUSH_SPEED.

    Args:
        world: As `example` builds it.
        target_hz: Targets of the joints in a second.
        late_s: Returns how late the next target is [s].
        length_m: Length of the push [m].
        run_up_m: Distance of the ball from its usual start at which it starts, at most `CLEARANCE_M - GAP_M` [m]. The
            usual start is `GAP_M` before the box.
    """
    solver = ball_solver()
    base = world.bodies["kuka_lwr"].base_pose()
    (x, y, _), quat = base.inverse() @ world.bodies["box"].base_pose()
    planned = next_push(PlanarPose(x, y, 2.0 * math.atan2(quat[2], quat[3])), PLACES[0])
    assert planned is not None  # the box of the example is not there yet
    positions = list(world.bodies["kuka_lwr"].joint_positions().values())
    *before, approach, along, _, _ = Pusher(solver).moves(positions, planned)
    approach_m, whole_m = CLEARANCE_M - GAP_M, math.dist(planned.start, planned.end) + GAP_M
    ticks = round(1.0 / (TARGET_HZ * world.config.timeStep))
    start = 1.0 - run_up_m / approach_m
    for move in (*before, approach._replace(path=lambda way: approach.path(way * start))):
        for number in range(1, round(move.duration_s * TARGET_HZ) + 1):
            _send(world, solver.joint_names, move.at(number / TARGET_HZ))
            _steps(world, ticks)
    whole_s = (run_up_m + length_m) / PUSH_SPEED
    count = round(whole_s * target_hz)
    dues = [number / target_hz + late_s() for number in range(count)]
    ways_m = [number / target_hz * PUSH_SPEED - run_up_m for number in range(1, count + 1)]
    found, number = [], 0
    for tick in range(round(whole_s / world.config.timeStep)):
        while number < count and dues[number] <= (tick + 1e-6) * world.config.timeStep:
            way_m = ways_m[number]
            path = along.path(way_m / whole_m) if way_m > 0.0 else approach.path(1.0 + way_m / approach_m)
            _send(world, solver.joint_names, path.tolist())
            number += 1
        found += [(tick * world.config.timeStep, *forces) for forces in _steps(world, 1)]
    return Force(*np.array(found).T)


def _send(world: World, joint_names: Sequence[str], positions: Any) -> None:
    world.put("kuka_lwr/target", dict(zip(joint_names, positions)))


def _steps(world: World, ticks: int) -> list[tuple[float, float, float]]:
    samples = [sample for _ in range(ticks) for sample in world.step() if isinstance(sample, ContactsSample)]
    return [_on_box(sample) for sample in samples if sample.name == "box"]


def _on_box(sample: ContactsSample) -> tuple[float, float, float]:
    """Returns the arm's normal force, mu N of the floor, and how many points of the floor carry the box."""
    arm = sum(point.normal_force for point in sample.points if point.other_body == "kuka_lwr")
    floor = [point.normal_force for point in sample.points if point.other_body == "floor"]
    return arm, 0.7 * sum(floor), sum(force > 0.0 for force in floor)


def pushed(time_step_s: float = 0.001, objects: Mapping[str, Any] | None = None, **how: Any) -> Force:
    """Returns the forces of a push in a world of its own; see `example` and `push`."""
    with tempfile.TemporaryDirectory(prefix="rpbi-") as folder:
        world = example(Path(folder), time_step_s, **(objects or {}))
        try:
            return push(world, **how)
        finally:
            world.close()
