"""What is said of one press and release."""

from __future__ import annotations

import pytest

from rpbi_examples.press_report import Press, Sample

STIFFNESS, SCALE, TOUCH_M = 500.0, 0.5, 0.135


def pressed(depth_m: float, felt: float = 1.0, stiffness: float = STIFFNESS) -> Press:
    """Returns a press: a second above, a second down, a second below, a second up and one above."""
    press = Press(STIFFNESS, SCALE, TOUCH_M)
    for tick in range(500):
        time_s = tick / 100.0
        share = min(max(time_s - 1.0, 0.0), max(4.0 - time_s, 0.0), 1.0)
        tool_z = TOUCH_M + 0.01 - share * (0.01 + depth_m)
        force_n = stiffness * max(TOUCH_M - tool_z, 0.0)
        press.add(Sample(time_s, 0.0, tool_z, tool_z, force_n, felt * SCALE * force_n))
    return press


def test_it_tells_force_and_depth_where_they_are_steady():
    press = pressed(0.01)
    report = press.report()
    assert press.is_over
    assert report.depth_m == pytest.approx(0.01)
    assert report.measured_n == pytest.approx(5.0)
    assert (report.error, report.felt_error) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert "10.0 mm: 5.00 N on the tool" in str(report)


def test_a_softer_box_and_a_weaker_hand_are_told():
    assert pressed(0.01, stiffness=450.0).report().error == pytest.approx(0.1)
    assert pressed(0.01, felt=0.8).report().felt_error == pytest.approx(0.2)


def test_a_tool_that_never_touches_is_not_over():
    press = pressed(-0.005)
    assert not press.is_over and press.report() is None


def test_table_and_figure(tmp_path):
    press = pressed(0.01)
    press.write_table(tmp_path / "press.csv")
    lines = (tmp_path / "press.csv").read_text().splitlines()
    assert lines[0].startswith("time_s,handle_z,target_z") and len(lines) == 501
    press.write_figure(tmp_path / "press.png")
    assert (tmp_path / "press.png").read_bytes().startswith(b"\x89PNG")
