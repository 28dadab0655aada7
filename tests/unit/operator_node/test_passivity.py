"""A handle never gives out more energy than was put in, but for the leak; a sample of the benchmark."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).resolve().parents[3] / "dev/benchmarks"))

from passivity import MAX_ACCELERATION, MAX_FORCE_N, SetUp, leak_j, run_set_up, set_up

from operator_node.haptics.coupling import stiffest_n_per_m
from operator_node.haptics.passivity import PassivityController

CASES = 20
TICKS = 3000
COARSE = (19, 46, 69, 105)
"""Seeds of set-ups in which a controller that does not know the device's resolution breaks the bound."""


@pytest.fixture(scope="module")
def outcomes():
    """Outcomes of a sample of random set-ups, with and without the controller."""
    cases = [set_up(seed) for seed in range(CASES)]
    return [run_set_up(case, TICKS) for case in cases], [run_set_up(case, TICKS, passivity=False) for case in cases]


def test_random_set_ups_are_passive(outcomes):
    for outcome in outcomes[0]:
        assert outcome.is_passive, outcome
        assert outcome.largest_n <= MAX_FORCE_N + 1e-9
        assert outcome.acceleration < MAX_ACCELERATION, "else the bound would not be the one that was stated"


def test_without_the_controller_many_are_not(outcomes):
    assert sum(not each.is_passive for each in outcomes[1]) >= 0.3 * CASES


def test_coarse_device_is_passive_only_with_known_resolution():
    """The latter is the negative control: an energy that is counted from rounded positions is not the true one."""
    cases = [set_up(seed)._replace(resolution_m=1e-5) for seed in COARSE]
    known, unknown = ([run_set_up(case, TICKS, is_resolution_known=on) for case in cases] for on in (True, False))
    assert all(each.is_passive for each in known), known
    assert not any(each.is_passive for each in unknown), unknown


def test_a_wall_that_needs_no_controller_is_left_alone():
    quick_and_soft = SetUp(1, "wrench", 100.0, 2.0, 1000.0, 0.0, 0.0)
    plain, controlled = (run_set_up(quick_and_soft, TICKS, passivity) for passivity in (False, True))
    assert controlled.interventions < 0.05 * TICKS
    assert controlled.largest_n == pytest.approx(plain.largest_n, rel=0.02)


def test_observer_counts_force_before_times_displacement():
    controller = PassivityController(10.0, 200.0, 1.0, 0.001)
    controller.is_on = False
    controller.hold((0.0, 0.0, 2.0), (0.0, 0.0, 0.0))
    controller.observe((0.1, 0.0, -0.01))
    assert controller.energy_j == pytest.approx(0.02)
    controller.observe((0.0, 0.0, 0.005))
    assert controller.energy_j == pytest.approx(0.01)


def test_force_cut_within_a_sample_counts_as_energy_given_out():
    controller = PassivityController(10.0, 200.0, 1.0, 0.001)
    for displacement, energy_j in (((0.0, 0.0, -0.001), 0.0), ((0.0, 0.0, 0.0005), -0.0005)):
        controller.energy_j = 0.0
        controller.hold((0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
        controller.cut()
        controller.observe(displacement)
        assert controller.energy_j == pytest.approx(energy_j)


def test_negative_energy_is_kept_after_a_reset():
    controller = PassivityController(10.0, 200.0, 1.0, 0.001)
    controller.energy_j = -0.001
    controller.reset()
    assert controller.energy_j == -0.001
    controller.energy_j = 0.5
    controller.reset()
    assert controller.energy_j == 0.0


def test_energy_bound_equals_that_of_the_documentation():
    assert PassivityController(MAX_FORCE_N, MAX_ACCELERATION, 1.0, 0.001).floor_j == pytest.approx(-leak_j(0.0))
    coarse = PassivityController(MAX_FORCE_N, MAX_ACCELERATION, 1.0, 0.001, resolution_m=2e-5)
    assert coarse.floor_j == pytest.approx(-leak_j(2e-5)) and leak_j(2e-5) == pytest.approx(0.002866, abs=1e-6)
    assert PassivityController(10.0, 200.0, 1.0, 0.001, allowance_j=0.05).floor_j == pytest.approx(-0.052)
    assert math.isclose(leak_j(0.0), 0.002)


def test_a_refill_gives_back_no_more_than_its_power():
    controller = PassivityController(10.0, 200.0, 1.0, 0.001, allowance_j=0.05, refill_w=0.05)
    given_j = 0.0
    for _ in range(2000):  # a hand that yields to whatever pushes it
        force = controller.hold((0.0, 0.0, 10.0), (0.0, 0.0, 0.1))
        given_j += force[2] * 1e-4
        controller.observe((0.0, 0.0, 1e-4))
    assert given_j == pytest.approx(0.05 + 0.002 + 2.0 * 0.05, abs=0.003)


def test_colgates_bound():
    assert stiffest_n_per_m(3.0, 1.0, 0.001) == pytest.approx(4000.0)
    assert stiffest_n_per_m(1.0, 2.0, 0.001) == 0.0
