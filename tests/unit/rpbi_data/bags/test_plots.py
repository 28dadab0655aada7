"""Figures of tables."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from rpbi_data.bags.plots import plot_tables
from rpbi_data.bags.transforms import TRANSLATION

TIMES = 100.0 + np.arange(5) / 10


def _table(delay_s: float = 0.0, **columns: object) -> pd.DataFrame:
    return pd.DataFrame({"record_time": TIMES + delay_s, **columns}, index=pd.Index(TIMES, name="time"))


def _lines(figure: Figure) -> dict[str, dict[str, list[float]]]:
    """Values by the labels of panel and line."""
    return {
        axes.get_ylabel(): {str(line.get_label()): list(line.get_ydata()) for line in axes.get_lines()}
        for axes in figure.axes
    }


@pytest.fixture(scope="module")
def figures() -> dict[str, Figure]:
    force = {f"{kind}/{axis}": np.full(5, float(i)) for kind in ("force", "torque") for i, axis in enumerate("xyz")}
    place = {f"position/{axis}": 0.5 for axis in "xyz"}
    contacts = _table(
        link="a", other_body=["b", "c", "b", None, "b"], normal_force=[1.0, 2.0, 3.0, np.nan, 4.0], **place, **force
    )
    moving = dict(zip(TRANSLATION, (np.arange(5.0), np.zeros(5), np.ones(5)), strict=True))
    still = dict(zip(TRANSLATION, np.ones((3, 5)), strict=True))
    frames = {"a/b": moving, "a/c": moving, "still": still, "lone": moving}
    tf = pd.concat([_table(parent="w", child=child, **columns) for child, columns in frames.items()])
    tables = {
        "/arm/joint_states": _table(0.002, **{"position/j": np.arange(5.0), "position/fixed": 0.0, "effort/j": np.nan}),
        "/ft": _table(**{f"wrench/{name}": values for name, values in force.items()}),
        "/contacts": contacts,
        "/tf": tf.sort_index(),
        "/empty": _table().iloc[:0],
    }
    return dict(plot_tables(tables, Figure))


def test_each_kind_of_table_has_its_figures(figures: dict[str, Figure]) -> None:
    assert list(figures) == ["arm.joint_states", "ft", "contacts", "tf.a", "tf.lone", "rates", "latencies"]
    assert _lines(figures["arm.joint_states"]) == {"position [rad or m]": {"j": [0, 1, 2, 3, 4]}}
    assert _lines(figures["ft"])["torque [N m]"] == {"x": [0] * 5, "y": [1] * 5, "z": [2] * 5}
    x, y, z = [0, 1, 2, 3, 4], [0] * 5, [1] * 5
    assert _lines(figures["tf.a"]) == {
        "x in w [m]": {"b": x, "c": x},
        "y in w [m]": {"b": y, "c": y},
        "z in w [m]": {"b": z, "c": z},
    }
    assert _lines(figures["tf.lone"])["z in w [m]"] == {"lone": z}
    assert all("[" in axes.get_ylabel() for figure in figures.values() for axes in figure.axes)


def test_times_without_contact_have_no_force(figures: dict[str, Figure]) -> None:
    assert _lines(figures["contacts"]) == {"normal force [N]": {"by b": [1, 0, 3, 0, 4], "by c": [0, 2, 0, 0, 0]}}


def test_time_starts_at_the_first_row(figures: dict[str, Figure]) -> None:
    (line,) = figures["arm.joint_states"].axes[0].get_lines()
    np.testing.assert_allclose(line.get_xdata(), np.arange(5) / 10, atol=1e-9)


def test_rates_and_latencies_are_those_of_the_topics(figures: dict[str, Figure]) -> None:
    assert list(_lines(figures["rates"])["time [ms]"]) == ["/arm/joint_states", "/ft", "/contacts", "/tf"]
    np.testing.assert_allclose(_lines(figures["rates"])["time [ms]"]["/ft"], [100] * 4)
    latencies = _lines(figures["latencies"])["delay [ms]"]
    assert list(latencies) == ["/arm/joint_states"]
    np.testing.assert_allclose(latencies["/arm/joint_states"], [2] * 5, atol=1e-6)


def test_no_tables_give_no_figures() -> None:
    assert dict(plot_tables({}, Figure)) == {}
