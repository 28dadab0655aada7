"""Finds and runs commands: the function NAME in `console/NAME.py` or `ros/console/NAME.py` of a package."""

import importlib
import pkgutil
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from custom_ros_tools.program import run_command

from .command import Command

FOLDERS = ("console", "ros/console")
"""Folders within a Python package whose modules may contain commands."""


def workspace() -> Path:
    """Returns the folder of the workspace, which contains the program `rpbi`."""
    return Path(__file__).resolve().parents[5]


def module_names(root: Path) -> list[str]:
    """Returns the sorted full names of all modules in a workspace that may contain commands."""
    files = {file for folder in FOLDERS for file in root.glob(f"src/*/src/*/{folder}/*.py")}
    names = (".".join(file.relative_to(root).with_suffix("").parts[3:]) for file in files if file.stem != "__init__")
    return sorted(names)


def modules_of(package: str) -> list[str]:
    """Returns the full names of all modules directly in a Python package."""
    return [f"{package}.{each.name}" for each in pkgutil.iter_modules(importlib.import_module(package).__path__)]


def command_of(module_name: str) -> Command | None:
    """Imports a module, and returns its command; None if the module lacks a function with the module's name."""
    module: Any = importlib.import_module(module_name)
    function = getattr(module, module_name.rpartition(".")[2], None)
    return Command(function) if callable(function) else None


def commands(root: Path) -> list[Command]:
    """Returns all commands of a workspace, sorted by name."""
    found = filter(None, map(command_of, module_names(root)))
    return sorted(found, key=lambda each: each.name)


def run_console(module: str, words: Sequence[str] | None = None) -> None:
    """Runs the command in a module, and exits.

    Args:
        module: Full name of the module, whose last part is the name of the command.
        words: Arguments of the command; by default the arguments of the process.
    """
    given = sys.argv[1:] if words is None else words
    run_command(f"{module}:{module.rpartition('.')[2]}", lambda function: Command(function).run(given))


def run_console_of(*packages: str) -> None:
    """Finds the command that the process's first argument names, in some Python packages. Runs it, and exits."""
    _run_one_of(module for package in packages for module in modules_of(package))


def run_console_of_workspace() -> None:
    """Finds the command that the process's first argument names, in the workspace. Runs it, and exits."""
    _run_one_of(module_names(workspace()))


def _run_one_of(modules: Iterable[str]) -> None:
    by_name = {module.rpartition(".")[2]: module for module in modules}
    name, *words = sys.argv[1:] or ["--help"]
    if name in by_name:
        run_console(by_name[name], words)
    for each in filter(None, map(command_of, by_name.values())):
        print(f"{each.name:<8} {each.summary}")
    sys.exit(0 if name in ("-h", "--help") else f"There is no command '{name}'.")
