"""What the demo says about its recording."""

import numpy as np
import pandas as pd
import pytest

from rpbi_examples.demo_report import (
    as_text,
    contact_force,
    failures,
    force_figures,
    measured_rates,
    slow_lines,
    tracking_error,
)

IMAGES, REQUIRED = ("/image", "/info"), ("/states", "/tf")


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


def test_summary_marks_topics_below_their_rate():
    topics = measured_rates({"/fast": 1000, "/slow": 1}, {"/fast": 100.0, "/slow": 100.0}, 10.0).to_dict(orient="index")
    lines = as_text({"topics": topics, "figures": {"overruns": 3}}).splitlines()
    assert [line.split()[0] for line in lines if "TOO FEW" in line] == ["/slow"]
    assert any(line.split() == ["overruns", "3"] for line in lines)


def summary_of(real_time_factor=1.0, **messages):
    """Returns the summary of 10 s in which topics had so many messages, of 1000; those that are not named had all."""
    expected_hz = dict.fromkeys((*IMAGES, *REQUIRED, "/clock"), 100.0)
    counts = {topic: messages.get(topic.strip("/"), 1000) for topic in expected_hz}
    topics = measured_rates(counts, expected_hz, 10.0).to_dict(orient="index")
    figures = {"real_time_factor": real_time_factor, "draw_rate_hz": 21.0, "load_average": 13.1, "cores": 2}
    return {"topics": topics, "figures": figures}


def slow(summary):
    return slow_lines(summary, IMAGES, "world.yaml")


def test_topics_at_their_rate_are_not_mentioned():
    summary = summary_of()
    assert failures(summary, REQUIRED) == slow(summary) == []


def test_few_images_give_a_line_with_cause_and_remedy():
    summary = summary_of(image=39, info=120)
    assert failures(summary, REQUIRED) == []
    assert slow(summary) == [
        "images came at 3.9 instead of 100 Hz: with a load of 13.1 on 2 cores, drawing alone reaches 21.0 Hz, "
        "and cameras give way to all other programs. End other programs, or lower hz, width or height of rgbd_sensor "
        "in world.yaml"
    ]


def test_skipped_clock_ticks_give_a_line_but_no_failure():
    summary = summary_of(clock=670)
    assert failures(summary, REQUIRED) == []
    assert [line.partition(":")[0] for line in slow(summary)] == ["/clock came at 67.0 instead of 100 Hz"]


@pytest.mark.parametrize("topic", REQUIRED)
def test_slow_joint_states_or_tf_fail_only_without_any_message(topic):
    summary = summary_of(**{topic.strip("/"): 900})
    assert failures(summary, REQUIRED) == []
    assert [line.partition(":")[0] for line in slow(summary)] == [f"{topic} came at 90.0 instead of 100 Hz"]
    assert failures(summary_of(**{topic.strip("/"): 0}), REQUIRED) == [f"{topic} had no message"]


def test_physics_below_real_time_is_slow_and_no_failure():
    summary = summary_of(real_time_factor=0.94)
    assert slow(summary) == ["physics ran at 94% of real time, with a load of 13.1 on 2 cores"]
    assert failures(summary, REQUIRED) == []


def test_tracking_error_compares_with_the_held_target_by_joint_name():
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


def test_contact_forces_are_summed_and_zero_without_contact():
    others = [None, "floor", "arm", "arm", "floor"]
    contacts = pd.DataFrame(
        {"other_body": others, "normal_force": [np.nan, 8.0, 2.0, 3.0, 8.0]}, index=[0.1, 0.2, 0.2, 0.2, 0.3]
    )
    push = contact_force(contacts, "arm")
    assert push.to_dict() == {0.1: 0.0, 0.2: 5.0, 0.3: 0.0}
    assert force_figures(push) == {"push_mean_n": 5.0, "push_max_n": 5.0}


def test_a_box_that_nothing_has_touched_has_no_force():
    push = contact_force(pd.DataFrame({"force/x": [0.0, 0.0]}, index=[0.1, 0.2]), "arm")
    assert push.to_dict() == {0.1: 0.0, 0.2: 0.0}
    assert force_figures(push) == {"push_mean_n": 0.0, "push_max_n": 0.0}
