#!/usr/bin/python3
"""Solves problems of inverse kinematics."""

import signal

signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # before any thread is; main() takes Ctrl-C

from ik_ros.ros.solver_node import main  # noqa: E402

main()
