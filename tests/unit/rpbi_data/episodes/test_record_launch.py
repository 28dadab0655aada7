"""`record.launch` hands its arguments to the parameters of the node."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from roslaunch.config import load_config_default

from rpbi_data.episodes.config import RecordParameters

LAUNCH_FILE = Path(__file__).parents[4] / "src/episodes/launch/record.launch"
GIVEN = {
    "folder": "demos",
    "topics": ".*/joint_states(/[a-z_]+)*|/tf",
    "also": ["/rpbi/camera/colour/image"],
    "copy_from": ["/data/robots"],
    "namespace": "left",
    "reset": True,
    "disk_reserve_mb": 2.0,
    "seeds": "3",
    "start_key": "a",
    "discard_key": "b",
    "label_keys": {"1": "good"},
    "start_button": 0,
    "discard_button": 1,
    "label_buttons": {"2": "good", "10": "bad"},
}


def _parameters(given: dict[str, Any]) -> RecordParameters:
    """Returns the parameters of the node when the launch file has these arguments."""
    arguments = [f"{name}:={value}" for name, value in given.items()]
    loaded = load_config_default([(str(LAUNCH_FILE), arguments)], None, assign_machines=False)
    found: dict[str, Any] = {}
    for name, each in loaded.params.items():
        _, node, *keys = name.split("/")
        if node == "record":
            place = found.setdefault(keys[0], {}) if len(keys) > 1 else found
            place[keys[-1]] = each.value
    return RecordParameters(**found)


def test_defaults_are_those_of_the_node():
    assert _parameters({"folder": "demos"}) == RecordParameters(folder="demos")


def test_every_parameter_is_an_argument():
    assert set(GIVEN) == set(RecordParameters.model_fields)
    assert _parameters(GIVEN) == RecordParameters(**GIVEN)
