"""The end of a node whose call nobody answers any more."""

import os
import signal

import pytest
from ros_system import wait_until


@pytest.mark.parametrize("interrupted", [True, False], ids=["both are interrupted", "the other node dies"])
def test_a_service_whose_node_goes_is_told_unless_both_are_interrupted(ros, interrupted):
    server, client = (ros.start_program("calls_a_service.py", name) for name in ("serve", "call"))
    wait_until(lambda: "asked" in ros.output(server), "the service is called")
    if interrupted:
        os.killpg(client.pid, signal.SIGINT)
    os.killpg(server.pid, signal.SIGKILL)
    assert client.wait(60.0) == (0 if interrupted else 1)
    said = ros.output(client)
    assert "Traceback" not in said, said
    assert ("its node has gone" in said) != interrupted, said
