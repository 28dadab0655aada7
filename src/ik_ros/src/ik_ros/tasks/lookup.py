"""From the type of a task to its class."""

from __future__ import annotations

from typing import cast

from rpbi.plugins import find_in_table

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
    return cast(type[Task], find_in_table(name, Task, TASKS, "task"))
