#!/usr/bin/python3
"""Moves the joints of a robot one after the other."""

import signal

signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # before any thread starts
from rpbi_examples.ros.moving_robots import basic_robot_example  # noqa: E402

basic_robot_example()
