"""The modules of commands: `console/NAME.py` or `ros/console/NAME.py` of a package has the function NAME."""

import importlib
import pkgutil
from pathlib import Path
from typing import Any

from .command import Command

FOLDERS = ("console", "ros/console")
"""Folders of the modules within a Python package. Modules without a function of their own name have no command."""


def workspace() -> Path:
    """Returns the folder of the workspace, which has `./rpbi`."""
    return Path(__file__).resolve().parents[5]


def module_names(root: Path) -> list[str]:
    """Returns the full names of the modules of a workspace that may have commands."""
    files = {file for folder in FOLDERS for file in root.glob(f"src/*/src/*/{folder}/*.py")}
    own = Path(__file__).parent  # the console itself
    names = [
        ".".join(file.relative_to(root).with_suffix("").parts[3:])
        for file in files
        if file.stem != "__init__" and file.parent.parts[-2:] != own.parts[-2:]
    ]
    return sorted(names)


def modules_of(package: str) -> list[str]:
    """Returns the full names of the modules of a package of commands."""
    return [f"{package}.{each.name}" for each in pkgutil.iter_modules(importlib.import_module(package).__path__)]


def command_of(module_name: str) -> Command | None:
    """Returns the command of a module, None if it has none."""
    module: Any = importlib.import_module(module_name)
    function = getattr(module, module_name.rpartition(".")[2], None)
    return Command(function) if callable(function) else None


def commands(root: Path) -> list[Command]:
    """Returns all commands of a workspace, by name."""
    found = filter(None, map(command_of, module_names(root)))
    return sorted(found, key=lambda each: each.name)
