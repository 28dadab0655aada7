#!/usr/bin/python3
"""Has an arm track a figure eight by inverse kinematics."""

import signal

signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # before any thread starts
from rpbi_examples.ros.ik_example import main  # noqa: E402

main()
