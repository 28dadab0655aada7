"""`./rpbi launch lfd operator:=scripted` ends with a line and its exit code where it cannot begin.

Whole sessions by keys are in `tests/gui/rpbi_examples/test_lfd.py`, scripted ones in `./rpbi bench lfd`.
"""

from __future__ import annotations

from pathlib import Path

from ros_system import wait_until

ROOT = Path(__file__).resolve().parents[3]
SLOW_S = 400.0


def launched(ros, out: Path, *arguments: str) -> tuple[int, str]:
    """Returns exit code and output of a session."""
    command = [str(ROOT / "rpbi"), "launch", "lfd", "operator:=scripted", "headless:=true", f"out:={out}", *arguments]
    process = ros.start(command)
    wait_until(lambda: process.poll() is not None, "it ends by itself", SLOW_S)
    return process.returncode, ros.output(process)


def test_a_goal_out_of_reach_is_named(ros, tmp_path):
    code, output = launched(ros, tmp_path, "goal:=-1.6 0")
    assert code == 1
    assert "demonstrate: the goal is out of reach: 'end_effector_ball' misses its target by" in output
    assert "Traceback" not in output
    assert not (tmp_path / "summary.json").exists()
