"""Runs the benchmarks, as `./rpbi bench` does."""

from custom_ros_tools.console.modules import run_console

run_console("custom_ros_tools.console.bench")
