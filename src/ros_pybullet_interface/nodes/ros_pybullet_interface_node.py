#!/usr/bin/python3
"""Runs the simulator node."""

import signal

signal.signal(signal.SIGINT, signal.SIG_DFL)  # until rospy takes over, Ctrl-C ends it without a traceback

from rpbi.ros.node import main  # noqa: E402

main()
