"""Pictures of docs/clean_forces.md: the arm of the demo pushes its box, with one setting or another.

All of it is simulated tick by tick, so that the pictures are the same on any machine.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from plots import new_figure, save
from pushes import COMPLIANT, PLANE, Force, pushed

from custom_ros_tools.plot_style import BLUE, INK, ORANGE, legend_below

BEFORE, AFTER = ORANGE, BLUE
"""Colours of a push without and with a setting."""
TOP_N = 25.0
"""Largest force in plots of whole pushes; first touches are higher [N]."""
RUN_UP_M = 0.035
"""Run-up with which the arm reaches the speed of the push before it touches the box [m]."""
LATE_S, VERY_LATE_S = 0.015, 0.06
"""Largest delays of targets: less and more than the buffer hides [s]."""


def draw_floor(path: Path) -> None:
    """Draws a push over a plane, and over a box."""
    forces = {"a plane": pushed(objects={"floor": PLANE}), "a box": pushed()}
    figure, axes = new_figure(2, 2, (9.0, 5.0), sharex=True, height_ratios=(3, 1))
    for column, (name, force) in enumerate(forces.items()):
        above, below = axes[column], axes[2 + column]
        above.plot(force.time_s, force.friction, color=INK, lw=3.0, alpha=0.35, label="friction limit, \u03bc N")
        above.plot(force.time_s, force.push, color=AFTER, lw=1.0, label="push of the arm")
        above.set(title=f"floor: {name}\n{_steady(force)}", ylim=(0.0, TOP_N))
        below.plot(force.time_s, force.points, color=INK, lw=1.0)
        below.set(ylim=(0.0, 4.6), yticks=range(5), xlabel="time [s]")
        _mark_top(above, force)
    axes[0].set_ylabel("force [N]")
    axes[2].set_ylabel("contact points\nof the floor")
    legend_below(figure, axes[0], 2)
    save(figure, path)


def draw_rate(path: Path) -> None:
    """Draws the first touch by length of the tick, and chattering forces by which of them are reported."""
    figure, (touch, chatter) = new_figure(1, 2, (9.6, 4.0))
    for colour, step_ms in zip((BEFORE, AFTER, INK), (1, 2, 4)):
        force = pushed(step_ms / 1000.0, length_m=0.05, run_up_m=RUN_UP_M)
        label = f"timeStep {step_ms} ms: {force.push.max():.0f} N"
        touch.plot(_since_touch_ms(force), force.push, "o-", color=colour, ms=4, label=label)
    touch.set(xlim=(-10.0, 20.0), xlabel="time since the touch [ms]", ylabel="push of the arm [N]", title="first touch")
    styles = {
        "every tick (1 kHz)": (1000.0, {"color": "#b8bdc2", "lw": 1.0}),
        "hz: 100": (100.0, {"color": BEFORE, "marker": "o", "ms": 5, "ls": ""}),
        "hz: 100, average: true": (100.0, {"color": INK, "marker": "o", "ms": 4}),
    }
    for name, (hz, style) in styles.items():
        contacts = {"hz": hz, "average": "average" in name}
        force = pushed(objects={"floor": PLANE, "box": {"contacts": contacts}})
        chatter.plot(force.time_s, force.push, label=name, **style)
    chatter.set(xlim=(1.0, 1.3), ylim=(0.0, 18.0), xlabel="time [s]", title="forces that chatter, on a plane")
    for axes in (touch, chatter):
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.17))
    save(figure, path)


def draw_stiffness(path: Path) -> None:
    """Draws a push of a rigid box, and of one whose contacts give way."""
    soft = pushed(objects={"box": COMPLIANT}, run_up_m=RUN_UP_M)
    rigid = pushed(run_up_m=RUN_UP_M)
    _draw_touch_and_push(path, {"rigid": rigid, "contactStiffness: 1e4, contactDamping: 200": soft})


def draw_impedance(path: Path) -> None:
    """Draws a push under position control, and under impedance control."""
    modes = ("POSITION_CONTROL", "IMPEDANCE_CONTROL")
    forces = {mode: pushed(objects={"kuka_lwr": _arm_keys(mode)}, run_up_m=RUN_UP_M) for mode in modes}
    _draw_touch_and_push(path, forces)


def draw_targets(path: Path) -> None:
    """Draws pushes by targets that come late, without and with a buffer, and by targets that are made in the tick."""
    no_buffer = {"kuka_lwr": {"target_buffer_s": 0.0}}
    forces = {
        "targets up to 15 ms late,\nno buffer": pushed(objects=no_buffer, late_s=_late_targets(LATE_S)),
        "targets up to 15 ms late,\nbuffer of 20 ms": pushed(late_s=_late_targets(LATE_S)),
        "targets at every tick\n": pushed(target_hz=1000.0),
    }
    _draw_pushes(path, forces)


def draw_real_time(path: Path) -> None:
    """Draws pushes by targets that are later by the wall clock than the buffer is long, at real time and slower."""
    factors = (1.0, 0.5, 0.1)
    forces = {f"real_time_factor {each:g}": pushed(late_s=_late_targets(VERY_LATE_S, each)) for each in factors}
    _draw_pushes(path, forces)


def _arm_keys(mode: str) -> dict[str, Any]:
    """Returns keys of the example's arm with another control mode."""
    return {"setJointMotorControlArray": {"controlMode": mode}}


def _late_targets(latest_s: float, real_time_factor: float = 1.0) -> Callable[[], float]:
    """Returns delays of targets in simulated time, always the same [s]; the latest is given by the wall clock [s]."""
    chance = random.Random(1)
    return lambda: real_time_factor * chance.uniform(0.0, latest_s)


def _draw_touch_and_push(path: Path, forces: Mapping[str, Force]) -> None:
    figure, (touch, push) = new_figure(1, 2, (9.6, 4.2))
    for colour, (name, force) in zip((BEFORE, AFTER), forces.items()):
        label = f"{name}: first touch {force.push.max():.0f} N, then {_steady(force)}"
        touch.plot(_since_touch_ms(force), force.push, "o-", color=colour, ms=3, label=label)
        since_s = _since_touch_ms(force) / 1000.0
        push.plot(since_s, force.friction, color=colour, lw=5.0, alpha=0.25)
        push.plot(since_s, force.push, color=colour, lw=1.2)
    touch.set(xlim=(-10.0, 60.0), xlabel="time since the touch [ms]", title="first touch")
    touch.plot([], [], color="0.4", lw=5.0, alpha=0.35, label="friction limit of the floor, \u03bc N")
    push.set(xlim=(-0.1, None), ylim=(0.0, 10.0), xlabel="time since the touch [s]", title="the whole push")
    touch.set_ylabel("push of the arm [N]")
    legend_below(figure, touch)
    save(figure, path)


def _draw_pushes(path: Path, forces: Mapping[str, Force]) -> None:
    figure, axes = new_figure(1, len(forces), (9.6, 3.8), sharey=True)
    for axis, (name, force) in zip(axes, forces.items()):
        axis.plot(force.time_s, force.push, color=AFTER, lw=1.0)
        axis.set(title=f"{name}\n{_steady(force)}", ylim=(0.0, TOP_N), xlabel="time [s]")
        _mark_top(axis, force)
    axes[0].set_ylabel("push of the arm [N]")
    save(figure, path)


def _since_touch_ms(force: Force) -> np.ndarray:
    touch_s = force.time_s[np.argmax(force.push > 0.0)]
    return 1000.0 * (force.time_s - touch_s)


def _steady(force: Force) -> str:
    steady = force.steady().push
    return f"{steady.mean():.2f} \u00b1 {steady.std():.2f} N"


def _mark_top(axes: Axes, force: Force, top_n: float = TOP_N) -> None:
    """Writes the largest force at the upper edge, if it is above."""
    if (largest_n := force.push.max()) > top_n:
        text = f" largest: {largest_n:.0f} N"
        axes.annotate(text, (force.time_s[np.argmax(force.push)], top_n), (4, -4), fontsize=9, va="top",
                      textcoords="offset points", color=INK)  # fmt: skip
