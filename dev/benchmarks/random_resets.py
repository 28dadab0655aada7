"""Random worlds that are reset without loading files, compared with loading all files again."""

from __future__ import annotations

import random
import sys
import tempfile
from pathlib import Path
from typing import Any

from result import Result, Target

SUPPORT = Path(__file__).resolve().parents[2] / "tests/support"
sys.path += [str(SUPPORT / each) for each in ("worlds", "robots")]
from worlds import BOX_FLOOR, FLOOR, ball, box, iiwa, write_world  # noqa: E402

from rpbi.geometry import Pose  # noqa: E402
from rpbi.world import World  # noqa: E402
from rpbi.world.actions import TimedGoal  # noqa: E402

LIVES, LIFE = 2, (20, 250)
"""Lives before the one that is compared, and their ticks."""
TICKS, EVERY = 250, 50
"""Ticks of the life that is compared, and between two hashes."""
MAY_SLEEP, SLEEPS = "ACTIVATION_STATE_ENABLE_SLEEPING", "ACTIVATION_STATE_ENABLE_SLEEPING|ACTIVATION_STATE_SLEEP"
ALONE, SLEEPY = 0.9, 0.05
"""Shares of worlds with one free body, and with bodies that may sleep; worlds with more, or sleep, are loaded again."""
JOINTS = tuple(f"lbr_iiwa_joint_{number}" for number in range(1, 8))


def exact_resets(seeds: range) -> list[Result]:
    """Compares lives after `reset(rebuild=False)` with the same lives after all was loaded again."""
    same = kept = 0
    for seed in seeds:
        is_kept, is_same = _compare(seed)
        kept += is_kept
        same += is_same
        if not is_same:
            print(f"reset(rebuild=False): session {seed} differs", file=sys.stderr)
    what = f"random worlds after reset(rebuild=False), of {len(seeds)}"
    return [
        Result("forks", f"{what}: bodies are kept", kept, ""),
        Result("forks", f"{what}: as if loaded again", same, "", None, Target(len(seeds), at_least=True)),
    ]


def _compare(seed: int) -> tuple[bool, bool]:
    """Returns whether the bodies of a world are kept at all resets, and whether it then moves as if loaded again."""
    draw = random.Random(seed)
    with tempfile.TemporaryDirectory(prefix="rpbi-bench-") as folder:
        world = _build(Path(folder), draw)
        world.reset(rebuild=False)
        bodies = list(world.bodies.values())
        for _ in range(LIVES):
            _live(world, draw.random(), draw.randint(*LIFE))
            world.reset(rebuild=False)
        is_kept = all(map(lambda one, other: one is other, world.bodies.values(), bodies))
        life = draw.random()
        found = _live(world, life, TICKS)
        world.reset()
        expected = _live(world, life, TICKS)
        world.close()
    return is_kept, found == expected


def _build(folder: Path, draw: random.Random) -> World:
    things, may_sleep = [], draw.random() < SLEEPY
    for turn in range(1 if draw.random() < ALONE else draw.randint(2, 9)):
        make = draw.choice((ball, box))
        lies = draw.random() < 0.5
        place = [draw.uniform(0.2, 0.7), draw.uniform(-0.5, 0.5), 0.1 if lies else 0.1 + 0.21 * turn]
        dynamics = {"lateralFriction": draw.uniform(0.1, 1.0), "restitution": draw.choice((0.0, 0.5))}
        if may_sleep and draw.random() < 0.5:
            dynamics["activationState"] = draw.choice((MAY_SLEEP, SLEEPS))
        things.append(make(f"thing{turn}", basePosition=place, changeDynamics=dynamics))
    walls = tuple(
        box(f"wall{turn}", basePosition=[draw.uniform(0.2, 0.8), draw.uniform(-0.5, 0.5), draw.uniform(-0.05, 0.2)])
        for turn in range(draw.randrange(5))
    )
    for wall in walls:
        del wall["baseMass"]
    joints = {name: draw.uniform(-60.0, 60.0) for name in JOINTS}
    return World.from_file(
        write_world(
            folder,
            collision=(draw.choice((FLOOR, BOX_FLOOR)), *walls),
            dynamic=tuple(things),
            robots=(iiwa(initial_joint_position=joints, target_interpolation=draw.choice(("hold", "smooth"))),),
            timeStep=draw.choice((0.001, 0.002, 0.005)),
            setPhysicsEngineParameter={"numSubSteps": draw.choice((0, 0, 2))},
        )
    )


def _live(world: World, seed: float, ticks: int) -> list[Any]:
    """Moves arm and bodies in all ways from which the start can be restored; returns hashes in between."""
    draw = random.Random(seed)
    hashes = []
    names = [name for name in world.bodies if name.startswith("thing")]
    for name in draw.sample(names, draw.randrange(min(len(names), 2) + 1)):
        world.change_dynamics(name, {"mass": draw.uniform(0.2, 3.0), "lateralFriction": draw.uniform(0.1, 1.0)})
    for tick in range(ticks):
        if draw.random() < 0.05:
            world.put("iiwa/target", {name: draw.uniform(-1.0, 1.0) for name in draw.sample(JOINTS[3:], 3)})
        kind = draw.random()
        if kind < 0.01:
            place = draw.uniform(0.2, 0.7), draw.uniform(-0.5, 0.5), draw.uniform(0.1, 1.0)
            world.act(draw.choice(names), "teleport", Pose(place))
        elif kind < 0.015:
            world.act("iiwa", "set_joint_state", {JOINTS[0]: draw.uniform(-0.5, 0.5), JOINTS[1]: 0.5})
        elif kind < 0.02:
            world.act("iiwa", "move", TimedGoal({JOINTS[2]: draw.uniform(-0.5, 0.5)}, draw.uniform(0.05, 0.2)))
        world.step()
        if (tick + 1) % EVERY == 0:
            hashes.append(world.state_hash())
    return hashes
