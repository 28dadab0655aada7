"""docs/physics.md has the tables of its benchmark; the cheap ones are measured again and agree with closed forms."""

from __future__ import annotations

import re
import sys
from functools import cache
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).resolve().parents[1] / "dev/benchmarks"))

import physics  # noqa: E402
from physics.scene import Span, Table  # noqa: E402

PAGE = physics.PAGE.read_text()
measured = cache(lambda name: physics.TABLES[name]())
CHEAP = ("turning", "falling", "swinging", "tumbling", "resting")


def test_every_table_has_a_place_and_every_place_a_table():
    assert sorted(re.findall("<!-- table (.*) -->", PAGE)) == sorted(physics.TABLES)
    for name in physics.TABLES:
        begin, end = physics.place(PAGE, name)
        assert PAGE[begin:end].count("\n") > 2, f"'{name}' is empty: run ./rpbi bench physics"


@pytest.mark.parametrize("name", CHEAP)
def test_page_contains_the_measured_values(name):
    assert physics.with_tables(PAGE, {name: measured(name)}) == PAGE, "run ./rpbi bench physics"


def test_undamped_motions_match_their_closed_forms():
    ratios = {
        result.figure: result.ratio
        for name in ("turning", "falling", "swinging")
        for result in measured(name).results(name)
    }
    assert all(ratio == pytest.approx(1.0, abs=0.005) for figure, ratio in ratios.items() if "damping 0" in figure)
    assert sum("damping 0" in figure for figure in ratios) == 12
    assert ratios["turning: rolling, `rollingFriction: 0.01` [m/s^2], maximal"] == pytest.approx(1.0, rel=1e-3)
    assert ratios["falling: damping not given, default, time step 1 ms"] < 0.95


def test_table_without_a_place_is_reported_by_name():
    with pytest.raises(ValueError, match="expected one '<!-- table lost -->', found 0"):
        physics.with_tables(PAGE, {"lost": Table(("", "a"), [])})


def test_cells_become_figures_next_to_their_closed_form():
    table = Table(("what", "text", "span", "value", "closed form"), [("one", ("x", Span(0.9, 1.1), 2.0, 4.0))])
    assert table.markdown().split("\n")[2] == "| one | x | 0.900 to 1.100 | 2 | 4 |"
    found = {result.figure: (result.value, result.floor) for result in table.results("t")}
    assert found == {"t: one, span, least": (0.9, 4.0), "t: one, span, most": (1.1, 4.0), "t: one, value": (2.0, 4.0)}
