#!/usr/bin/python3
"""Publishes a transform as numbers."""

import signal

signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # before any thread is; main() takes Ctrl-C

from ik_ros.ros.tf_to_float_array import main  # noqa: E402

main()
