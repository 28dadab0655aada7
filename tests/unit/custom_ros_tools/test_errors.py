"""Errors say what is wrong, what would be right, and survive a process boundary."""

from __future__ import annotations

import pickle

import pytest

from custom_ros_tools.errors import (
    ConfigError,
    InterfaceError,
    MissingDependency,
    PhysicsError,
    Problem,
    UnknownNameError,
    closest,
)

ERRORS = [
    (
        ConfigError([Problem("a.yaml", "hz", "must be > 0 [Hz], got 0"), Problem("b.yaml", "", "is empty")]),
        "a.yaml: hz: must be > 0 [Hz], got 0\nb.yaml: is empty",
    ),
    (
        UnknownNameError("joint", "elbw", ["elbow", "wrist"]),
        "unknown joint 'elbw': known are elbow, wrist; did you mean 'elbow'?",
    ),
    (UnknownNameError("object", "ball", []), "unknown object 'ball': there is none"),
    (MissingDependency("pin", "pip install pin"), "'pin' is not installed: pip install pin"),
    (PhysicsError("no such mesh"), "no such mesh"),
]


@pytest.mark.parametrize(("error", "text"), ERRORS)
def test_error_writes_its_own_sentence(error: InterfaceError, text: str) -> None:
    assert str(error) == text


@pytest.mark.parametrize(("error", "text"), ERRORS)
def test_error_survives_pickling(error: InterfaceError, text: str) -> None:
    copy = pickle.loads(pickle.dumps(error))
    assert type(copy) is type(error)
    assert str(copy) == text


def test_problem_is_one_line_whatever_the_user_wrote() -> None:
    assert str(Problem("a.yaml", "b\nc", "no such file: d\ne")) == "a.yaml: b c: no such file: d e"


def test_closest_ignores_case_and_gives_up_on_strangers() -> None:
    assert closest("setgravty", ["setGravity", "timeStep"]) == "setGravity"
    assert closest("zebra", ["setGravity", "timeStep"]) is None
