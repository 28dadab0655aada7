#!/usr/bin/python3
"""Drives a mobile base along a route."""

import signal

signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # before any thread starts
from rpbi_examples.ros.moving_robots import drive_around  # noqa: E402

drive_around()
