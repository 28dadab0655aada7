"""Functions called by keys. The message is not part of this workspace yet: what is here has its fields."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
import rospy
from ros_system import wait_until

from custom_ros_tools.errors import MissingDependency
from custom_ros_tools.keyboard import KeyDownSubscriber

PACKAGE = """
from genpy.dynamic import generate_dynamic
header = "Header header\\nuint16 code\\nuint16 modifiers\\n" + "=" * 80
header += "\\nMSG: std_msgs/Header\\nuint32 seq\\ntime stamp\\nstring frame_id\\n"
Key = generate_dynamic("keyboard/Key", header)["keyboard/Key"]
"""


@pytest.fixture
def without_keyboard(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever is installed, Python finds no `keyboard`."""
    monkeypatch.setitem(sys.modules, "keyboard", None)


@pytest.fixture
def with_keyboard(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A package `keyboard` that has the message."""
    (tmp_path / "keyboard/msg").mkdir(parents=True)
    (tmp_path / "keyboard/__init__.py").touch()
    (tmp_path / "keyboard/msg/__init__.py").write_text(PACKAGE)
    monkeypatch.syspath_prepend(str(tmp_path))
    for name in ("keyboard", "keyboard.msg"):
        monkeypatch.delitem(sys.modules, name, raising=False)


def test_without_the_message_it_is_told_what_to_install(without_keyboard):
    with pytest.raises(MissingDependency, match="'keyboard/Key' is not installed: build the ROS package 'keyboard'"):
        KeyDownSubscriber({})


@pytest.mark.quick
def test_each_key_calls_its_function_and_others_call_none(ros, with_keyboard):
    from keyboard.msg import Key

    pressed: list[str] = []
    subscriber = KeyDownSubscriber({97: lambda: pressed.append("a"), 98: lambda: pressed.append("b")})
    publisher = rospy.Publisher("/keyboard/keydown", Key, queue_size=10)
    wait_until(publisher.get_num_connections, "it listens")
    for code in (98, 99, 97):
        publisher.publish(Key(code=code))
    wait_until(lambda: len(pressed) >= 2, "both are called")
    assert pressed == ["b", "a"]
    subscriber._subscriber.unregister()
    publisher.unregister()
