"""Timers by the wall clock."""

from __future__ import annotations

import threading

import pytest
import rospy

from custom_ros_tools.ros.lifecycle import wall_time
from custom_ros_tools.ros.lifecycle.wall_time import MAX_KINDS, ThrottledWarning, WallTimer


@pytest.mark.parametrize("is_ended", [False, True], ids=["while it runs", "at the end"])
def test_an_exception_is_logged_unless_the_timer_has_been_stopped(monkeypatch, is_ended):
    """A node that ends closes its topics before rospy says that it does."""
    called, logged, is_made = threading.Semaphore(0), [], threading.Event()
    monkeypatch.setattr(wall_time.rospy, "logwarn", lambda *words: logged.append(words))

    def publish() -> None:
        assert is_made.wait(10.0)
        if is_ended:
            timer.stop()
        called.release()
        raise rospy.ROSException("topic was closed during publish()")

    before = set(threading.enumerate())
    timer = WallTimer(200.0, publish)
    (thread,) = set(threading.enumerate()) - before
    is_made.set()
    assert called.acquire(timeout=10.0)
    assert is_ended or called.acquire(timeout=10.0), "it goes on"
    timer.stop()
    thread.join(10.0)
    assert len(logged) == (0 if is_ended else 1)


def test_one_refusal_of_each_kind_is_logged(monkeypatch):
    logged = []
    monkeypatch.setattr(wall_time.rospy, "logwarn", lambda text, *words: logged.append(text % words))
    warn = ThrottledWarning(period_s=3600.0)
    for value in (1.5, -2e-3, 30):
        warn("/target", f"must be within -1 to 1, got {value}")
        warn("/target", "unknown joint 'elbow'")
        warn("/other", f"must be within -1 to 1, got {value}")
    kinds = ["/target: must be within -1 to 1, got 1.5", "/target: unknown joint 'elbow'"]
    assert logged == [*kinds, "/other: must be within -1 to 1, got 1.5"]
    for letters in ("a" * length for length in range(1, 3 * MAX_KINDS)):
        warn("/many", letters)
    assert len(logged) == 3 + MAX_KINDS
    rarely = ThrottledWarning(period_s=3600.0, max_kinds=1)
    for name in ("table", "wall"):
        rarely("guard", f"near the {name}")
    assert logged[3 + MAX_KINDS :] == ["guard: near the table"]
