"""Nodes and classes that have two names, in one package or two."""

from __future__ import annotations

import pkgutil
import re
from pathlib import Path

import pytest

PROGRAMS = Path(__file__).resolve().parents[3] / "devel/lib"


def what_runs(node: str) -> list[str]:
    return re.findall(r"^    run\(.*\)$", (PROGRAMS / node).read_text(), re.MULTILINE)


@pytest.mark.parametrize(
    ("node", "same_as"),
    [
        ("operator_node/joy_remap_node", "joy_remap"),
        ("operator_node/interface_logger_node", "operator_interface_logger"),
        ("teleop/teleop_tf_node.py", "teleop_tf_node.py"),
        ("ik_ros/interactive_target_node.py", "interactive_target_node.py"),
    ],
)
def test_either_name_runs_the_same(node, same_as):
    assert what_runs(node) == what_runs(f"operator_node/{same_as}") != []


def test_former_path_of_device_topics_works():
    from operator_node.devices.device_topics import DeviceTopics

    assert pkgutil.resolve_name("operator_node.ros.devices.topics:DeviceTopics") is DeviceTopics
