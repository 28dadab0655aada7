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
    guard.checks = [check for check in guard.checks if bad != "collision" or check.name != "environment"]
    count = 1200 if bad == "collision" else 300
    report = guard_fuzz.fuzz(guard, guard_fuzz.Oracle(urdf), count, np.random.default_rng(1), every=100)
    assert any(bad in fault for fault in report.faults)


def test_from_inside_the_margin_the_robot_gets_away(urdf):
    guard, oracle = guard_fuzz.guard_of(urdf, "limit"), guard_fuzz.Oracle(urdf)
    assert guard_fuzz.ways_out(guard, oracle, 5, np.random.default_rng(2)) == (5, 0)
