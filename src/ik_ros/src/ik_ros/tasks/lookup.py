"""From the type of a task to its class."""

from __future__ import annotations

from importlib import import_module

from custom_ros_tools.errors import UnknownNameError

from . import TASKS
from .task import Task


def task_class(name: str) -> type[Task]:
    """Returns the class of a type of task.

    Args:
        name: A name of the table `TASKS`, or `"their_package.module:Class"`.

    Raises:
        UnknownNameError: If the table does not have the name.
        ValueError: If there is no such module or class, or it is not a `Task`.
    """
    path = name if ":" in name else TASKS.get(name)
    if path is None:
        raise UnknownNameError("task", name, [*TASKS, "their_package.module:Class"])
    module_name, _, class_name = path.partition(":")
    try:
        found = getattr(import_module(module_name), class_name)
    except (ImportError, AttributeError, ValueError) as error:
        raise ValueError(f"'{name}': {error}") from error
    if not (isinstance(found, type) and issubclass(found, Task)):
        raise ValueError(f"'{name}': expected a class derived from ik_ros.tasks.task.Task")
    return found
