#!/usr/bin/python3
"""Moves the joints of a robot one after the other."""

import signal

signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # before any thread starts
from rpbi_examples.ros.basic_robot_example import main  # noqa: E402

main()
