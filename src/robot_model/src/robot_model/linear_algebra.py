"""Equations with symmetric positive definite matrices, such as mass matrices.

The results are the same to the last bit with any number of LAPACK's threads, for matrices of up to some 60 rows, unlike
those of `numpy.linalg.solve` and `inv`. Threads for several right sides at once also wait for each other, on a busy
machine much longer than the computation lasts.

That a matrix is symmetric and positive definite is not checked: for others, the results mean nothing.
"""

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def solve(matrix: Array, right: Array) -> Array:
    """Returns x of matrix x = right, for a matrix of shape (n, n); `right` and x have shape (n,)."""
    from scipy.linalg import lapack  # slow to load, and most worlds solve nothing

    solution: Array = lapack.dposv(matrix, right)[1]
    return solution


def inverse(matrix: Array) -> Array:
    """Returns the inverse of a matrix, both of shape (n, n)."""
    from scipy.linalg import lapack

    root = lapack.dtrtri(lapack.dpotrf(matrix, lower=1)[0], lower=1)[0]
    inverted: Array = root.T @ root
    return inverted
