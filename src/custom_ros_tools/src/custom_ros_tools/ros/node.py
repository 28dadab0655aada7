"""Re-exports the functions that run a program's main function, for use by other packages."""

from custom_ros_tools.program import late_imports, run, run_command

__all__ = ["late_imports", "run", "run_command"]
