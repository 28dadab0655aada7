"""Parameters of a world with known values are identified from 60 s of noisy motion."""

from __future__ import annotations

import pytest
from known_worlds import WORLD, known_fit, known_values, write_known_motion

from rpbi_reality.identification.identify import identify_world


@pytest.mark.thorough
def test_known_parameters_are_found_from_a_minute_of_motion(tmp_path):
    config, true = known_fit(), known_values(100)
    write_known_motion(tmp_path / "motion.npz", config, true, 100)
    found = identify_world(WORLD, tmp_path / "motion.npz", config, 2)
    first = {name: each.first for name, each in config.parameters.items()}
    for name, value in true.items():
        assert found.values[name] == pytest.approx(value, rel=0.05) != first[name]
    within = [low <= true[name] <= high for name, (low, high) in found.uncertainty.intervals.items()]
    assert sum(within) >= 4
