"""All ways to get there: elbow up, elbow down, ranked."""

from __future__ import annotations

import math

import pytest
from planar_arm import planar_arm

from ik_ros.problem import IKProblem


def _arm(tmp_path, **options):
    return planar_arm(tmp_path, solver="global", restarts=30, **options)


UP, DOWN = (0.2, 1.0, -0.9), (1.2, -1.0, 0.1)
"""An arm of two equal parts reaches a pose in two ways: both have the hand at 0.3 rad."""


@pytest.mark.parametrize(("start", "best", "other"), [(UP, UP, DOWN), (DOWN, DOWN, UP)])
def test_both_elbow_solutions_are_found_nearest_to_the_start_first(tmp_path, start, best, other):
    arm = _arm(tmp_path)
    near = dict(zip(arm.joint_names, [0.8 * position for position in start]))
    solution = arm.solve(IKProblem(target=arm.chain.pose(UP), start=near))
    assert solution.success
    assert solution.positions == pytest.approx(best, abs=0.01)
    assert len(solution.alternatives) == 1
    assert solution.alternatives[0] == pytest.approx(other, abs=0.01)


def test_ranking_by_middle_of_limits_puts_that_solution_first(tmp_path):
    arm = _arm(tmp_path, rank_by="middle_of_limits")
    for start in (UP, DOWN):
        solution = arm.solve(IKProblem(target=arm.chain.pose(UP), start=dict(zip(arm.joint_names, start))))
        assert solution.positions == pytest.approx(UP, abs=0.01), "1 rad at most, where the other has 1.2"
        assert [pytest.approx(DOWN, abs=0.01)] == list(solution.alternatives)


def test_at_most_the_requested_number_of_alternatives_is_returned(tmp_path):
    arm = _arm(tmp_path, most=1)
    assert arm.solve(IKProblem(target=arm.chain.pose(UP))).alternatives == ()


def test_distinct_means_distinct(tmp_path):
    """With any hand angle, the arm has two families of solutions: samples of them are apart."""
    arm = _arm(tmp_path, distinct=0.4)
    problem = IKProblem(
        target=arm.chain.pose(UP), position_tolerance=(0.2, 0.2, 0.0), rotation_tolerance=(0.0, 0.0, 4.0)
    )
    solution = arm.solve(problem)
    found = [solution.positions, *solution.alternatives]
    assert len(found) > 2
    for i, q in enumerate(found):
        assert all(max(abs(a - b) for a, b in zip(q, other)) > 0.4 for other in found[:i])


def test_best_attempt_is_returned_without_a_solution(tmp_path):
    arm = _arm(tmp_path)
    x, y, z = 2.0, 0.0, 0.0
    solution = arm.solve(IKProblem(target=arm.chain.pose(UP)._replace(position=(x, y, z))))
    assert not solution.success and solution.alternatives == ()
    assert math.isclose(solution.position_error_m, 1.0, abs_tol=0.2)
