"""A node that serves what is never answered if its first argument is `serve`, else calls it; the second is its name."""

import signal
import sys
import threading

signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # before any thread is

import rospy  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402

from custom_ros_tools.ros.lifecycle.run_node import run_node  # noqa: E402
from custom_ros_tools.ros.services import call_service  # noqa: E402

NAME = "never_answers"


def _serve() -> rospy.Service:
    def keep_waiting(_: object) -> None:
        print("asked", flush=True)
        threading.Event().wait()

    return rospy.Service(NAME, Trigger, keep_waiting)


def _call() -> None:
    call_service(NAME, Trigger)


run_node(sys.argv[2], _serve if sys.argv[1] == "serve" else _call)
