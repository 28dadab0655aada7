"""PyBullet's own lines go to the log; those of others go where they always go."""

from __future__ import annotations

import ctypes
import logging
import subprocess
import sys

import pybullet
import pytest

from rpbi.engine.client import Client

SCRIPT = """
import ctypes, logging, os, sys, threading
from rpbi.engine.client import Client

logged = logging.StreamHandler(open(sys.argv[2], "w"))
logging.getLogger("pybullet").addHandler(logged)
logging.getLogger("pybullet").setLevel(logging.INFO)
client = Client()
done = threading.Event()

def others():
    while not done.is_set():
        print("Python", flush=True)
        os.write(1, b"descriptor\\n")

thread = threading.Thread(target=others)
thread.start()
for _ in range(200):
    client.loadURDF(sys.argv[1])
done.set()
thread.join()
client.disconnect()
ctypes.CDLL(None).printf(b"C\\n")
"""
PART = "<visual><geometry><sphere radius='0.1'/></geometry></visual>"


def test_they_are_logged_and_nothing_of_others_is(tmp_path):
    (tmp_path / "bare.urdf").write_text(f"<robot name='r'><link name='bare'>{PART}</link></robot>")
    command = [sys.executable, "-c", SCRIPT, tmp_path / "bare.urdf", tmp_path / "log"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stderr == ""
    printed, logged = done.stdout.splitlines(), (tmp_path / "log").read_text()
    assert set(printed) == {"Python", "descriptor", "C"} and printed.count("Python") == printed.count("descriptor")
    assert logged.count("No inertial data for link") == 200
    assert not set(logged.splitlines()) & {"Python", "descriptor", "C"}


def test_a_constraint_that_fails_is_logged_not_printed(capfd, caplog):
    client = Client()
    with caplog.at_level(logging.INFO), pytest.raises(pybullet.error, match="createConstraint failed"):
        client.createConstraint(1, -1, 2, -1, pybullet.JOINT_FIXED, (0, 0, 0), (0, 0, 0), (0, 0, 0))
    client.disconnect()
    ctypes.CDLL(None).fflush(None)
    assert capfd.readouterr() == ("", "") and "createConstraint failed" in caplog.text
