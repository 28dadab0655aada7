#!/usr/bin/python3
"""Drives a mobile base along a route."""

import signal

signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # before any thread starts
from rpbi_examples.ros.drive_around import main  # noqa: E402

main()
