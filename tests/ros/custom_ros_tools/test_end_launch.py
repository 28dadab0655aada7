"""A required node that has done its work ends its launch without an error; one that fails is reported."""

from __future__ import annotations

import socketserver
import sys
import threading

import pytest
import rospy
from ros_system import wait_until

PUBLISHER = 'pkg="custom_ros_tools" type="resettable_static_transform_publisher"'
LAUNCH = f"""<launch>
  <node {PUBLISHER} name="other" args="0 0 0 0 0 0 1 map other"/>
  <node {PUBLISHER} name="worker" required="true" output="screen" launch-prefix="{{python}} {{script}}"/>
</launch>
"""
SCRIPT = """import signal, sys
signal.pthread_sigmask(signal.SIG_BLOCK, {{signal.SIGINT}})
from custom_ros_tools.ros.lifecycle.end_launch import end_launch
from custom_ros_tools.ros.lifecycle.run_node import run_node

run_node("worker", object, lambda _: {end})
"""


@pytest.mark.parametrize(
    ("end", "is_reported"), [("end_launch('done')", False), ("sys.exit(0)", True), ("sys.exit(1)", True)]
)
def test_only_success_ends_a_launch_without_an_error(ros, tmp_path, end, is_reported):
    script, launch = tmp_path / "worker.py", tmp_path / "work.launch"
    script.write_text(SCRIPT.format(end=end))
    launch.write_text(LAUNCH.format(python=sys.executable, script=script))
    roslaunch = ros.start(["roslaunch", str(launch)])
    wait_until(lambda: roslaunch.poll() is not None, "all nodes have ended", 60.0)
    assert ("REQUIRED process [worker-" in ros.output(roslaunch)) == is_reported
    assert roslaunch.returncode == 0 and "Traceback" not in ros.output(roslaunch), ros.output(roslaunch)


class NotHttp(socketserver.BaseRequestHandler):
    """A program that got the port of a `roslaunch` that was killed."""

    def handle(self) -> None:
        self.request.sendall(b"not HTTP\r\n\r\n")


def test_port_of_an_earlier_launch_may_belong_to_another_program(ros, tmp_path):
    script, launch = tmp_path / "worker.py", tmp_path / "work.launch"
    script.write_text(SCRIPT.format(end="end_launch('done')"))
    launch.write_text(LAUNCH.format(python=sys.executable, script=script))
    with socketserver.TCPServer(("127.0.0.1", 0), NotHttp) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        rospy.set_param("/roslaunch/uris/an_earlier_one", f"http://127.0.0.1:{server.server_address[1]}/")
        try:
            roslaunch = ros.start(["roslaunch", str(launch)])
            wait_until(lambda: roslaunch.poll() is not None, "all nodes have ended", 60.0)
        finally:
            rospy.delete_param("/roslaunch/uris/an_earlier_one")
            server.shutdown()
    assert "REQUIRED process" not in ros.output(roslaunch), ros.output(roslaunch)
