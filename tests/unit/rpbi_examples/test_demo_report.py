"""What the demo says about its recording."""

import numpy as np
import pandas as pd
import pytest

from rpbi_examples.demo_report import as_text, measured_rates, tracking_error


def test_a_topic_below_95_percent_of_its_rate_is_found():
    table = measured_rates(
        {"/fast": 1000, "/slow": 940, "/edge": 950}, dict.fromkeys(("/fast", "/slow", "/edge"), 100.0), 10.0
    )
    assert table["enough"].to_dict() == {"/fast": True, "/slow": False, "/edge": True}
    assert table.loc["/slow", "rate_hz"] == 94.0


def test_a_topic_that_never_came_is_found():
    table = measured_rates({}, {"/silent": 15.0}, 10.0)
    assert table.loc["/silent", "messages"] == 0
    assert not table.loc["/silent", "enough"]


def test_the_summary_marks_what_came_too_seldom():
    topics = measured_rates({"/fast": 1000, "/slow": 1}, {"/fast": 100.0, "/slow": 100.0}, 10.0).to_dict(orient="index")
    lines = as_text({"topics": topics, "figures": {"overruns": 3}}).splitlines()
    assert [line.split()[0] for line in lines if "TOO FEW" in line] == ["/slow"]
    assert any(line.split() == ["overruns", "3"] for line in lines)


def test_tracking_error_compares_with_the_target_that_held_and_by_joint_name():
    times = np.arange(0.0, 1.0, 0.01)
    states = pd.DataFrame({"position/b": 0.5, "position/a": times}, index=times)
    targets = pd.DataFrame({"position/a": [0.0, 0.5], "position/b": [0.4, np.nan]}, index=[0.0, 0.5])
    error = tracking_error(states, targets)
    assert error.loc["b", "max"] == pytest.approx(0.1)
    assert error.loc["a", "max"] == pytest.approx(0.49)


def test_two_targets_with_one_stamp_do_no_harm():
    states = pd.DataFrame({"position/a": [1.0]}, index=[1.0])
    targets = pd.DataFrame({"position/a": [0.0, 0.7]}, index=[0.5, 0.5])
    assert tracking_error(states, targets).loc["a", "max"] == pytest.approx(0.3)
