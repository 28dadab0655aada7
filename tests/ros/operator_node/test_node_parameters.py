"""Parameters of nodes: what is wrong is told with key, expected and got."""

from __future__ import annotations

import pytest

from custom_ros_tools.errors import ConfigError
from operator_node.mappings.interface_logger_node import LoggerParameters
from operator_node.mappings.joy_remap_node import JoyRemapParameters
from operator_node.mappings.keyboard_to_joy_node import KeyboardToJoyConfig, KeyboardToJoyParameters
from operator_node.mappings.operator_node import OperatorParameters
from operator_node.teleop_tf_node import TeleopParameters


@pytest.mark.parametrize(
    ("model", "data", "told"),
    [
        (KeyboardToJoyConfig, {}, "axes: missing, expected a list"),
        (KeyboardToJoyConfig, {"axes": [["LEFT", "RIGTH"]]}, "axes[0][1]: unknown key 'RIGTH'; did you mean 'RIGHT'?"),
        (KeyboardToJoyConfig, {"axes": [], "buttons": [12]}, "buttons[0]: expected"),
        (KeyboardToJoyParameters, {"key_timeout_s": -1.0}, "key_timeout_s: must be >= 0 [s], got -1"),
        (JoyRemapParameters, {"hz": 0}, "hz: must be > 0 [Hz], got 0"),
        (LoggerParameters, {"window_duration": 0}, "window_duration: must be > 0 [s], got 0"),
        (OperatorParameters, {"input_timeout_s": "soon"}, "input_timeout_s: expected a number [s], got text 'soon'"),
        (TeleopParameters, {"input_timeout_s": float("inf")}, "input_timeout_s: must be a finite number [s], got .inf"),
    ],
)
def test_wrong_parameters_are_named(model, data, told):
    with pytest.raises(ConfigError) as error:
        model.parse(data, "~")
    assert told in str(error.value)


def test_keys_that_yaml_reads_as_numbers_are_keys():
    assert KeyboardToJoyConfig.parse({"axes": [["b", "f"]], "buttons": [1, "2"]}, "~").buttons == ("1", "2")
