"""A node goes about its business without a master, and the master that comes back knows what has become of it."""

from __future__ import annotations

import os
import signal

import pytest
from ros_system import wait_until

NODE = "/busy"
OWN = {("serves", f"{NODE}/{name}") for name in ("get_loggers", "set_logger_level")} | {("publishes", "/rosout")}
OLD = {("publishes", "/old"), ("subscribes", "/heard"), ("serves", "/old_too")} | OWN
NEW = {("publishes", "/new"), ("serves", "/new_too")} | OWN


@pytest.mark.parametrize("way", ["is killed", "hangs"])
def test_what_is_opened_and_closed_while_the_master_is_away(ros, tmp_path, second_master, way):
    sign = tmp_path / "now"
    node = ros.start_program("busy_without_master.py", str(sign), **second_master.environment)
    wait_until(lambda: "ready" in ros.output(node), "the node is up")
    wait_until(lambda: set(second_master.registrations(NODE)) == OLD, "the master knows it")
    assert second_master.api.getParam("/old_parameter") == 1
    if way == "hangs":
        os.killpg(second_master.process.pid, signal.SIGSTOP)
    else:
        second_master.kill()
    try:
        wait_until(lambda: "cannot be reached" in ros.output(node), "the node misses it")
        sign.touch()
        wait_until(lambda: "done" in ros.output(node), "the node waits for nobody")
        assert ros.output(node).count("cannot be reached") == 1
    finally:
        if way == "hangs":
            os.killpg(second_master.process.pid, signal.SIGCONT)
        else:
            second_master.start()
    wait_until(lambda: set(second_master.registrations(NODE)) == NEW, "the master knows what has become of it")
    names = second_master.api.getParamNames()
    assert "/new_parameter" in names
    assert way == "hangs" or "/old_parameter" not in names


@pytest.mark.quick
def test_a_master_that_ends_while_a_node_starts_is_told_in_one_line(ros, second_master):
    node = ros.start_program("loses_its_master.py", str(second_master.process.pid), **second_master.environment)
    assert node.wait(60.0) == 1
    said = ros.output(node)
    assert said.count("has gone while the node was starting") == 1 and "Traceback" not in said, said
