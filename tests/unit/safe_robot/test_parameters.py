"""Parameters of the guard's node: whatever they are, there is a guard, or an error that names one of them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import islice
from typing import Any

import pytest
from guarded_arm import SLIDER

from custom_ros_tools.errors import ConfigError
from safe_robot import legacy
from safe_robot.checks import CHECKS
from safe_robot.commands.shaping import ShapingConfig
from safe_robot.config import GuardConfig, NodeConfig
from safe_robot.limits import LimitsConfig
from safe_robot.ros.parameters import guard_of

VALUES = (
    *(5, -1, 0, 2**40, 1e-300, 1e-6, 1e300, math.nan, math.inf, True, "", "x", "5", "a b", "nan nan", "\x00", "."),
    *([], {}, [[]], [1], ["a", "a"], ["turn", "turn"], "turn turn", {"turn": math.nan}, {"turn": -1}, {"turn": {}}),
    *({"a": 1}, {"": 1}, {"x": {"x": {}}}, {"lower": {}}, {"hand": {"x": [math.nan, 1]}}, {"hand": {"x": [1, 0]}}),
    *("x" * 100_000, [1] * 1000),
)
SHARE = 5
"""One of so many cases is tried; it has no common factor with the number of values."""
LONGEST = 5000
"""Most characters of an error: what was given is quoted in part."""


def keys() -> Iterator[tuple[str, ...]]:
    """Yields all parameters, those of the authors' release too, and some that there are not."""
    yield from ((key,) for key in (*GuardConfig.model_fields, *NodeConfig.model_fields, *legacy.KEYS, "nothing"))
    yield from (("limits", key) for key in LimitsConfig.model_fields)
    yield from (("shape", key) for key in ShapingConfig.model_fields)
    for name in CHECKS:
        yield "checks", name
        yield from (("checks", name, key) for key in CHECKS.find(name).Config.model_fields)
    yield from (("checks", name) for name in ("nothing", "math:sin", "no_module:Name"))
    yield from (("checker", "jointpositionlimit"), ("checker", "jointpositionlimit", "active"), ("checker", "nothing"))


def nested(key: tuple[str, ...], value: Any) -> dict[str, Any]:
    """Returns parameters of which only one is given."""
    for name in reversed(key):
        value = {name: value}
    return value


def test_every_parameter_is_taken_or_refused_in_words(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # pairs_file is written
    (tmp_path / "slider.urdf").write_text(SLIDER)
    refused, taken, faults = 0, 0, list[str]()
    for key, value in islice(((key, value) for key in keys() for value in VALUES), 0, None, SHARE):
        try:
            guard_of(nested(key, value), "slider.urdf", "/guard")
            taken += 1
        except ConfigError as error:
            refused += 1
            assert len(str(error)) < LONGEST and str(error).strip(), key
        except Exception as error:
            faults.append(f"{key}: {value!r:.80}: {error!r:.300}")
    assert not faults
    assert refused > 300 and taken > 30


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"limits": 5}, "/guard: limits: expected a mapping, got 5"),
        ({"checks": {"staleness": 5}}, "/guard: checks.staleness: expected a mapping, got 5"),
        ({"joint_name_order": 5}, "/guard: joint_name_order: expected names, as a list or with spaces between them"),
        ({"period_s": 1e-300}, "/guard: period_s: must be >= 1e-05"),
        ({"silence_s": math.nan}, "/guard: silence_s: must be a finite number"),
    ],
)
def test_wrong_parameter_is_reported_with_expected_and_given_value(tmp_path, parameters, message):
    path = tmp_path / "slider.urdf"
    path.write_text(SLIDER)
    with pytest.raises(ConfigError, match=message):
        guard_of(parameters, str(path), "/guard")
