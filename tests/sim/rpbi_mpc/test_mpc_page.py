"""The blocks of docs/mpc.md run, one after the other in one process."""

from __future__ import annotations

import pytest
from page_blocks import blocks_of
from page_runs import run_blocks


@pytest.mark.thorough
def test_code_blocks_of_the_page_give_the_documented_results(tmp_path):
    printed = run_blocks(blocks_of("docs/mpc.md", "python"), tmp_path)
    place, counts, pushed, is_cheaper = "".join(printed).splitlines()[-4:]
    assert float(place.strip("[]")) == pytest.approx(0.5, abs=0.02)
    assert counts.startswith("{'solved': 75,")
    finished, error_mm = pushed.split()
    assert finished == "True" and float(error_mm) < 15.0
    assert is_cheaper == "True", "the last plan costs less than the first"
    assert (tmp_path / "goto/cycles.csv").exists()
