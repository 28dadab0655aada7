#!/usr/bin/python3
"""Moves the camera's frame around the scene."""

import signal

signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # before any thread starts
from rpbi_examples.ros.moving_frames import orbit  # noqa: E402

orbit()
