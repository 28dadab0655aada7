"""How far motion and contact are from closed forms; writes the tables of docs/physics.md."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from result import Result

from . import contact, energy, friction, motion, soft, tasks
from .scene import Table

PAGE = Path(__file__).resolve().parents[3] / "docs" / "physics.md"
TABLES: Mapping[str, Callable[[], Table]] = {
    each.__name__: each
    for each in (
        *(friction.sliding, friction.sliding_by_setting, friction.slope, friction.creep, friction.turning),
        *(motion.falling, motion.swinging, motion.bouncing, motion.bouncing_by_floor),
        *(energy.tumbling, energy.cradling),
        *(contact.resting, contact.stiffness, contact.stacking, contact.loading),
        *(tasks.pushing, tasks.grasping, tasks.wiping, soft.weighing),
    )
}
QUICK = ("sliding", "turning", "falling", "swinging", "resting")


def run(quick: bool) -> list[Result]:
    """Measures all tables and writes them into the page.

    Args:
        quick: Whether those that take a second each will do; then the page stays as it is.
    """
    for name in TABLES:
        place(PAGE.read_text(), name)
    tables = {name: TABLES[name]() for name in (QUICK if quick else TABLES)}
    if not quick:
        PAGE.write_text(with_tables(PAGE.read_text(), tables))
    return [result for name, table in tables.items() for result in table.results(name)]


def with_tables(page: str, tables: Mapping[str, Table]) -> str:
    """Returns a page with these tables in the places that are marked with their names.

    Raises:
        ValueError: If a table has no place.
    """
    for name, table in tables.items():
        begin, end = place(page, name)
        page = page[:begin] + table.markdown() + "\n" + page[end:]
    return page


def place(page: str, name: str) -> tuple[int, int]:
    """Returns where the table of a name begins and ends in a page.

    Raises:
        ValueError: If it has no place.
    """
    mark = f"<!-- table {name} -->\n"
    if page.count(mark) != 1:
        raise ValueError(f"{PAGE.name}: expected one '{mark.strip()}', found {page.count(mark)}")
    begin = page.index(mark) + len(mark)
    return begin, page.index("<!-- end -->", begin)
