"""Console commands that act on a running simulator."""

from custom_ros_tools.console.modules import run_console_of


def main() -> None:
    """Entry point of the program `world`: runs the command that its first argument names."""
    run_console_of(__name__, "rpbi_data.console")
