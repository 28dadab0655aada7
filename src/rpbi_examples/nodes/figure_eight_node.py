#!/usr/bin/python3
"""Moves a frame in a figure eight."""

import signal

signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # before any thread starts
from rpbi_examples.ros.moving_frames import figure_eight  # noqa: E402

figure_eight()
