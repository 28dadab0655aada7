"""A node that serves what is never answered if its first argument is `serve`, else calls it; the second is its name."""

import signal
import sys
import threading

signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # before any thread is

import rospy  # noqa: E402
from std_msgs.msg import Empty  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402

from custom_ros_tools.ros.lifecycle.run_node import run_node  # noqa: E402
from custom_ros_tools.ros.services import call_service  # noqa: E402

NAME = "never_answers"


def _publish_too_late() -> None:
    """Publishes in a callback when rospy has closed its topics, but does not yet say that it is shutting down."""
    topic = rospy.Publisher("late", Empty, queue_size=1, latch=True)
    closed, published = threading.Event(), threading.Event()

    def on_message(message: Empty) -> None:
        print("takes", flush=True)
        closed.wait()
        try:
            topic.publish(message)
        finally:
            threading.Timer(0.1, published.set).start()  # rospy says something of it

    def hold_on(_: str) -> None:
        closed.set()
        published.wait(10.0)

    rospy.Subscriber("late", Empty, on_message)
    topic.publish(Empty())
    rospy.core.add_preshutdown_hook(hold_on)  # after that which closes topics


def _serve() -> rospy.Service:
    _publish_too_late()

    def keep_waiting(_: object) -> None:
        print("asked", flush=True)
        threading.Event().wait()

    return rospy.Service(NAME, Trigger, keep_waiting)


def _call() -> None:
    call_service(NAME, Trigger)


run_node(sys.argv[2], _serve if sys.argv[1] == "serve" else _call)
