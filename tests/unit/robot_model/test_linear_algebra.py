"""Equations with symmetric positive definite matrices: right, and equal to the last bit with any number of threads."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

from robot_model.linear_algebra import inverse, solve

SIZES = (1, 2, 6, 7, 14, 30, 60)
HASH_OF_SOLUTIONS = f"""
import hashlib
import numpy as np
from robot_model.linear_algebra import inverse, solve
found = hashlib.sha256()
for size in {SIZES}:
    rng = np.random.default_rng(size)
    for _ in range(20):
        half = rng.normal(size=(size, size))
        matrix = half @ half.T + np.eye(size)
        found.update(solve(matrix, rng.normal(size=size)).tobytes() + inverse(matrix).tobytes())
print(found.hexdigest())
"""


@pytest.mark.parametrize("size", SIZES)
def test_solutions_are_right_and_leave_their_arguments_alone(size):
    rng = np.random.default_rng(size)
    half, right = rng.normal(size=(size, size)), rng.normal(size=size)
    matrix = half @ half.T + np.eye(size)
    before = matrix.copy(), right.copy()
    assert matrix @ solve(matrix, right) == pytest.approx(right, abs=1e-9)
    assert matrix @ inverse(matrix) == pytest.approx(np.eye(size), abs=1e-9)
    assert np.array_equal(matrix, before[0]) and np.array_equal(right, before[1])


def test_they_do_not_depend_on_the_number_of_threads():
    def solved_with(threads: int) -> str:
        extra = {"PYTHONPATH": os.pathsep.join(sys.path), "OPENBLAS_NUM_THREADS": str(threads)}
        command = [sys.executable, "-c", HASH_OF_SOLUTIONS]
        return subprocess.run(command, env={**os.environ, **extra}, check=True, capture_output=True, text=True).stdout

    assert solved_with(1) == solved_with(2)
