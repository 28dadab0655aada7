"""Children that end with their parent."""

from __future__ import annotations

import os
import signal
import subprocess
import sys

import pytest
from ros_system import is_running, wait_until

PARENT = """
import signal, subprocess, threading, time
from custom_ros_tools.child_process import start_child

children = []
def start():
    children.append(start_child(["sleep", "1000"], signal.SIGKILL, stdout=subprocess.DEVNULL))
    children.append(subprocess.Popen(["sleep", "1000"], stdout=subprocess.DEVNULL))
thread = threading.Thread(target=start)
thread.start()
thread.join()
time.sleep(0.1)
print(*(child.pid for child in children), *(child.poll() for child in children), flush=True)
time.sleep(1000)
"""


def test_child_outlives_its_starting_thread_but_not_a_killed_parent():
    parent = subprocess.Popen([sys.executable, "-c", PARENT], stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    child, control, *codes = parent.stdout.readline().split()
    assert codes == ["None", "None"]
    parent.kill()
    parent.communicate()
    wait_until(lambda: not is_running(int(child)), "the child has ended")
    assert is_running(int(control)), "a child that is started otherwise outlives its parent"
    os.kill(int(control), signal.SIGKILL)


@pytest.mark.parametrize(
    ("present", "wanted", "expected"),
    [("100, 200", "50, 60", "50 60"), ("100, 200", "150, 400", "100 200"), ("70, 70", "50, 90", "50 70")],
)
def test_lower_limits_of_the_processor_time_are_kept(present, wanted, expected):
    program = f"""
import resource
from custom_ros_tools.child_process import limit_resource
resource.setrlimit(resource.RLIMIT_CPU, ({present}))
limit_resource(resource.RLIMIT_CPU, {wanted})
print(*resource.getrlimit(resource.RLIMIT_CPU))
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60.0)
    assert done.stdout.split() == expected.split(), done.stderr
