"""Switching on and off: what it is already is refused, what failed is not taken for done."""

from __future__ import annotations

import pytest

from custom_ros_tools.ros.services import Toggle


def test_each_switch_acts_once() -> None:
    acts: list[str] = []
    switch = Toggle("remapping", lambda: acts.append("start"), lambda: acts.append("stop"))
    assert switch.off() == (False, "remapping is already off")
    assert switch.on() == (True, "remapping is on")
    assert switch.on() == (False, "remapping is already on")
    assert switch.off() == (True, "remapping is off")
    assert acts == ["start", "stop"]


def test_start_that_failed_leaves_it_off() -> None:
    acts = iter([OSError("no"), None])

    def start() -> None:
        fault = next(acts)
        if fault is not None:
            raise fault

    switch = Toggle("remapping", start, lambda: None)
    with pytest.raises(OSError):
        switch.on()
    assert switch.on() == (True, "remapping is on")
