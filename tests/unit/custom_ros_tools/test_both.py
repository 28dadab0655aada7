"""The faults of two sources are told together."""

from __future__ import annotations

import pytest

from custom_ros_tools.errors import ConfigError, Problem, both


def _faulty(name: str) -> None:
    raise ConfigError([Problem(name, "hz", "is wrong")])


def test_both_are_returned() -> None:
    assert both(lambda: 1, lambda: "a") == (1, "a")


def test_the_second_is_read_although_the_first_is_faulty() -> None:
    with pytest.raises(ConfigError, match="^a: hz: is wrong\nb: hz: is wrong$"):
        both(lambda: _faulty("a"), lambda: _faulty("b"))
