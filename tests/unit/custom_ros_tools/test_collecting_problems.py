"""Problems of several parts of a configuration are reported together."""

from __future__ import annotations

import pytest

from custom_ros_tools.errors import ConfigError, Problem, collecting_problems


def test_without_problems_nothing_is_raised() -> None:
    with collecting_problems() as part:
        with part():
            first = 1
        with part():
            second = "a"
    assert (first, second) == (1, "a")


def test_the_second_is_read_although_the_first_has_problems() -> None:
    with pytest.raises(ConfigError, match="^a: hz: is wrong\nb: hz: is wrong$"), collecting_problems() as part:
        for name in "ab":
            with part():
                raise ConfigError([Problem(name, "hz", "is wrong")])


def test_other_errors_pass_through() -> None:
    with pytest.raises(ValueError, match="else"), collecting_problems() as part, part():
        raise ValueError("else")
