"""The haptic loop in its own process: forces end when either process stops or dies, and the target never jumps."""

from __future__ import annotations

import math
import os
import signal
import socket
import subprocess
import sys
import time

import pytest
from ros_system import SUPPORT, is_running, support_on_path, wait_until
from writing_hand import forces_in, setup_of

from operator_node.haptics import loop_client as client_module
from operator_node.haptics.link import Link, LoopReport
from operator_node.haptics.loop_client import LoopClient

SILENCE_S = 0.02


def way(report: LoopReport) -> float:
    """Returns how far the target has gone [m], along x."""
    return report.snapshot.displacement[0] if report.snapshot else math.nan


def test_force_ends_within_20_ms_after_the_node_stops_responding(tmp_path):
    """By the times of the ticks themselves, so that the load of the machine does not matter."""
    file = tmp_path / "forces"
    command = [sys.executable, str(SUPPORT / "plugins/writing_hand.py"), str(file)]
    node = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env={**os.environ, **support_on_path()})
    loop = int(node.stdout.readline())
    try:
        for fault in (signal.SIGSTOP, signal.SIGSTOP, signal.SIGKILL):
            wait_until(lambda: forces_in(file, 1)[0].force_n > 1.0, "the hand feels the force")
            node.send_signal(fault)
            os.waitid(os.P_PID, node.pid, os.WSTOPPED | os.WEXITED | os.WNOWAIT)
            gone_s = time.monotonic()
            if fault == signal.SIGKILL:
                wait_until(lambda: not is_running(loop), "the loop's process ends")
            else:
                wait_until(lambda s=gone_s: forces_in(file, 1)[0].at_s > s + 2.0 * SILENCE_S, "the loop goes on")
            forces = forces_in(file)
            assert forces[-1].force_n == 0.0
            assert [each for each in forces if each.at_s > gone_s + SILENCE_S and each.force_n] == []
            assert [each for each in forces if each.at_s < gone_s and each.force_n], "there was one"
            node.send_signal(signal.SIGCONT)
    finally:
        node.kill()
        node.wait()


def test_killed_loop_is_reported_and_restarts_without_a_jump(tmp_path):
    reports: list[LoopReport] = []
    client = LoopClient(setup_of(tmp_path / "forces"), reports.append)
    try:
        client.start()
        wait_until(lambda: way(reports[-1]) > 0.019, "the target has followed the hand")
        os.kill(client.process_id, signal.SIGKILL)
        wait_until(lambda: any("SIGKILL, and is started again" in each.trouble for each in reports), "it is told")
        wait_until(lambda: reports[-1].is_connected, "it is back by itself")
        died = next(index for index, each in enumerate(reports) if "SIGKILL" in each.trouble)
        assert reports[died].force == (0.0, 0.0, 0.0) and not reports[died].is_connected
        wait_until(lambda: way(reports[-1]) > 0.039, "the hand, which has begun anew, moves it on from where it was")
        os.kill(client.process_id, signal.SIGSTOP)
        client.reset()
        os.kill(client.process_id, signal.SIGKILL)
        wait_until(lambda: way(reports[-1]) < 0.021, "a reset that it dies without reaches the next one")
        client.reset()
        wait_until(lambda: way(reports[-1]) < 1e-3, "a reset reaches it")
        snapshots = [each.snapshot for each in reports if each.snapshot]
        for one, other in zip(snapshots, snapshots[1:]):
            assert math.dist(one.displacement, other.displacement) <= 0.2 * (other.time_s - one.time_s) + 1e-9
        client.stop()
        assert not client.report.is_connected and client.report.trouble == "stopped"
    finally:
        client.close()
    assert not is_running(client.process_id)
    assert forces_in(tmp_path / "forces", 1)[0].force_n == 0.0


def test_a_loop_that_dies_again_and_again_is_given_up(tmp_path, monkeypatch):
    monkeypatch.setattr(client_module, "MAX_FAILURES", 1)
    client = LoopClient(setup_of(tmp_path / "forces"), lambda report: None)
    os.kill(client.process_id, signal.SIGKILL)
    assert client.ended.wait(60.0)
    assert client.failure == "the process of its loop ended with signal SIGKILL, 1 times in a row"
    client.close()


def test_a_link_keeps_the_newest_and_never_waits():
    one, other = map(Link, socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET))
    assert other.newest() is None
    sent = 0
    while one.send(sent):
        sent += 1
    assert 10 < sent < 100_000
    assert other.newest() == sent - 1
    assert one.send("again") and list(other.receive()) == ["again"]
    one.close()
    other.wait(60.0)
    assert other.newest() is None and other.is_closed


@pytest.mark.parametrize("side", [0, 1])
def test_a_link_that_one_side_has_closed_is_closed(side):
    links = [*map(Link, socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET))]
    links[side].close()
    for link in links:
        link.send("nobody hears this")
        assert link.is_closed and list(link.receive()) == []
