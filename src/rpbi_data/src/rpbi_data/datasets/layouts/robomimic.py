"""Names in the HDF5 file of a robomimic data set, and the scaling of its actions."""

from __future__ import annotations

import numpy as np

from rpbi_data.datasets.format import Array

FILE = "dataset.hdf5"
_OBSERVATION = "observation."
ACTIONS = "actions"
"""Name of the actions of an episode in the file."""


def observation_key(key: str) -> str:
    """Returns the name of a feature in the groups `obs` and `next_obs`."""
    return key.removeprefix(_OBSERVATION).replace(".", "_")


def scaled(actions: Array, low: Array, high: Array) -> Array:
    """Returns actions in [-1, 1]; 0 where all are the same.

    Args:
        actions: Shape (n, columns).
        low: Least action of each column.
        high: Largest action of each column.
    """
    extent = np.where(high > low, high - low, 1.0)
    return np.asarray(np.where(high > low, np.clip(2.0 * (actions - low) / extent - 1.0, -1.0, 1.0), 0.0))
