"""Threads that start while the priority of their process is changed are changed as well."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

PROGRAM = """
import os
import threading
from rpbi.render import priority

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
