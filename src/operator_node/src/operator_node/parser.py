"""Windows of the operator's signal, as arrays."""

from typing import Any

import numpy as np
from numpy.typing import NDArray


def reconstruct_interface_log_msg(msg: Any, Nd: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns the times and signals of a message of `operator_node/window`.

    Args:
        msg: The message; its `data` are records of a time and a signal, one after the other.
        Nd: Numbers per signal.

    Returns:
        Times [s], shape (N,), oldest first, and signals, shape (Nd, N).

    Raises:
        ValueError: If the data are not records of this size.
    """
    data = np.asarray(msg.data, dtype=float)
    if Nd < 1 or data.size % (Nd + 1):
        raise ValueError(f"expected records of a time and {Nd} numbers, got {data.size} numbers altogether")
    records = data.reshape(-1, Nd + 1)
    return records[:, 0].copy(), records[:, 1:].T.copy()
