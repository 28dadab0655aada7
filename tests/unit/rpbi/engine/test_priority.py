"""Scheduling of the simulator and of its renderer."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

PROGRAM = """
import os
import threading
from rpbi.engine import priority

over, find = threading.Event(), priority._threads

def find_before_another_starts(process_id):
    found = find(process_id)
    if threading.active_count() == 1:
        threading.Thread(target=over.wait).start()
    return found

os.sched_setscheduler(0, {before}, os.sched_param(0))
priority._threads = find_before_another_starts
priority.{change}
print(*(os.sched_getscheduler(int(each)) for each in os.listdir("/proc/self/task")))
over.set()
"""


@pytest.mark.parametrize(
    ("before", "change", "policy"),
    [
        (os.SCHED_OTHER, "yield_to_simulator()", os.SCHED_BATCH),
        (os.SCHED_BATCH, "run_normally(os.getpid(), 0)", os.SCHED_OTHER),
    ],
    ids=["yields", "normal"],
)
def test_all_threads_are_changed(before, change, policy):
    command = [sys.executable, "-c", PROGRAM.format(before=before, change=change)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.stdout.split() == [str(policy)] * 2, done.stderr


LOAD_PROGRAM = """
import os
import threading
from rpbi.engine.pacer import Load
from rpbi.engine.priority import RealTimePriority

def policies():
    found = {os.sched_getscheduler(int(each)) & ~os.SCHED_RESET_ON_FORK for each in os.listdir("/proc/self/task")}
    return " ".join("real-time" if each == os.SCHED_FIFO else "normal" for each in found)

over = threading.Event()
threading.Thread(target=over.wait).start()
priority = RealTimePriority()
loads = (0.2, 1000, 0.001), (0.6, 1000, 0.001), (0.2, 300, 0.001), (0.2, 0, 0.001), (0.2, 9, 0.0)
for process_s, ticks, period_s in loads:
    priority.review(Load(1.0, process_s, process_s, 0.0, ticks), period_s)
    print(policies(), flush=True)
priority.review(Load(1.0, 0.1, 0.1, 0.0, 1000), 0.001)
pid = os.fork()
if pid == 0:
    print(policies(), flush=True)
    os._exit(0)
os.waitpid(pid, 0)
priority.end()
print(policies())
over.set()
"""


def may_use_real_time() -> bool:
    """Returns whether this user may have real-time threads."""
    ask = "import os; os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(5))"
    return subprocess.run([sys.executable, "-c", ask], capture_output=True).returncode == 0


@pytest.mark.skipif(not may_use_real_time(), reason="expected the permission for real-time threads")
def test_real_time_priority_requires_less_than_half_a_processor():
    done = subprocess.run([sys.executable, "-c", LOAD_PROGRAM], capture_output=True, text=True)
    normal, real_time = "normal", "real-time"
    few_ticks_of_a_busy_machine = normal
    as_fast_as_possible = normal
    expected = [real_time, normal, few_ticks_of_a_busy_machine, real_time, as_fast_as_possible]
    assert done.stdout.splitlines() == [*expected, normal, normal], done.stderr
