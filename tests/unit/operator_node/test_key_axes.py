"""Names of keys, and axes of keys that are held."""

from __future__ import annotations

import pytest
from keyboard.msg import Key

from custom_ros_tools.errors import ConfigError
from operator_node.device import Reading
from operator_node.devices.keyboard import KeyboardConfig
from operator_node.devices.keys import KEY_CODES, KeyAxes


def test_names_and_codes_are_those_of_the_message():
    constants = {name[4:]: getattr(Key, name) for name in dir(Key) if name.startswith("KEY_")}
    del constants["FIRST"]  # another name of UNKNOWN
    assert constants == KEY_CODES


def test_axis_value_follows_its_two_keys():
    keys = KeyAxes([("LEFT", "RIGHT"), ("b", "f")], ["1", "SPACE"])
    left, right, b, one = (KEY_CODES[name] for name in ("LEFT", "RIGHT", "b", "1"))
    assert keys.reading(()) == Reading((0.0, 0.0), (0, 0))
    assert keys.reading((left,)) == Reading((-1.0, 0.0), (0, 0))
    assert keys.reading({right, b, one}) == Reading((1.0, -1.0), (1, 0))
    assert keys.reading([left, right]) == Reading((0.0, 0.0), (0, 0))


def test_digits_may_be_numbers_and_unknown_keys_are_named():
    assert KeyboardConfig.parse({"buttons": [1, "2", "a"]}, "~").buttons == ("1", "2", "a")
    with pytest.raises(ConfigError, match="buttons.*'Left'.*did you mean 'LEFT'"):
        KeyboardConfig.parse({"buttons": ["Left"]}, "~")
    with pytest.raises(ConfigError, match="axes"):
        KeyboardConfig.parse({"axes": [["LEFT"]]}, "~")
    with pytest.raises(ConfigError, match="buttons"):
        KeyboardConfig.parse({"buttons": [12]}, "~")
