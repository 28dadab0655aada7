"""Commands of the console for a running simulator."""

from custom_ros_tools.console.modules import run_console_of


def main() -> None:
    """Runs the command named by the first argument of the program `world`."""
    run_console_of(__name__, "rpbi_data.console")
