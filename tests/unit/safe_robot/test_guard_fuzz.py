"""A sample of the hostile targets of `dev/robustness/guard_fuzz.py`; its oracle finds faults of a bad guard."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from safe_robot.checks.proximity import Proximity

pytest.importorskip("pinocchio")
pytest.importorskip("daqp")
sys.path.append(str(Path(__file__).resolve().parents[3] / "dev/robustness"))
from fuzz.climbing import TOLERANCE_M, Climber  # noqa: E402
from fuzz.grid import Grid  # noqa: E402
from fuzz.hostile import fuzz  # noqa: E402
from fuzz.leaving import Driver, fault_of, is_locked, leave_margin, leave_with_smaller_margin  # noqa: E402
from fuzz.oracle import Oracle  # noqa: E402
from fuzz.scenes import LIMITS, MARGIN_M, SCENES  # noqa: E402

TWO, SEVEN, LWR = (SCENES[name] for name in ("two", "seven", "lwr"))
SEED, STEPS = 11, 8
"""A climb that finds a braking inside the margin, if there is one."""


@pytest.mark.parametrize("policy", ["limit", pytest.param("reject", marks=pytest.mark.thorough)])
@pytest.mark.parametrize("scene, count", [(TWO, 1200), (SEVEN, 300)], ids=["two", "seven"])
def test_no_adversary_gets_the_robot_past_limits_or_into_collision(scene, count, policy):
    report = fuzz(scene, scene.guard(policy), Oracle(scene), count, np.random.default_rng(1))
    assert not report.faults, report.faults[:5]
    refused, commands, brakings = (10, 500, 30) if scene is TWO else (1, 120, 6)
    assert report.refused.total() >= refused and report.commands > commands and report.brakings > brakings
    assert min(report.worst.values()) > 0.5, "the adversary was not near the limits"
    assert policy == "reject" or scene is SEVEN or report.nearest_m < MARGIN_M + 0.002


@pytest.mark.parametrize(
    "scene, bad",
    [*((TWO, bad) for bad in (*LIMITS, "collision")), pytest.param(SEVEN, "collision", marks=pytest.mark.thorough)],
)
def test_oracle_finds_motions_that_a_bad_guard_accepts(scene, bad):
    guard = scene.guard("limit", **{key: 1.5 * most for key, most in LIMITS.items() if key == bad})
    guard.checks[:] = [check for check in guard.checks if bad != "collision" or check.name != "environment"]
    report = fuzz(scene, guard, Oracle(scene), 1200 if bad == "collision" else 300, np.random.default_rng(1), every=100)
    assert any(bad in fault for fault in report.faults)


def test_from_inside_the_margin_the_robot_gets_away():
    left = leave_margin(TWO, Oracle(TWO), 5, np.random.default_rng(2))
    assert left.straight == 5 and not left.stuck and left.slowest >= 0.95, left


@pytest.mark.parametrize("is_mended", [True, False])
def test_hill_climbing_finds_unsafe_braking_only_with_sparse_rows(monkeypatch, is_mended):
    """A wrist that swings its flange through the lowest point is nearest to the table between two sparse rows."""
    every = Proximity._first_in_rows

    def sparse(self, motion, suspects, rows):
        return every(self, motion, suspects, rows[self._sparse(motion.travelled[rows] @ self._furthest)])

    if not is_mended:
        monkeypatch.setattr(Proximity, "_first_in_rows", sparse)
    climber = Climber(LWR, LWR.guard("limit"), np.random.default_rng(SEED))
    least_m, course = climber.climb(STEPS)
    assert (least_m >= MARGIN_M - TOLERANCE_M) == is_mended, course


@pytest.mark.parametrize(
    "start, way",
    [
        ((1.1155416, -0.26635), (-0.00841, 0.19982)),
        ((0.79484, -1.74236), (0.003, -0.2)),
        ((0.73976, 1.55719), (-0.15992, -0.12011)),  # a first step of both joints alike leads nearer, by 0.1 um
    ],
)
def test_a_target_that_leads_away_at_a_slant_is_reached(start, way):
    """Joints that rest at different times do not go straight; the bend may not hold the robot where it is."""
    target = np.add(start, way)
    commands = Driver(TWO).drive(np.array(start), target)
    assert commands[-1] == pytest.approx(target, abs=2e-3) and fault_of(Oracle(TWO), commands) is None


def test_robot_locked_between_margins_is_released_by_a_smaller_one():
    """The arm is folded onto its base and flat above the table: what leads from one brings it nearer to the other."""
    driver, oracle = Driver(TWO), Oracle(TWO)
    there = driver.follow(np.array((1.055, -2.642)))[-1]
    out = driver.guard.way_out()
    assert out.is_locked and is_locked(oracle, there)
    words = out.words(driver.guard.joint_names)
    assert words.startswith("locked inside the margin of self_collision (links 'base' and 'lower': ")
    assert "environment (link 'lower' and 'table': " in words and words.endswith("no motion separates all of them")
    assert not is_locked(oracle, np.array((0.0, -2.642))), "the oracle finds a way where there is one"
    assert leave_with_smaller_margin(TWO, oracle, Grid(oracle), there, out) is None
