"""What is in a bag, counted and timed."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import genpy
import numpy as np
import pandas as pd
import pytest
import rosbag
from geometry_msgs.msg import WrenchStamped
from std_msgs.msg import Float64, Header

from rpbi_data import bag_to_dataframes, topic_report

WriteBag = Callable[..., Path]


@pytest.mark.quick
def test_rates_and_gaps_follow_stamps_and_sizes_follow_messages(
    write_bag: WriteBag,
) -> None:
    stamps_s = [1.0, 1.1, 1.2, 1.5, 1.4]  # one comes late
    wrenches = [WrenchStamped(header=Header(stamp=genpy.Time.from_sec(stamp_s))) for stamp_s in stamps_s]
    row = topic_report(write_bag(("/wrench", wrench) for wrench in wrenches)).loc["/wrench"]
    assert (row["type"], row["messages"], row["bytes"]) == ("geometry_msgs/WrenchStamped", 5, 5 * (16 + 48))
    assert row["rate_hz"] == pytest.approx(8.0)
    assert row["max_gap_s"] == pytest.approx(0.2)
    assert (row["first"], row["last"]) == (1.0, 1.5)
    assert row["set_back_s"] == pytest.approx(0.1)


def test_without_stamps_the_times_of_recording_count(write_bag: WriteBag) -> None:
    row = topic_report(write_bag([("/a", Float64())] * 11 + [("/unstamped", WrenchStamped())] * 11)).loc
    for topic in ("/a", "/unstamped"):
        assert row[topic]["rate_hz"] == pytest.approx(1000.0)
    assert row["/a"]["first"] == 100.0


def test_a_clock_of_recording_that_was_set_back_is_named(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with rosbag.Bag(str(tmp_path / "test.bag"), "w", chunk_threshold=100) as bag:
        for seconds in (10, 11, 12, 5, 6, 7):
            for topic, message in (("/a", Float64()), ("/wrench", WrenchStamped())):
                if topic == "/wrench":
                    message.header.stamp = genpy.Time(seconds)
                bag.write(topic, message, genpy.Time(seconds))
    assert list(topic_report(tmp_path / "test.bag")["set_back_s"]) == [7.0, 7.0]
    bag_to_dataframes(tmp_path / "test.bag")
    for topic in ("/a", "/wrench"):
        assert f"{topic}: its clock was set back by 7 s at 12 s" in caplog.text


def test_one_message_has_no_rate(write_bag: WriteBag) -> None:
    row = topic_report(write_bag([("/a", Float64())])).loc["/a"]
    assert np.isnan(row["rate_hz"])
    assert row["max_gap_s"] == 0.0


def test_topics_are_sorted_and_an_empty_bag_has_none(write_bag: WriteBag) -> None:
    assert list(topic_report(write_bag([("/b", Float64()), ("/a", Float64())])).index) == ["/a", "/b"]
    assert len(topic_report(write_bag([], name="empty.bag"))) == 0


def test_report_is_printed_with_all_columns_at_any_width(write_bag: WriteBag) -> None:
    topic = "/a/very/long/name/of/a/topic/that/leaves/no/space/in/a/terminal/of/eighty/columns"
    report = topic_report(write_bag([(topic, Float64())] * 3))
    with pd.option_context("display.width", 80, "display.max_columns", 4, "display.max_colwidth", 20):
        assert "..." in repr(pd.DataFrame(report)), "else nothing is left out anyway"
        printed = str(report)
    assert "..." not in printed and len(printed.splitlines()) == 3
    assert all(word in printed for word in (topic, "std_msgs/Float64", *report.columns))
