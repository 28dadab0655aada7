"""Runs the benchmarks, as `./rpbi bench` does."""

from custom_ros_tools.ros.console import run_console

run_console("rpbi_examples.ros.console.bench")
