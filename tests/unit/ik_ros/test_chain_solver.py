"""What a solver finds is not believed but judged."""

from __future__ import annotations

import math

import pytest
from planar_arm import planar_arm

from ik_ros.chain.solver import ChainConfig, ChainSolver
from ik_ros.problem import IKProblem
from robot_model.limits import TURN

TRUTH = (0.2, 1.0, -0.9)


class Oracle(ChainSolver):
    """Answers what it was told to."""

    deterministic = True
    answers: list[tuple[float, ...]] = []

    def find(self, problem, goal, start):
        """Looks at nothing."""
        return self.answers


@pytest.fixture
def ask(tmp_path):
    planar_arm(tmp_path)
    options = {"urdf_filename": str(tmp_path / "planar.urdf"), "base_link": "base", "tip_link": "hand"}
    oracle = Oracle(ChainConfig.parse(options, "~"))

    def answer(*answers, start=(0.0, 0.0, 0.0)):
        oracle.answers = list(answers)
        begin = dict(zip(oracle.joint_names, start))
        return oracle.solve(IKProblem(target=oracle.chain.pose(TRUTH), start=begin))

    return answer


def test_a_true_answer_is_a_success(ask):
    solution = ask(TRUTH)
    assert solution.success and solution.positions == TRUTH


def test_whole_turns_are_taken_off(ask):
    solution = ask((0.2 + TURN, 1.0 - 2.0 * TURN, -0.9))
    assert solution.success and solution.positions == pytest.approx(TRUTH)


def test_an_answer_outside_limits_is_brought_in_and_no_success(ask):
    solution = ask((0.2, 3.1, -0.9))
    assert not solution.success
    assert solution.positions == (0.2, 3.0, -0.9)
    assert "misses its target by" in solution.message


def test_wrong_answer_fails_with_its_distance_from_the_target(ask):
    solution = ask((0.2, 1.0, -0.4))
    assert not solution.success
    assert (solution.position_error_m, solution.orientation_error_rad) == pytest.approx((0.0, 0.5), abs=1e-9)
    assert "and 0.5 rad; 1 mm and 0.01 rad would do" in solution.message


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_non_finite_answer_is_rejected(ask, bad):
    solution = ask((0.2, bad, -0.9), start=(0.1, 0.2, 0.3))
    assert not solution.success and solution.positions == (0.1, 0.2, 0.3)
    assert ask((0.2, bad, -0.9), TRUTH).success


def test_failed_solution_returns_the_start(ask):
    solution = ask(start=(0.1, 0.2, 0.3))
    assert not solution.success and solution.positions == (0.1, 0.2, 0.3)


def test_alternatives_are_those_that_are_true(ask):
    other = (1.2, -1.0, 0.1)
    solution = ask(TRUTH, (1.2, -1.0, 0.9), other)
    assert solution.success and solution.alternatives == (other,)
