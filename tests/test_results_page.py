"""docs/results.md has the kept figures of the benchmarks."""

from __future__ import annotations

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT / "dev/benchmarks"))

import results_page  # noqa: E402
from result import Result, Target  # noqa: E402

MACHINE = dict.fromkeys(("date", "commit", "cores", "processor", "load_average", "python", "pybullet", "renderer"), "?")


def test_page_is_that_of_the_kept_figures():
    assert (ROOT / "docs/results.md").read_text() == results_page.page(), "run ./rpbi bench NAME --page"


def test_new_figures_replace_former_ones_of_the_same_benchmark(monkeypatch, tmp_path):
    monkeypatch.setattr(results_page, "KEPT", tmp_path)
    for name, value in (("loop", 1.0), ("tables", 2.0), ("loop", 30.0)):
        figures = [Result(name, f"time of {name}", value, "ms", floor=10.0, target=Target(2.0, of_floor=True))]
        results_page.keep(name, figures, MACHINE, quick=True)
    page = results_page.page()
    assert "| time of loop | 30 | ms | 10 | 3 | <= 2 x floor | no |" in page and "| time of loop | 1 |" not in page
    assert "| time of tables | 2 | ms | 10 | 0.2 | <= 2 x floor | yes |" in page
    assert page.count("Quick run of ? at commit `?`: ? cores") == 2
