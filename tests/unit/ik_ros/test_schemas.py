"""The schemas of solvers' YAML files are those that the code gives."""

from __future__ import annotations

from pathlib import Path

import pytest
from jsonschema import Draft7Validator

from ik_ros.node_configs import schema_files, schemas
from ik_ros.solvers import SOLVERS

ROOT = Path(__file__).resolve().parents[3]
CHAIN = {"urdf_filename": "arm.urdf", "base_link": "base", "tip_link": "tip"}


def test_every_solver_has_one() -> None:
    for name in SOLVERS:
        SOLVERS.configured(name)  # tells which extra is missing
    assert list(schemas()) == list(SOLVERS)


def test_files_are_fresh() -> None:
    stale = [path.name for path, text in schema_files(ROOT).items() if not path.exists() or path.read_text() != text]
    assert stale == [], "run ./rpbi docs"


@pytest.mark.parametrize("wrong", [{"tip": "x"}, {"tip_link": 3}, {"start_on_init": "yes"}, {"continuity": {"x": 1}}])
def test_mistakes_are_found(wrong: dict[str, object]) -> None:
    validator = Draft7Validator(schemas()["kdl"])
    assert list(validator.iter_errors({**CHAIN, "continuity": {}})) == []
    assert list(validator.iter_errors({**CHAIN, **wrong}))
