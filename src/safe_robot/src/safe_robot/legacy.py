"""Translates parameters of the authors' original release, and of that release's README, to a guard's configuration."""

import math
from collections.abc import Mapping
from typing import Any

from custom_ros_tools.errors import ConfigError, Problem
from custom_ros_tools.schema.type_names import shown

CHECKERS = {
    "jointpositionlimit": "joint_position",
    "jointvelocitylimit": "joint_velocity",
    "linkboxlimit": "link_box",
    "statevalidity": "self_collision",
}
"""Maps each NAME in the original parameters `~checker/NAME/active` to the check of this guard."""
SWITCHES = {
    "check_joint_position_limits": "joint_position",
    "check_joint_velocity_limits": "joint_velocity",
    "check_link_limits": "link_box",
    "check_self_collision": "self_collision",
}
FACTORS = {"joint_position_limit_factor": "position_factor", "joint_velocity_limit_factor": "velocity_factor"}
BY_JOINT = {
    "joint_position_lower_limit": "lower",
    "joint_position_upper_limit": "upper",
    "joint_velocity_limit": "velocity",
}
AXES = {f"{prefix}_{axis}lim": axis for prefix in ("box", "link") for axis in "xyz"}
LINKS = ("links", "safe_links")
UNUSED = ("exotica_xml_filename", "stop_after_first_fail", "debug")
"""Keys of the authors' original release that this guard ignores."""
KEYS = (
    "checker", "joint_name_order", "safe_distance", *SWITCHES, *FACTORS, *BY_JOINT, *AXES, *LINKS, *UNUSED,
)  # fmt: skip


def translated(given: Mapping[str, Any], joint_names: list[str], file: str) -> dict[str, Any]:
    """Translates parameters of the authors' original release to the keys of `GuardConfig`.

    Args:
        given: The parameters; parameters that the original release does not have are returned unchanged.
        joint_names: Names of the joints to which the numbers in a list belong, in order. The parameter
            `joint_name_order` replaces these names.
        file: Source of the parameters, for messages.

    Raises:
        ConfigError: If a parameter does not have the form that the original release requires.
    """
    config = {key: value for key, value in given.items() if key not in KEYS}
    limits = dict(_mapping(given, "limits", file))
    checks = {name: dict(_mapping(config["checks"], name, file, "checks.")) for name in _mapping(given, "checks", file)}
    if "joint_name_order" in given:
        config["joint_names"] = joint_names = _words(given["joint_name_order"], "joint_name_order", file)
    for name, options in _mapping(given, "checker", file).items():
        if name not in CHECKERS or not isinstance(options, Mapping):
            raise _wrong(file, f"checker.{name}", f"one of {', '.join(CHECKERS)}, with 'active'", name)
        checks.setdefault(CHECKERS[name], {})["active"] = options.get("active", True)
    for key, name in SWITCHES.items():
        if key in given:
            checks.setdefault(name, {})["active"] = given[key]
    limits |= {ours: given[key] for key, ours in FACTORS.items() if key in given}
    for key, ours in BY_JOINT.items():
        if key in given:
            numbers = _numbers(given[key], len(joint_names), key, file)
            limits[ours] = dict(zip(joint_names, numbers))
    if "safe_distance" in given:
        checks.setdefault("self_collision", {})["margin_m"] = given["safe_distance"]
    links = [link for key in LINKS for link in _words(given.get(key, []), key, file)]
    box = {axis: _axis(given[key], key, file) for key, axis in AXES.items() if key in given}
    if links:
        checks.setdefault("link_box", {})["boxes"] = dict.fromkeys(links, box)
    return config | ({"limits": limits} if limits else {}) | ({"checks": checks} if checks else {})


def _mapping(given: Mapping[str, Any], key: str, file: str, above: str = "") -> Mapping[str, Any]:
    value = given.get(key, {})
    if not isinstance(value, Mapping):
        raise _wrong(file, above + key, "a mapping", value)
    return value


def _words(value: Any, key: str, file: str) -> list[str]:
    words = value.split() if isinstance(value, str) else value
    if not isinstance(words, list) or not all(isinstance(word, str) for word in words):
        raise _wrong(file, key, "names, as a list or with spaces between them", value)
    return words


def _numbers(value: Any, count: int, key: str, file: str) -> list[float]:
    """Returns `count` numbers from a list, a text with spaces between the numbers, or a single number.

    Raises:
        ConfigError: If there are not `count` numbers, or one of them is NaN.
    """
    try:
        numbers = [float(word) for word in (str(value).split() if not isinstance(value, list) else value)]
    except (TypeError, ValueError):
        numbers = []
    if len(numbers) != count or any(map(math.isnan, numbers)):
        raise _wrong(file, key, f"{count} numbers with spaces between them", value)
    return numbers


def _axis(value: Any, key: str, file: str) -> list[float | None]:
    return [number if math.isfinite(number) else None for number in _numbers(value, 2, key, file)]


def _wrong(file: str, key: str, expected: str, got: Any) -> ConfigError:
    return ConfigError([Problem(file, key, f"expected {expected}, got {shown(got)}")])
