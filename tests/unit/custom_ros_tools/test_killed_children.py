"""What does not end by itself is killed, with its children in sessions of their own."""

from __future__ import annotations

import select
import subprocess
import sys

from custom_ros_tools.child_process import kill_with_children

PARENT = """
import signal, subprocess, sys
signal.signal(signal.SIGINT, signal.SIG_IGN)
subprocess.Popen(["sleep", "300"], start_new_session=True)
print("ready", flush=True)
signal.pause()
"""


def test_children_in_sessions_of_their_own_are_killed_too():
    process = subprocess.Popen([sys.executable, "-c", PARENT], stdout=subprocess.PIPE, start_new_session=True)
    assert process.stdout is not None and process.stdout.readline() == b"ready\n"
    kill_with_children(process)
    ended, _, _ = select.select([process.stdout], [], [], 60.0)
    assert ended, "the child still has its end of the pipe"
    assert process.returncode < 0
