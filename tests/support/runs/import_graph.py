"""Which module of a source tree imports which, read from the text; imports for typing and inside functions count."""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from collections.abc import Iterator, Mapping, Set
from functools import cached_property
from pathlib import Path

GENERATED = re.compile(r"^\w+\.(msg|srv|action)\b")
"""Messages and services, which are not in the source tree."""
OF_ROS = re.compile(
    r"(actionlib|rospy|tf2_ros|rosbag|rosgraph|roslib|genpy|ros_pybullet_interface|\w+_msgs|\w+_srvs|\w+\.(msg|srv))\b"
)
"""Imports that need ROS."""
TABLE_ENTRY = re.compile(r'"((?!\w+\.ros\.)[a-z_][\w.]*):[A-Za-z_]\w*"')
"""A class that a table of plug-ins imports when it is asked for."""


class ImportGraph:
    """The modules below some folders.

    Args:
        roots: Folders that hold top-level packages.

    Attributes:
        files: File of each module, by full name.
    """

    def __init__(self, *roots: Path) -> None:
        self.files: dict[str, Path] = {}
        for root in roots:
            for path in sorted(root.rglob("*.py")):
                parts = path.relative_to(root).with_suffix("").parts
                self.files[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path

    @cached_property
    def imports(self) -> dict[str, set[str]]:
        """The modules of the tree that each one imports."""
        found = {name: {self._known(each) for each in imported_names(path, name)} for name, path in self.files.items()}
        return {name: {each for each in targets if each and each != name} for name, targets in found.items()}

    @cached_property
    def importers(self) -> dict[str, set[str]]:
        """The modules that import each one."""
        found: dict[str, set[str]] = {name: set() for name in self.files}
        for name, targets in self.imports.items():
            for target in targets:
                found[target].add(name)
        return found

    def leading_to(self, found: dict[str, str]) -> dict[str, str]:
        """Returns some modules and all that import them, directly or by way of others.

        Args:
            found: A reason by module; the reason of an importer is the module that it imports.
        """
        found, waiting = dict(found), list(found)
        while waiting:
            target = waiting.pop()
            for name in self.importers[target] - found.keys():
                if target in {self._known(each) for each in imported_names(self.files[name], name, typing=False)}:
                    found[name] = target
                    waiting.append(name)
        return found

    def circles(self) -> list[list[str]]:
        """Returns the groups of modules that import each other, directly or by way of others."""
        return circles_of(self.imports)

    def rooms(self) -> dict[str, dict[str, set[str]]]:
        """Returns, for each package, which of its rooms imports which of them.

        A room is a module of the package, or a folder with all below it. The package's own `__init__.py` is one, too,
        and imports the classes of its table of plug-ins, except those in a `ros` folder, which only nodes look up.
        """
        found: dict[str, dict[str, set[str]]] = defaultdict(lambda: defaultdict(set))
        for name, targets in self.imports.items():
            path = self._path(name)
            tables = TABLE_ENTRY.findall(self.files[name].read_text()) if path[-1] == "__init__" else ()
            for target in map(self._path, {*targets, *filter(self.files.get, tables)}):
                depth = next(i for i, (a, b) in enumerate(zip(path, target)) if a != b)
                if depth:
                    found[".".join(path[:depth])][path[depth]].add(target[depth])
        return found

    def small_with_one_importer(self, most_lines: int) -> list[str]:
        """Returns the modules of at most so many lines that only one other module imports."""
        return [
            name
            for name, path in self.files.items()
            if path.name != "__init__.py" and len(self.importers[name]) == 1
            if len(path.read_text().splitlines()) <= most_lines
        ]

    def _known(self, name: str) -> str:
        """Returns the module that a full name is of, or the empty text."""
        if GENERATED.search(name):
            return ""
        while name and name not in self.files:
            name = name.rpartition(".")[0]
        return name

    def _path(self, name: str) -> tuple[str, ...]:
        parts = tuple(name.split("."))
        return (*parts, "__init__") if self.files[name].name == "__init__.py" else parts


def circles_of(graph: Mapping[str, Set[str]]) -> list[list[str]]:
    """Returns the groups of nodes that lead to each other, directly or by way of others."""
    reached = {name: _reachable(graph, name) for name in graph}
    circles = {
        frozenset(other for other in reached[name] if name in reached.get(other, ()))
        for name in graph
        if name in reached[name]
    }
    return sorted(sorted(circle) for circle in circles)


def _reachable(graph: Mapping[str, Set[str]], start: str) -> set[str]:
    reached: set[str] = set()
    waiting = [start]
    while waiting:
        for each in graph.get(waiting.pop(), set()) - reached:
            reached.add(each)
            waiting.append(each)
    return reached


def imported_names(path: Path, module: str, *, typing: bool = True) -> Iterator[str]:
    """Yields the full names of all that a file imports; those of relative imports are resolved.

    Args:
        path: The file.
        module: Full name of its module.
        typing: Whether imports for typing alone count.
    """
    package = module.split(".") if path.name == "__init__.py" else module.split(".")[:-1]
    tree = ast.parse(path.read_text())
    if not typing:
        tree.body = [node for node in tree.body if not _is_for_typing(node)]
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            outer = package[: len(package) - node.level + 1] if node.level else []
            source = ".".join([*outer, *filter(None, [node.module])])
            yield from (f"{source}.{alias.name}" for alias in node.names)


def _is_for_typing(node: ast.stmt) -> bool:
    return isinstance(node, ast.If) and getattr(node.test, "id", "") == "TYPE_CHECKING"


def needing_ros(graph: ImportGraph) -> dict[str, str]:
    """Returns the modules that need ROS, also by way of others, and of each the import that leads to it."""
    direct = {
        name: target
        for name, path in graph.files.items()
        for target in imported_names(path, name, typing=False)
        if OF_ROS.match(target)
    }
    return graph.leading_to(direct)
