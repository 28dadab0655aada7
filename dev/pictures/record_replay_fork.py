"""A moving picture: a push of a box is recorded, replayed, forked into other pushes, and the best one is executed.

All pictures and figures come from simulated worlds: the replay is that of `rpbi.replay`, the forks are those of
`World.fork`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import pybullet
from files import write_gif
from PIL import Image, ImageDraw
from render import Photographer
from storyboard import GAP, GREEN, WIDTH, frame, grid, titled

from rpbi.geometry import Pose
from rpbi.replay.session import Checkpoint, Recording, Replay, ReplayResult
from rpbi.world import World
from rpbi.world.saved.description import WorldDescription
from rpbi_examples.motions import PlanarPose
from rpbi_examples.pushing import HALF_SIDES_M, PLACES, Push, Pusher, ball_solver, next_push

WORLD = "{rpbi_examples}/configs/basic_example_kuka_lwr/config.yaml"
ROBOT, BOX = "kuka_lwr", "box"
STEPS = "record", "replay", "fork", "execute"
HZ, TICKS = 12.0, 290
"""Frames per second, and ticks between two frames."""
PAUSE = 14
"""Frames for which the end of a step is shown."""
HEIGHT = 420
"""Height of the pictures [px]."""
CAMERA = Photographer((-0.95, -1.15, 0.95), (0.02, 0.0, 0.25), 34.0, (WIDTH, HEIGHT))
FORK_CAMERA = Photographer((-0.85, -1.1, 0.95), (-0.03, 0.01, 0.2), 34.0, ((WIDTH - GAP) // 2, (HEIGHT - GAP) // 2))
BOX_HALF_M = (*HALF_SIDES_M, 0.06)
OFFSETS_M = (-0.06, -0.02, 0.02, 0.06)
"""Distances of the forks' pushes from the middle of the box's side [m]."""
PUSHED_M = 0.26
"""Length of the forks' pushes [m]."""
MARK = PlanarPose(-0.07, -0.05, math.radians(25.0))
"""Pose of the mark in the world, to which the box should get."""

Targets = Sequence[dict[str, float]]


class Shot(NamedTuple):
    """A picture of the world, its tick, the hash of its state, and the pose of the box."""

    picture: Image.Image
    tick: int
    state_hash: str
    box: Pose


def shot(world: World, camera: Photographer) -> Shot:
    """Photographs a world."""
    return Shot(camera.picture(world), world.clock.tick, world.state_hash(), world.bodies[BOX].base_pose())


def advance(world: World, targets: Targets, camera: Photographer = CAMERA) -> Shot:
    """Puts a target before each tick, and photographs the world after the last one."""
    for target in targets:
        world.put(f"{ROBOT}/target", target)
        world.step()
    return shot(world, camera)


def advance_fork(world: World, targets: Targets) -> Shot:
    """Does the same in the process of a fork, which has a `FORK_CAMERA` of its own."""
    return advance(world, targets, FORK_CAMERA)


def parts(targets: Targets) -> list[Targets]:
    """Splits targets into those between two frames."""
    return [targets[begin : begin + TICKS] for begin in range(0, len(targets), TICKS)]


class Pushing:
    """Plans pushes of the box by the arm of a world."""

    def __init__(self, world: World) -> None:
        self._world, self._pusher = world, Pusher(ball_solver())
        self._base = world.bodies[ROBOT].base_pose().position
        self._names = [joint.name for joint in world.bodies[ROBOT].model.driven]

    def push_to(self, goal: tuple[float, float]) -> Push:
        """Returns the push that brings the box to a goal, x and y in the frame of the arm's base [m]."""
        box = planar(self._world.bodies[BOX].base_pose())
        push = next_push(PlanarPose(box.x - self._base[0], box.y - self._base[1], box.yaw), goal)
        assert push is not None
        return push

    def targets(self, push: Push) -> Targets:
        """Returns the arm's joint targets for a push, one for each tick."""
        dt_s = self._world.clock.dt_s
        moves = self._pusher.moves([*self._world.bodies[ROBOT].joint_positions().values()], push)
        times = [(move, tick * dt_s) for move in moves for tick in range(1, round(move.duration_s / dt_s) + 1)]
        return [dict(zip(self._names, move.at(time_s))) for move, time_s in times]


def planar(pose: Pose) -> PlanarPose:
    """Returns position and yaw of a box that lies on the floor."""
    (x, y, _), (_, _, z, w) = pose
    return PlanarPose(x, y, 2.0 * math.atan2(z, w))


def beside(push: Push, offset_m: float) -> Push:
    """Returns a push of `PUSHED_M` along a parallel line, which is `offset_m` to the left [m]."""
    length = math.dist(push.start, push.end)
    ahead_x, ahead_y = ((end - start) / length for start, end in zip(push.start, push.end))
    x, y = push.start[0] - offset_m * ahead_y, push.start[1] + offset_m * ahead_x
    return Push((x, y), (x + PUSHED_M * ahead_x, y + PUSHED_M * ahead_y))


def record(world: World, targets: Targets) -> tuple[Recording, list[Shot]]:
    """Runs a push. Returns its recording, which has the hash of each tick, and pictures."""
    recording, shots = Recording(WorldDescription(world.describe())), []
    for part in parts(targets):
        for target in part:
            world.put(f"{ROBOT}/target", target)
            world.step()
            recording.checkpoints.add(Checkpoint(0, world.clock.tick, world.commands.count, world.state_hash()))
        shots.append(shot(world, CAMERA))
    recording.commands[0] = dict(enumerate(world.commands.records()))
    return recording, shots


def replay(recording: Recording, ticks: Sequence[int]) -> tuple[ReplayResult, list[Shot]]:
    """Simulates a recording again in a new world, and returns the result, and pictures of the given ticks."""
    shots: list[Shot] = []

    def observe(world: World, *_: Any) -> None:
        if world.clock.tick in ticks:
            shots.append(shot(world, CAMERA))

    return Replay(recording, observe=observe).run(), shots


def misfit(box: Pose) -> tuple[float, float]:
    """Returns distance [mm] and angle [deg] between the box and the mark, which are equal after half a turn."""
    x, y, yaw = planar(box)
    return 1e3 * math.dist((x, y), MARK[:2]), abs(math.degrees(math.remainder(yaw - MARK.yaw, math.pi)))


def misfit_text(box: Pose) -> str:
    """Returns the misfit of the box as text."""
    return "{:.0f} mm and {:.0f}° from the mark".format(*misfit(box))


def outlined(picture: Image.Image, box: Pose) -> Image.Image:
    """Returns a copy of a picture of `CAMERA` with the edges of the box at a pose."""
    x, y, yaw = planar(box)
    cos, sin = math.cos(yaw), math.sin(yaw)
    corners = {}
    for signs in product((-1.0, 1.0), repeat=3):
        a, b, c = (sign * half for sign, half in zip(signs, BOX_HALF_M))
        corners[signs] = CAMERA.pixel((x + cos * a - sin * b, y + sin * a + cos * b, BOX_HALF_M[2] + c))
    copy = picture.copy()
    draw = ImageDraw.Draw(copy)
    for one, other in product(corners, corners):
        if sum(a != b for a, b in zip(one, other)) == 1 and one < other:
            draw.line((corners[one], corners[other]), GREEN, 3)
    return copy


def mark() -> dict[str, Any]:
    """Returns the configuration of the mark: a green area with the outline of the box."""
    return {
        "name": "mark",
        "createVisualShape": {
            "shapeType": "GEOM_BOX",
            "halfExtents": [*HALF_SIDES_M, 0.004],
            "rgbaColor": [0.1, 0.6, 0.3, 1.0],
            "specularColor": [0.0, 0.0, 0.0],
        },
        "basePosition": [MARK.x, MARK.y, 0.004],
        "baseOrientation": [0.0, 0.0, math.sin(MARK.yaw / 2.0), math.cos(MARK.yaw / 2.0)],
    }


def recorded_and_replayed(world: World, targets: Targets) -> Iterator[Image.Image]:
    """Records a push and simulates it again. Yields the frames."""
    recording, recorded = record(world, targets)
    for each in recorded:
        caption = f"A KUKA pushes a box. Each input is stored with its tick. Now: tick {each.tick:,}"
        yield frame(STEPS, 0, each.picture, caption, f"hash of the state: {each.state_hash[:8]}")
    result, replayed = replay(recording, [each.tick for each in recorded])
    if result.difference is not None or result.left_out:
        raise ValueError(f"the replay differs: {result}")
    states = sum(len(part.checkpoints) for part in recording.parts())
    verdict = f"{result.agreed:,} of {states:,} states are equal, to the last bit"
    caption = "A new world gets the same inputs at the same ticks."
    for one, other in zip(recorded, replayed):
        pair = grid([titled(middle(one.picture), "recorded"), titled(middle(other.picture), "simulated again")], 2)
        is_last = one is recorded[-1]
        text = verdict if is_last else f"tick {one.tick:,}: {one.state_hash[:8]} = {other.state_hash[:8]}"
        yield from [frame(STEPS, 1, pair, caption, text)] * (PAUSE if is_last else 1)


def middle(picture: Image.Image) -> Image.Image:
    """Returns the middle of a picture, as wide as two fit into a frame."""
    width = (WIDTH - GAP) // 2
    left = (picture.width - width) // 2
    return picture.crop((left, 0, left + width, picture.height))


def forked_and_executed(world: World, pushes: Sequence[Targets]) -> Iterator[Image.Image]:
    """Tries pushes in forks, and executes the one whose box gets nearest to the mark. Yields the frames."""
    caption = "Four copies of the running world try a push each. Which one brings the box to the mark?"
    forks = world.fork(len(pushes))
    for turn in zip(*map(parts, pushes)):
        ends: list[Shot] = [fork.call(advance_fork, part) for fork, part in zip(forks, turn)]
        named = [titled(end.picture, name) for end, name in zip(ends, "ABCD")]
        yield frame(STEPS, 2, grid(named, 2), caption)
    best = min(range(len(ends)), key=lambda number: sum(misfit(ends[number].box)))
    named = [
        titled(end.picture, f"{name}: {misfit_text(end.box)}", GREEN if number == best else "")
        for number, (end, name) in enumerate(zip(ends, "ABCD"))
    ]
    yield from [frame(STEPS, 2, grid(named, 2), caption, f"{'ABCD'[best]} fits best")] * PAUSE
    for fork in forks:
        fork.close()
    predicted = ends[best]
    for part in parts(pushes[best]):
        now = advance(world, part)
        picture = outlined(now.picture, predicted.box)
        caption = f"The arm executes {'ABCD'[best]}. The outline is the predicted pose of the box."
        yield frame(STEPS, 3, picture, caption, f"predicted: {misfit_text(predicted.box)}")
    if now.state_hash != predicted.state_hash:
        raise ValueError("the world has not ended as predicted")
    caption = f"predicted: {misfit_text(predicted.box)}; happened: {misfit_text(now.box)}"
    states = f"state {predicted.state_hash[:8]} = {now.state_hash[:8]}: equal, to the last bit"
    yield from [frame(STEPS, 3, picture, caption, states)] * PAUSE


def draw(path: Path) -> None:
    """Writes the moving picture."""
    world = World.from_file(WORLD, connection_mode=pybullet.DIRECT)
    pushing = Pushing(world)
    frames = [*recorded_and_replayed(world, pushing.targets(pushing.push_to(PLACES[0])))]
    world.add("visual", mark())
    push = pushing.push_to(PLACES[1])
    pushes = [pushing.targets(beside(push, offset_m)) for offset_m in OFFSETS_M]
    longest = max(map(len, pushes))
    frames += forked_and_executed(world, [[*each, *[each[-1]] * (longest - len(each))] for each in pushes])
    world.close()
    write_gif(path, frames, HZ, last_s=2.0, colours=192)
