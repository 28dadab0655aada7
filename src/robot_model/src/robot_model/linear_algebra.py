"""Linear equations with symmetric positive definite matrices, such as mass matrices.

For matrices of up to about 60 rows, the results are the same to the last bit with any number of LAPACK threads, unlike
those of `numpy.linalg.solve` and `inv`. The function `solve` of this module takes a single right-hand side: for several
right-hand sides, LAPACK would use several threads, which may wait long for each other on a busy machine.

The functions do not check that a matrix is symmetric and positive definite. For other matrices, results are undefined.
"""

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def solve(matrix: Array, right: Array) -> Array:
    """Solves `matrix @ x = right` for x; the matrix has shape (n, n), `right` and x have shape (n,)."""
    from scipy.linalg import lapack  # slow to import, and most worlds do not need it

    solution: Array = lapack.dposv(matrix, right)[1]
    return solution


def inverse(matrix: Array) -> Array:
    """Returns the inverse of a matrix of shape (n, n)."""
    from scipy.linalg import lapack

    root = lapack.dtrtri(lapack.dpotrf(matrix, lower=1)[0], lower=1)[0]
    inverted: Array = root.T @ root
    return inverted
