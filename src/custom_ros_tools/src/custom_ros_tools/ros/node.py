"""Entry points of programs, under the path that programs of other packages import."""

from custom_ros_tools.program import late_imports, run, run_command

__all__ = ["late_imports", "run", "run_command"]
