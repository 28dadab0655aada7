#!/usr/bin/python3
"""Draws mirrored circles with two arms."""

import signal

signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # before any thread starts
from rpbi_examples.ros.dual_arm_example import main  # noqa: E402

main()
