"""Draws the pictures of docs/clean_forces.md: the arm of the demo pushes its box, with one setting or another.

./rpbi shell -c "python3 dev/tools/clean_forces docs/images"

All of it is simulated tick by tick, so that the pictures are the same on any machine.
"""

from __future__ import annotations

import random
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402
from pushes import COMPLIANT, PLANE, Force, pushed  # noqa: E402

COLOURS = ("#c0392b", "#e8731a", "#22333f")


def arm_keys(mode: str) -> dict[str, Any]:
    """Returns keys of the example's arm with another control mode."""
    return {"setJointMotorControlArray": {"controlMode": mode}}


def late_targets(latest_s: float, real_time_factor: float = 1.0) -> Callable[[], float]:
    """Returns delays of targets in simulated time, always the same [s]; the latest is given by the wall clock [s]."""
    chance = random.Random(1)
    return lambda: real_time_factor * chance.uniform(0.0, latest_s)


def floor_picture(path: Path) -> None:
    """Draws a push over a plane, and over a box."""
    forces = {"plane": pushed(objects={"floor": PLANE}), "box": pushed()}
    figure, axes = plt.subplots(2, 2, sharex=True, figsize=(9, 4.6), height_ratios=(3, 1))
    for (above, below), (name, force) in zip(axes.T, forces.items()):
        above.plot(force.time_s, force.friction, color=COLOURS[2], lw=2.2, alpha=0.35, label="mu N of the floor")
        above.plot(force.time_s, force.push, color=COLOURS[1], lw=0.8, label="arm on box")
        above.set_title(f"floor: {name}, {_figures(force)}", fontsize=9)
        above.set_ylim(0.0, 25.0)
        below.plot(force.time_s, force.points, color=COLOURS[2], lw=0.8)
        below.set_ylim(-0.3, 4.6)
        below.set_xlabel("time [s]")
    axes[0, 0].set_ylabel("force [N]")
    axes[1, 0].set_ylabel("points")
    axes[0, 0].legend(fontsize=8, loc="upper right")
    _save(figure, axes, path)


def rate_picture(path: Path) -> None:
    """Draws the first touch by length of the tick, and chattering forces by which of them are reported."""
    figure, axes = plt.subplots(1, 2, figsize=(9, 3.2))
    for colour, step_ms in zip(COLOURS, (1, 2, 4)):
        force = pushed(step_ms / 1000.0, length_m=0.05)
        touch_s = force.time_s[np.argmax(force.push > 0.0)]
        axes[0].plot(1000.0 * (force.time_s - touch_s), force.push, "o-", color=colour, ms=3, label=f"{step_ms} ms")
    axes[0].set_xlim(-10.0, 30.0)
    axes[0].set_xlabel("time since the touch [ms]")
    axes[0].set_title("first touch, by timeStep", fontsize=9)
    told = {"every tick": 1000.0, "hz: 100": 100.0, "hz: 100, average: true": 100.0}
    for (name, hz), style in zip(told.items(), ("-", "o", "o-")):
        contacts = {"hz": hz, "average": "average" in name}
        force = pushed(objects={"floor": PLANE, "box": {"contacts": contacts}})
        colour = {"-": "#c8ccd0", "o": COLOURS[0], "o-": COLOURS[2]}[style]
        axes[1].plot(force.time_s, force.push, style, color=colour, ms=3, lw=1.0, label=name)
    axes[1].set_xlim(1.0, 1.3)
    axes[1].set_ylim(0.0, 18.0)
    axes[1].set_xlabel("time [s]")
    axes[1].set_title("forces that chatter, on a plane", fontsize=9)
    _finish(figure, axes, path)


def stiffness_picture(path: Path) -> None:
    """Draws a push of a rigid box, and of one whose contacts give way."""
    stiff = pushed(objects={"box": COMPLIANT})
    _touch_and_push(path, {"rigid": pushed(), "contactStiffness 1e4, contactDamping 200": stiff})


def impedance_picture(path: Path) -> None:
    """Draws a push under position control, and under impedance control."""
    modes = ("POSITION_CONTROL", "IMPEDANCE_CONTROL")
    _touch_and_push(path, {mode: pushed(objects={"kuka_lwr": arm_keys(mode)}) for mode in modes})


def targets_picture(path: Path) -> None:
    """Draws pushes by targets that come late, without and with a buffer, and by targets that are made in the tick."""
    no_buffer = {"kuka_lwr": {"target_buffer_s": 0.0}}
    forces = {
        "up to 15 ms late, no buffer": pushed(objects=no_buffer, late_s=late_targets(0.015)),
        "up to 15 ms late, buffer of 20 ms": pushed(late_s=late_targets(0.015)),
        "at every tick": pushed(target_hz=1000.0),
    }
    _pushes(path, forces)


def real_time_picture(path: Path) -> None:
    """Draws pushes by targets that are later by the wall clock than the buffer is long, at real time and slower."""
    factors = (1.0, 0.5, 0.1)
    _pushes(path, {f"real_time_factor {each:g}": pushed(late_s=late_targets(0.06, each)) for each in factors})


def _touch_and_push(path: Path, forces: Mapping[str, Force]) -> None:
    figure, axes = plt.subplots(1, 2, figsize=(9, 3.2))
    for colour, (name, force) in zip(COLOURS, forces.items()):
        touch_s = force.time_s[np.argmax(force.push > 0.0)]
        label = f"{name}, {force.push.max():.0f} N"
        axes[0].plot(1000.0 * (force.time_s - touch_s), force.push, "o-", color=colour, ms=3, label=label)
        axes[1].plot(force.time_s, force.push, color=colour, lw=0.8, label=f"{name}, {_figures(force)}")
    axes[0].set_xlim(-10.0, 60.0)
    axes[0].set_xlabel("time since the touch [ms]")
    axes[0].set_title("first touch at 0.15 m/s", fontsize=9)
    axes[1].set_ylim(0.0, 14.0)
    axes[1].set_xlabel("time [s]")
    axes[1].set_title("push", fontsize=9)
    _finish(figure, axes, path)


def _pushes(path: Path, forces: Mapping[str, Force]) -> None:
    figure, axes = plt.subplots(1, len(forces), figsize=(9, 3.0), sharey=True)
    for axis, (name, force) in zip(axes, forces.items()):
        axis.plot(force.time_s, force.push, color=COLOURS[1], lw=0.8)
        axis.set_title(f"{name}\n{_figures(force)}", fontsize=9)
        axis.set_ylim(0.0, 25.0)
        axis.set_xlabel("time [s]")
    axes[0].set_ylabel("arm on box [N]")
    _save(figure, axes, path)


def _figures(force: Force) -> str:
    steady = force.steady().push
    return f"{steady.mean():.2f} +- {steady.std():.2f} N"


def _finish(figure: Any, axes: Any, path: Path) -> None:
    axes[0].set_ylabel("arm on box [N]")
    for axis in axes:
        axis.legend(fontsize=7, loc="upper right")
    _save(figure, axes, path)


def _save(figure: Any, axes: Any, path: Path) -> None:
    for axis in np.ravel(axes):
        axis.grid(alpha=0.3)
    figure.tight_layout()
    figure.savefig(path, dpi=100)
    plt.close(figure)


PICTURES = {
    "clean_floor.png": floor_picture,
    "clean_rate.png": rate_picture,
    "clean_stiffness.png": stiffness_picture,
    "clean_impedance.png": impedance_picture,
    "clean_targets.png": targets_picture,
    "clean_real_time.png": real_time_picture,
}


def main() -> None:
    """Draws all pictures into the folder of the command line."""
    for file, draw in PICTURES.items():
        draw(Path(sys.argv[1]) / file)


if __name__ == "__main__":
    main()
