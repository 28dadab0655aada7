#!/usr/bin/python3
"""Moves a frame in a figure eight."""

import signal

signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # before any thread starts
from rpbi_examples.ros.figure_eight import main  # noqa: E402

main()
