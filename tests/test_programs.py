"""The programs of packages, which CMake makes from a table in each CMakeLists.txt."""

from __future__ import annotations

import ast
import importlib.util
import os
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


def _programs() -> dict[str, str]:
    """Returns the module and function of each program, by package and name."""
    found = {}
    for file in sorted(ROOT.glob("src/**/CMakeLists.txt")):
        for table in re.findall(r"^rpbi_programs\(\n(.*?)^\)$", file.read_text(), re.MULTILINE | re.DOTALL):
            for name, function in re.findall(r"^    (\S+) +(\S+)$", table, re.MULTILINE):
                found[f"{file.parent.name}/{name}"] = function
    return found


PROGRAMS = _programs()


@pytest.mark.parametrize("program", [*PROGRAMS, "keyboard/keyboard"])
def test_program_starts_with_the_interpreter_that_has_ros(program):
    """With `env python3`, the first Python on PATH would run it."""
    path = ROOT / "devel/lib" / program
    assert path.read_text().startswith("#!/usr/bin/python3\n")
    assert os.access(path, os.X_OK)


@pytest.mark.parametrize("program", PROGRAMS)
def test_program_calls_a_function_that_exists(program):
    module, _, function = PROGRAMS[program].partition(":")
    spec = importlib.util.find_spec(module)
    assert spec and spec.origin, f"no module {module}"
    names = {node.name for node in ast.parse(Path(spec.origin).read_text()).body if isinstance(node, ast.FunctionDef)}
    assert (function or module.rpartition(".")[2]) in names
