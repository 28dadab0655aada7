"""What the benchmark `examples` measures."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[3] / "dev/benchmarks"))

from examples import EXAMPLES, LEFT_OUT, asked_rates, rate_results


def test_every_example_is_measured_or_left_out_for_a_reason():
    assert {"basic_example_kuka_lwr", "cup", "pushing_mpc"} <= set(EXAMPLES)
    assert len(EXAMPLES) > 25 and not set(EXAMPLES) & set(LEFT_OUT)


def test_rates_come_from_the_files_in_the_simulators_namespace():
    assert asked_rates("tracking_example", ["headless:=true"]) == {"/lab/vicon/box/box": 100.0}
    rates = asked_rates("basic_example_kuka_lwr", ["headless:=true"])
    assert rates["/rpbi/kuka_lwr/joint_states"] == 100.0 and rates["/rpbi/camera/depth/image"] == 15.0


def test_slowest_topic_and_all_that_miss_their_rate_are_named():
    asked = {"/a": 10.0, "/b": 100.0, "/c": 50.0}
    found = list(rate_results("cup", asked, {"/a": 9.9, "/b": 80.0, "/c": 45.0}))
    assert [each.figure for each in found] == ["cup: rate of /b, of 100 Hz", "cup: rate of /c, of 50 Hz"]
    assert [each.reached for each in found] == [False, False]
    (fine,) = rate_results("cup", asked, {"/a": 9.9, "/b": 100.0, "/c": 50.0})
    assert fine.figure == "cup: rate of /a, of 10 Hz" and fine.reached
