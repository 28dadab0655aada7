"""Runs the benchmarks, as `./rpbi bench` does."""

from custom_ros_tools.ros.node import run_command

run_command("run:main")
