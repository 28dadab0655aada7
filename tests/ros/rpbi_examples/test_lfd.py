"""`lfd.launch operator:=scripted` ends with a line where it cannot begin.

Whole sessions by keys are in `tests/gui/rpbi_examples/test_lfd.py`, scripted ones in `./rpbi bench lfd`.
"""

from __future__ import annotations

from ros_system import wait_until

FAST = "real_time_factor:=3"


def test_a_goal_out_of_reach_is_named(ros, tmp_path):
    arguments = ("operator:=scripted", "headless:=true", f"out:={tmp_path}", "goal:=-1.6 0", FAST)
    process = ros.start(["roslaunch", "rpbi_examples", "lfd.launch", *arguments])
    wait_until(lambda: process.poll() is not None, "it ends by itself", 400.0)
    output = ros.output(process)
    assert "demonstrate: the goal is out of reach: 'end_effector_ball' misses its target by" in output
    assert "Traceback" not in output
    assert not (tmp_path / "summary.json").exists()
