"""Worlds with known parameters, and 60 s of noisy motion of each."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rpbi_reality.evaluation import world_file
from rpbi_reality.identification.fit_config import FitConfig
from rpbi_reality.identification.identify import read_fit
from rpbi_reality.identification.synthetic import write_motion

WORLD = world_file("identification/world.yaml")
RUNS = 20
"""Runs of 3 s."""
RANGES = {
    "friction": (0.2, 0.6),
    "mass": (0.3, 1.2),
    "damping": (0.01, 0.08),
    "gain": (0.02, 0.12),
    "delay": (0.005, 0.03),
}
"""Ranges of the true values; those of `delay` are around 10 ms."""
FURTHER = {
    "puck_friction": {"set": "puck.changeDynamics.lateralFriction", "bounds": [0.02, 0.4]},
    "tracker_delay": {"set": ["measured.box.delay_s", "measured.bob.delay_s"], "bounds": [0.0, 0.05]},
    "offset_x": {"set": "measured.box.offset[0]", "bounds": [-0.02, 0.02]},
    "offset_y": {"set": "measured.box.offset[1]", "bounds": [-0.02, 0.02]},
    "offset_z": {"set": "measured.box.offset[2]", "bounds": [-0.02, 0.02]},
}
"""Five further parameters."""
FURTHER_VALUES = {
    "puck_friction": 0.12,
    "tracker_delay": 0.013,
    "offset_x": 0.004,
    "offset_y": -0.006,
    "offset_z": 0.002,
}


def known_fit(further: bool = False) -> FitConfig:
    """Returns parameters and signals; all runs are for the search.

    Args:
        further: Whether there are ten parameters instead of five.
    """
    config = read_fit(Path(WORLD).with_name("fit.yaml"))
    data = config.model_dump(exclude_unset=True) | {"runs": {"count": RUNS}}
    if further:
        data["parameters"] = {**data["parameters"], **FURTHER}
    return FitConfig.parse(data, "fit.yaml")


def known_values(seed: int) -> dict[str, float]:
    """Draws true values of the five parameters."""
    random = np.random.default_rng([seed, 48])
    return {name: float(np.exp(random.uniform(*np.log(ends)))) for name, ends in RANGES.items()}


def write_known_motion(path: Path, config: FitConfig, values: dict[str, float], seed: int) -> None:
    """Writes 60 s of motion at 100 Hz with noise of 1 mm and 1 mrad."""
    joints = ("shoulder",)
    write_motion(
        path,
        WORLD,
        config,
        values,
        {"arm/target": joints},
        joints={"arm": joints},
        runs=RUNS,
        duration_s=3.0,
        seed=seed,
    )
