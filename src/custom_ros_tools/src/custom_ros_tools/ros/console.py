"""Programs that run a command, see `custom_ros_tools.console`."""

import sys
from collections.abc import Iterable, Sequence

from custom_ros_tools.console.command import Command
from custom_ros_tools.console.modules import command_of, module_names, modules_of, workspace

from .node import run_command


def run_console(module: str, words: Sequence[str] | None = None) -> None:
    """Runs the command of a module and exits.

    Args:
        module: Full name of the module, whose last part is the name of the command.
        words: Arguments of the command, by default those of the process.
    """
    given = sys.argv[1:] if words is None else words
    run_command(f"{module}:{module.rpartition('.')[2]}", lambda function: Command(function).run(given))


def run_console_of(*packages: str) -> None:
    """Runs the command of some packages that the first argument of the process names, and exits."""
    _run_one_of(module for package in packages for module in modules_of(package))


def run_console_of_workspace() -> None:
    """Runs the command of the workspace that the first argument of the process names, and exits."""
    _run_one_of(module_names(workspace()))


def _run_one_of(modules: Iterable[str]) -> None:
    by_name = {module.rpartition(".")[2]: module for module in modules}
    name, *words = sys.argv[1:] or ["--help"]
    if name in by_name:
        run_console(by_name[name], words)
    for each in filter(None, map(command_of, by_name.values())):
        print(f"{each.name:<8} {each.summary}")
    sys.exit(0 if name in ("-h", "--help") else f"There is no command '{name}'.")
