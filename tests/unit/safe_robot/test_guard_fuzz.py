"""A sample of the hostile targets of `benchmarks/guard_fuzz.py`; and its oracle finds what a bad guard lets through."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest

BENCHMARK = Path(__file__).resolve().parents[3] / "benchmarks/guard_fuzz.py"
SPEC = importlib.util.spec_from_file_location("guard_fuzz", BENCHMARK)
guard_fuzz = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(guard_fuzz)


@pytest.fixture
def urdf(tmp_path) -> str:
    path = tmp_path / "fuzzed.urdf"
    path.write_text(guard_fuzz.URDF)
    return str(path)


@pytest.mark.parametrize("policy", ["limit", "reject"])
def test_no_adversary_gets_the_robot_out_of_limits_or_into_anything(urdf, policy):
    guard, oracle = guard_fuzz.guard_of(urdf, policy), guard_fuzz.Oracle(urdf)
    report = guard_fuzz.fuzz(guard, oracle, 1200, np.random.default_rng(1))
    assert not report.faults, report.faults[:5]
    assert report.refused >= 10 and report.commands > 500 and report.brakings > 30
    assert min(report.worst.values()) > 0.5, "the adversary was not near the limits"
    assert policy == "reject" or report.nearest_m < 0.03


@pytest.mark.parametrize("bad", [*guard_fuzz.LIMITS, "collision"])
def test_the_oracle_finds_what_a_bad_guard_lets_through(urdf, bad):
    guard = guard_fuzz.guard_of(
        urdf, "limit", **{key: 1.5 * most for key, most in guard_fuzz.LIMITS.items() if key == bad}
    )
    guard.checks[:] = [check for check in guard.checks if bad != "collision" or check.name != "environment"]
    count = 1200 if bad == "collision" else 300
    report = guard_fuzz.fuzz(guard, guard_fuzz.Oracle(urdf), count, np.random.default_rng(1), every=100)
    assert any(bad in fault for fault in report.faults)


def test_from_inside_the_margin_the_robot_gets_away(urdf):
    pytest.importorskip("daqp")
    guard, free = guard_fuzz.guard_of(urdf, "limit"), guard_fuzz.guard_of(urdf, "limit", around=False)
    left = guard_fuzz.leave_margin(guard, free, guard_fuzz.Oracle(urdf), 5, np.random.default_rng(2))
    assert left.straight == 5 and not left.stuck and left.slowest >= 0.95, left


@pytest.mark.parametrize(
    "start, way", [((1.1155416, -0.26635), (-0.00841, 0.19982)), ((0.79484, -1.74236), (0.003, -0.2))]
)
def test_a_target_that_leads_away_at_a_slant_is_reached(urdf, start, way):
    """Joints that rest at different times do not go straight; the bend may not hold the robot where it is."""
    pytest.importorskip("daqp")
    guard, oracle = guard_fuzz.guard_of(urdf, "limit"), guard_fuzz.Oracle(urdf)
    target = np.add(start, way)
    commands = guard_fuzz._drive(guard, np.array(start), target)
    assert commands[-1] == pytest.approx(target, abs=2e-3) and guard_fuzz._fault(oracle, commands) is None


def test_what_holds_a_robot_between_two_margins_is_named_and_the_oracle_agrees(urdf):
    """The arm is folded onto its base and flat above the table: what leads from one brings it nearer to the other."""
    pytest.importorskip("daqp")
    guard, oracle = guard_fuzz.guard_of(urdf, "limit"), guard_fuzz.Oracle(urdf)
    commands = guard_fuzz._follow(guard, np.array((1.055, -2.642)))
    out = guard.way_out()
    assert out.is_locked and guard_fuzz._is_locked(oracle, commands[-1])
    words = out.words(guard.joint_names)
    assert words.startswith("locked inside the margin of self_collision (links 'base' and 'lower': ")
    assert "environment (link 'lower' and 'table': " in words and words.endswith(
        "no motion takes all of them further apart"
    )
    assert not guard_fuzz._is_locked(oracle, np.array((0.0, -2.642))), "the oracle finds a way where there is one"
