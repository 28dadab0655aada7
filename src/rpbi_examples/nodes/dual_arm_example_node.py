#!/usr/bin/python3
"""Draws mirrored circles with two arms."""

import signal

signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # before any thread starts
from rpbi_examples.ros.moving_robots import dual_arm_example  # noqa: E402

dual_arm_example()
