#!/usr/bin/python3
"""Broadcasts a TF frame that is dragged in RViz."""

import signal

signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # before any thread is; main() takes Ctrl-C

from ik_ros.ros.interactive_target import main  # noqa: E402

main()
