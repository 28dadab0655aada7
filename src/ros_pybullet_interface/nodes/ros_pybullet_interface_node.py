#!/usr/bin/python3
"""Runs the simulator node."""

import signal

signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # before any thread is; main() takes Ctrl-C

from rpbi.ros.node import main  # noqa: E402

main()
