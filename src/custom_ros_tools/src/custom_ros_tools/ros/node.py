"""Re-exports the entry points of programs, for programs of other packages."""

from custom_ros_tools.program import late_imports, run, run_command

__all__ = ["late_imports", "run", "run_command"]
