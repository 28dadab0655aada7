"""Moving pictures of the scenes at work, and the sheet of all robots and scenes in docs/examples.md."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import pybullet
from files import write_gif, write_png
from overlay import Overlay
from PIL import Image, ImageDraw
from render import Photographer, font, with_caption
from storyboard import grid

from custom_ros_tools.plot_style import BLUE, ORANGE
from robot_model.geometry import Vector
from rpbi.gym.env import WorldEnv
from rpbi.world import World
from rpbi_examples.scenes.scene import Scene, run_scene
from rpbi_examples.scenes.shelves import Shelves
from rpbi_examples.scenes.talos import Talos
from rpbi_examples.scenes.task import EnvStage, make_env

SEED, SHELVES_SEED = 3, 10
HZ, MAX_SCENE_BYTES = 10.0, 1_500_000
"""Frames per second of the moving pictures, and their largest size."""
SIZE_PX, SHEET_PX, COLUMNS = (560, 420), (320, 240), 4
"""Sizes of the moving pictures and of those in the sheet, and columns of the sheet."""


class View(NamedTuple):
    """Camera, speed and duration of a moving picture.

    Attributes:
        position: Position of the camera in the world [m].
        target: Point in the middle of the picture [m].
        fov_deg: Vertical field of view [deg].
        start_s: Time of the first frame [s].
        end_s: Time after which no frame follows, if the scene has not ended before [s].
        still_s: Time of the picture in the sheet [s].
        speed: Simulated seconds per second of the moving picture.
        slow: Times between which the picture is in slow motion [s], and the speed in it; none if it is empty. A scene
            has one picture per cycle, so that the slowest speed is `HZ` times the duration of a cycle.
        seed: Seed of the scene.
    """

    position: Vector
    target: Vector
    fov_deg: float = 40.0
    start_s: float = 0.0
    end_s: float = 90.0
    still_s: float = 0.1
    speed: float = 1.0
    slow: tuple[float, float, float] | tuple[()] = ()
    seed: int = SEED

    def frames(self) -> list[tuple[float, float]]:
        """Returns time [s] and speed of each frame."""
        frames, time_s = [], self.start_s
        while time_s < self.end_s:
            is_slow = bool(self.slow) and self.slow[0] <= time_s < self.slow[1]
            speed = self.slow[2] if is_slow else self.speed
            frames.append((time_s, speed))
            time_s += speed / HZ
        return frames


SCENES = {
    "cup": View((1.6, 0.2, 1.75), (0.29, 0.2, 0.71), 34.0, 1.0, speed=3.0, still_s=6.0),
    "wiping": View((0.8, 1.0, 0.95), (0.05, 0.0, 0.29), 38.0, 1.0, speed=2.5, still_s=8.0),
    "handover": View((1.95, -1.9, 1.6), (0.6, -0.15, 1.17), 31.0, speed=4.0, still_s=9.0),
    "talos": View((2.0, 1.6, 1.5), (0.15, 0.0, 0.95), 36.0, 1.0, 6.0, 3.9, 0.8, (3.8, 4.4, 0.2)),
    "factory": View((1.2, 0.3, 1.7), (0.36, 0.02, 0.95), 39.0, 2.0, speed=4.0, still_s=12.0),
    "dual_arm": View((2.2, 1.2, 1.5), (0.33, 0.05, 0.6), 32.0, speed=1.5, still_s=5.0),
    "shelves": View((-1.25, 0.0, 2.15), (0.5, 0.0, 0.85), 42.0, speed=5.5, still_s=1.7, seed=SHELVES_SEED),
}
"""Views of the scenes."""
CLUTTER = View((0.60, -0.52, 1.00), (0.0, 0.0, 0.46), 46.0, end_s=2.0, still_s=3.0, speed=0.5)
ROBOTS = {
    "kuka_lwr": View((1.6, -1.5, 1.3), (0.35, 0.0, 0.4), 27.0),
    "dual_iiwa": View((2.0, -1.2, 1.5), (0.2, 0.0, 0.7), 36.0),
    "panda": View((1.3, -1.2, 1.0), (0.25, 0.0, 0.4), 31.0),
    "ur5e": View((1.3, -1.1, 1.0), (0.25, 0.0, 0.35), 31.0),
    "kinova": View((1.1, -1.1, 0.9), (0.0, 0.0, 0.4), 32.0),
    "nextage": View((1.7, -1.1, 1.7), (0.0, 0.0, 1.0), 42.0),
    "mobile_base": View((0.8, -2.3, 1.25), (-0.72, -0.8, 0.4), 32.0),
    "human_model": View((2.6, -1.6, 1.6), (0.0, 0.0, 0.88), 34.0),
}
"""Views of the robots of the basic examples, without Talos, which is in a scene."""
WORDS = {
    "kuka_lwr": "KUKA LWR 4+",
    "dual_iiwa": "two KUKA iiwas",
    "panda": "Franka Panda",
    "ur5e": "UR5e",
    "kinova": "Kinova Jaco with fingers",
    "nextage": "Nextage",
    "mobile_base": "mobile base with an arm",
    "human_model": "model of a person",
    "cup": "putting a cup on a shelf",
    "wiping": "wiping a board",
    "handover": "handing a box to a person",
    "talos": "Talos, pushed by a rod",
    "factory": "sorting parts from a belt",
    "dual_arm": "lifting a box with two arms",
    "shelves": "reaching past moving blocks",
    "clutter": "objects for a depth camera",
}
"""Captions of the sheet."""


def mark_push(world: World, scene: Scene, view: Overlay) -> None:
    """Names the push of the scene `talos` while the stick shows it."""
    assert isinstance(scene, Talos)
    stick = world.bodies["stick"].base_pose().position
    if stick[2] > 0.0:
        view.words(stick, f"push of {scene.impulse:g} N s", "#b91c1c", (40, 40))


def mark_goals(_: World, scene: Scene, view: Overlay) -> None:
    """Marks the goals of the scene `shelves` that the arms have not reached yet, in one colour for each arm."""
    assert isinstance(scene, Shelves)
    for (name, goals), colour in zip(scene.goals.items(), (BLUE, ORANGE)):
        for goal in goals[scene.visited[name] :]:
            view.dot(goal.position, colour, 8.0)


MARKS = {"shelves": mark_goals, "talos": mark_push}
"""Functions that mark what a scene is about, by the scenes' names."""


class FilmedStage(EnvStage):
    """Runs a scene in an environment, and photographs its world at the given times [s]."""

    def __init__(self, env: WorldEnv, name: str, camera: Photographer, times_s: Sequence[float]) -> None:
        super().__init__(env)
        self._filmed, self._name, self._camera, self._times_s = env, name, camera, times_s
        self.pictures: list[Image.Image] = []

    def cycle(self) -> None:
        """Advances the world by a cycle, and photographs it if a picture is due."""
        super().cycle()
        done = len(self.pictures)
        if done < len(self._times_s) and self._filmed.task.scene.seen.time_s >= self._times_s[done]:
            view = Overlay(self._camera, self._camera.picture(self._filmed.world))
            if self._name in MARKS:
                MARKS[self._name](self._filmed.world, self._filmed.task.scene, view)
            self.pictures.append(view.picture())


def filmed(name: str, view: View, size: tuple[int, int], times_s: Sequence[float]) -> list[Image.Image]:
    """Runs an episode of a scene, and returns pictures of its world at the given times [s]."""
    env = make_env(name)
    env.task.seed = view.seed
    env.reset(seed=view.seed)
    env.task.scene.longest_s = times_s[-1] + 0.1
    stage = FilmedStage(env, name, Photographer(view.position, view.target, view.fov_deg, size), times_s)
    run_scene(env.task.scene, stage)
    env.close()
    return stage.pictures


def observed(name: str, view: View, size: tuple[int, int], times_s: Sequence[float]) -> list[Image.Image]:
    """Runs the world of an example without commands, and returns pictures at the given times [s]."""
    world = World.from_file(f"{{rpbi_examples}}/configs/{name}/config.yaml", connection_mode=pybullet.DIRECT)
    camera, pictures = Photographer(view.position, view.target, view.fov_deg, size), []
    for time_s in times_s:
        while world.clock.tick * world.clock.dt_s < time_s:
            world.step()
        pictures.append(camera.picture(world))
    world.close()
    return pictures


def movie(name: str, path: Path) -> None:
    """Writes the moving picture of a scene, or of the world `clutter`."""
    view, film = (CLUTTER, observed) if name == "clutter" else (SCENES[name], filmed)
    frames = view.frames()
    pictures = film(name, view, SIZE_PX, [time_s for time_s, _ in frames])
    for picture, (_, frame_speed) in zip(pictures, frames):
        speed = f"{frame_speed:g} x speed"
        draw, corner = ImageDraw.Draw(picture), (SIZE_PX[0] - 10, SIZE_PX[1] - 10)
        left, top, right, bottom = draw.textbbox(corner, speed, font(15), "rb")
        draw.rectangle((left - 5, top - 3, right + 5, bottom + 3), "white")
        draw.text(corner, speed, "#1f2937", font(15), "rb")
    write_gif(path, pictures, HZ, most_bytes=MAX_SCENE_BYTES)


def draw_cup(path: Path) -> None:
    """Writes the moving picture of the scene `cup`."""
    movie("cup", path)


def draw_wiping(path: Path) -> None:
    """Writes the moving picture of the scene `wiping`."""
    movie("wiping", path)


def draw_handover(path: Path) -> None:
    """Writes the moving picture of the scene `handover`."""
    movie("handover", path)


def draw_talos(path: Path) -> None:
    """Writes the moving picture of the scene `talos`."""
    movie("talos", path)


def draw_factory(path: Path) -> None:
    """Writes the moving picture of the scene `factory`."""
    movie("factory", path)


def draw_dual_arm(path: Path) -> None:
    """Writes the moving picture of the scene `dual_arm`."""
    movie("dual_arm", path)


def draw_shelves(path: Path) -> None:
    """Writes the moving picture of the scene `shelves`."""
    movie("shelves", path)


def draw_clutter(path: Path) -> None:
    """Writes the moving picture of the world `clutter`."""
    movie("clutter", path)


def draw_sheet(path: Path) -> None:
    """Writes the sheet of the robots of the basic examples, and of the scenes at work."""
    robots = {name: (f"basic_example_{name}", observed, view) for name, view in ROBOTS.items()}
    scenes = {name: (name, filmed, view) for name, view in SCENES.items()}
    pictures = [
        with_caption(film(world, view, SHEET_PX, [view.still_s])[0], WORDS[name], 20)
        for name, (world, film, view) in {**robots, **scenes, "clutter": ("clutter", observed, CLUTTER)}.items()
    ]
    write_png(path, grid(pictures, COLUMNS), dither=True)
