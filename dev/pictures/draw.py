"""Pictures of the pages, each drawn by a function into docs/images."""

from __future__ import annotations

import os
import pkgutil
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

HERE = Path(__file__).resolve().parent
IMAGES = HERE.parents[1] / "docs/images"
PICTURES: dict[str, str] = {
    "card_contacts.png": "guides:draw_contacts_card",
    "card_tutorial.png": "cards:draw",
    "card_guard.png": "cards:draw",
    "card_people.png": "cards:draw",
    "card_planning.png": "cards:draw",
    "card_data.png": "cards:draw",
    "card_learning.png": "cards:draw",
    "card_reality.png": "cards:draw",
    "card_viewers.png": "cards:draw",
    "demo.png": "rviz_worlds:demo",
    "record_replay_fork.gif": "record_replay_fork:draw",
    "architecture.svg": "diagrams:architecture",
    "tick.svg": "diagrams:tick",
    "episode_to_dataset.svg": "diagrams:episode_to_dataset",
    "computers.svg": "diagrams:computers",
    "ros2.svg": "diagrams:ros2",
    "examples.png": "scenes:draw_sheet",
    "scene_cup.gif": "scenes:draw_cup",
    "scene_wiping.gif": "scenes:draw_wiping",
    "scene_handover.gif": "scenes:draw_handover",
    "scene_talos.gif": "scenes:draw_talos",
    "scene_factory.gif": "scenes:draw_factory",
    "scene_dual_arm.gif": "scenes:draw_dual_arm",
    "scene_shelves.gif": "scenes:draw_shelves",
    "scene_clutter.gif": "scenes:draw_clutter",
    "clean_floor.png": "clean_forces:draw_floor",
    "clean_impedance.png": "clean_forces:draw_impedance",
    "clean_rate.png": "clean_forces:draw_rate",
    "clean_real_time.png": "clean_forces:draw_real_time",
    "clean_stiffness.png": "clean_forces:draw_stiffness",
    "clean_targets.png": "clean_forces:draw_targets",
    "clutter_labels.png": "clutter_labels:draw_clutter_labels",
    "forces.png": "figures:draw_forces",
    "guard.png": "guard:draw_guard",
    "human_interaction_press.png": "figures:draw_press",
    "interpolation.png": "interpolation:draw_interpolation",
    "lfd_pipeline.png": "figures:draw_lfd_pipeline",
    "pushing_cycles.png": "figures:draw_pushing_report",
    "pushing_errors.png": "figures:draw_pushing_report",
    "pushing_path.png": "figures:draw_pushing_report",
    "pushing_mpc.png": "views:draw_pushing_mpc",
    "real_robot.png": "views:draw_real_robot",
    "wiping_force.png": "figures:draw_wiping_force",
    "wiping.png": "wiping:draw_wiping",
    "clutter_rviz.png": "rviz_worlds:clutter_rviz",
    "rgbd_cloud.png": "rviz_worlds:rgbd_cloud",
    "ik_talos.png": "ik_tasks:draw_ik_talos",
    "ik_drag.png": "rviz_worlds:ik_drag",
    "dual_iiwa.png": "rviz_worlds:dual_iiwa",
    "planning.png": "rviz_planning:planning",
    "lfd_rviz.png": "rviz_worlds:lfd_rviz",
    "tutorial_rviz.png": "rviz_worlds:tutorial_rviz",
    "avatar_walking.png": "rviz_people:avatar_walking",
    "guard_rviz.png": "rviz_guard:guard_rviz",
    "human_interaction.png": "rviz_people:human_interaction",
    "teleop.png": "rviz_people:teleop",
    "mvn.png": "rviz_people:mvn",
    "telepresence.png": "rviz_people:telepresence",
    "tracking.png": "rviz_people:tracking",
    "browser.png": "live_page:draw_browser",
    "episode.png": "live_page:draw_episode",
    "gym_curve.png": "curves:draw_gym_curve",
    "ik_errors.png": "curves:draw_ik_errors",
    "streams.png": "curves:draw_streams",
    "tutorial_path.png": "curves:draw_tutorial_path",
    "talos_push.png": "curves:draw_talos_push",
    "tutorial_colour.png": "guides:draw_tutorial_colour",
    "trajectories.png": "curves:draw_trajectories",
    "dynamics.png": "curves:draw_dynamics",
    "farm.png": "curves:draw_farm",
    "slow.png": "curves:draw_slow",
    "extending.png": "guides:draw_extending",
    "contacts.png": "guides:draw_contacts",
    "bases.png": "guides:draw_bases",
    "hands.png": "guides:draw_hands",
    "soft_body.png": "guides:draw_soft_body",
    "worlds.png": "guides:draw_worlds",
    "robot_model.png": "guides:draw_robot_model",
    "python.png": "guides:draw_python",
    "browser_demo.png": "live_page:draw_browser_demo",
    "browser_factory.png": "live_page:draw_browser_factory",
    "browser_talos.png": "live_page:draw_browser_talos",
    "controls.png": "windows:controls",
    "devices.png": "windows:devices",
    "live_plot.png": "windows:live_plot",
}
"""Functions that draw, as `module:function` in this folder, indexed by file name. Each takes the path of its file."""
LONGEST_S = 1800
"""Longest time to draw a picture [s]."""


def file_of(name: str) -> str:
    """Returns the file name of a picture; the suffix is optional in `name`. Returns an empty string if unknown."""
    return next((file for file in PICTURES if name in (file, Path(file).stem)), "")


def draw(names: Sequence[str]) -> int:
    """Draws pictures, each in its own process, and prints their sizes. Returns 1 if one fails, otherwise 0."""
    failed = []
    # Forks of worlds import modules of HERE, too. Packages come first, since some benchmarks have names of packages.
    paths = os.environ.get("PYTHONPATH", ""), HERE, HERE.parent / "benchmarks"
    environment = {**os.environ, "PYTHONPATH": ":".join(map(str, paths))}
    for file in map(file_of, names) if names else PICTURES:
        path, began_s = IMAGES / file, time.monotonic()
        with subprocess.Popen([sys.executable, __file__, PICTURES[file], str(path)], env=environment) as process:
            is_drawn = process.wait() == 0
        if is_drawn:
            print(f"{path}: {path.stat().st_size / 1e3:.0f} kB, {time.monotonic() - began_s:.0f} s", flush=True)
        else:
            failed.append(file)
    if failed:
        print(f"not drawn: {', '.join(failed)}", file=sys.stderr)
    return int(bool(failed))


def _end(number: int, _: object) -> None:
    """Handles a signal: raises SystemExit, so that all started programs end."""
    sys.exit(f"not within {LONGEST_S} s" if number == signal.SIGALRM else 128 + number)


if __name__ == "__main__":
    signal.signal(signal.SIGALRM, _end)
    signal.signal(signal.SIGTERM, _end)
    signal.alarm(LONGEST_S)
    pkgutil.resolve_name(sys.argv[1])(Path(sys.argv[2]))
