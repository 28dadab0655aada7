"""What is said of one press and release."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from rpbi_examples.press_report import Press, PressSample

STIFFNESS, SCALE, TOUCH_M = 500.0, 0.5, 0.135


def pressed(depth_m: float, felt: float = 1.0, stiffness: float = STIFFNESS) -> Press:
    """Returns a press: a second above, a second down, a second below, a second up and one above."""
    press = Press(STIFFNESS, SCALE, TOUCH_M)
    for tick in range(500):
        time_s = tick / 100.0
        share = min(max(time_s - 1.0, 0.0), max(4.0 - time_s, 0.0), 1.0)
        tool_z = TOUCH_M + 0.01 - share * (0.01 + depth_m)
        force_n = stiffness * max(TOUCH_M - tool_z, 0.0)
        press.add(PressSample(time_s, 0.0, tool_z, tool_z, force_n, felt * SCALE * force_n))
    return press


def test_it_reports_means_of_the_whole_press():
    press = pressed(0.01)
    report = press.report()
    assert press.is_over
    assert report.duration_s == pytest.approx(1.9, abs=0.03)
    assert report.depth_m == pytest.approx(0.0078, abs=1e-4), "a second at 10 mm, and half a second each way"
    assert report.measured_n == pytest.approx(STIFFNESS * report.depth_m)
    assert (report.error, report.felt_error, report.scatter_n) == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
    assert "7.8 mm: 3.92 N on the tool" in str(report)


def with_forces(press: Press, extra_n: Callable[[float, float], float]) -> Press:
    """Returns the press with a force in addition, of time [s] and velocity into the box [m/s]."""
    times_s, depths_m = zip(*((each.time_s, TOUCH_M - each.tool_z) for each in press.samples))
    rates = np.gradient(depths_m, times_s)
    press.samples = [
        each._replace(measured_n=each.measured_n + (extra_n(each.time_s, rate) if depth_m > 0.0 else 0.0))
        for each, rate, depth_m in zip(press.samples, rates, depths_m)
    ]
    return press


def test_damping_cancels_but_appears_as_scatter():
    report = with_forces(pressed(0.01), lambda _, rate: 20.0 * rate).report()
    assert report.error < 0.01 and report.scatter_n > 0.1


def test_a_press_is_judged_beyond_its_steadiest_moment():
    """For half a second the force is right; before it the tool sticks with 3 N more."""
    report = with_forces(pressed(0.01), lambda time_s, _: 3.0 if time_s < 2.4 else 0.0).report()
    assert report.error > 0.2 and report.scatter_n > 1.0


def test_softer_box_and_weaker_hand_are_reported():
    assert pressed(0.01, stiffness=450.0).report().error == pytest.approx(0.1)
    assert pressed(0.01, felt=0.8).report().felt_error == pytest.approx(0.2)


def test_a_tool_that_never_touches_is_not_over():
    press = pressed(-0.005)
    assert not press.is_over and press.report() is None


def test_force_is_not_looked_at_where_the_simulator_stood_still():
    press = pressed(0.01)
    press.samples = [each for each in press.samples if each.time_s % 0.3 < 0.2]
    assert press.report().error < 1e-9
    press.samples = [each for each in press.samples if each.time_s % 0.3 < 0.08]
    assert press.report() is None


def test_table_and_figure(tmp_path):
    press = pressed(0.01)
    press.write_table(tmp_path / "press.csv")
    lines = (tmp_path / "press.csv").read_text().splitlines()
    assert lines[0].startswith("time_s,handle_z,target_z") and len(lines) == 501
    press.write_figure(tmp_path / "press.png")
    assert (tmp_path / "press.png").read_bytes().startswith(b"\x89PNG")
