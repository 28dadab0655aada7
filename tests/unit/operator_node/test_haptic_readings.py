"""What a haptic device sends that cannot be: each fault has a name, and nothing of it reaches the tool."""

from __future__ import annotations

import json
import math
import random

import pytest
from haptic_rig import Rig

from operator_node.emulators.haply_service import HaplyEmulator
from operator_node.haptics.device import HapticReading, ReadingError
from operator_node.haptics.devices.haply import ForceKey
from operator_node.haptics.devices.haply_json import HaplyState, command_of, device_in, state_in


def scaled(reading: HapticReading, factor: float) -> HapticReading:
    return reading._replace(position=tuple(factor * each for each in reading.position))


def held_at(place: list[tuple[float, float, float]]):
    def stuck(reading: HapticReading) -> HapticReading:
        place.append(reading.position)
        return reading._replace(position=place[0])

    return stuck


NAN = (math.nan, 0.0, 0.0)
FAULTS = {
    "millimetres": lambda draw: lambda r: scaled(r, 1000.0),
    "not finite": lambda draw: lambda r: r._replace(position=NAN) if draw.random() < 0.5 else r._replace(velocity=NAN),
    "stuck": lambda draw: held_at([]),
    "axes swapped": lambda draw: lambda r: r._replace(velocity=(r.velocity[1], r.velocity[2], r.velocity[0])),
    "wxyz": lambda draw: lambda r: r._replace(quat_xyzw=(r.quat_xyzw[3], *r.quat_xyzw[:3])),
    "quaternion": lambda draw: lambda r: r._replace(quat_xyzw=(0.0, 0.0, 0.0, draw.choice((0.0, 2.0)))),
    "jump": lambda draw: lambda r: r._replace(position=tuple(draw.uniform(-0.2, 0.2) for _ in range(3))),
}
"""What a device does wrong from some moment on, by the name that it is to be given."""
TURNED = (0.0, 0.0, 0.28, 0.96)
"""Orientation of the handle."""


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("seed", range(3))
def test_faults_of_devices_are_named(fault, seed):
    draw = random.Random(seed)
    rig, change = Rig(), FAULTS[fault](draw)
    begin = draw.randrange(400, 600)
    for tick in range(1200):
        wanted = (0.04 * math.sin(0.01 * tick), 0.03 * math.cos(0.013 * tick), 0.02 * math.sin(0.02 * tick))

        def reading(true: HapticReading, tick: int = tick) -> HapticReading:
            true = true._replace(quat_xyzw=TURNED)
            return change(true) if tick > begin else true

        force = rig.tick(wanted, (0.0, 0.0, 1.0), reading)
        assert math.isfinite(sum(force) + sum(rig.controller.snapshot.displacement))
        if tick == begin:
            assert rig.controller.faults == {}, "nothing is the matter yet"
    assert max(rig.controller.faults, key=rig.controller.faults.get) == fault, rig.controller.faults


def test_quaternion_with_flipped_sign_is_the_same_orientation():
    rig = Rig()
    for tick in range(100):
        sign = 1.0 if tick % 2 else -1.0
        rig.tick(reading=lambda r, sign=sign: r._replace(quat_xyzw=(0.0, 0.0, sign * 0.28, sign * 0.96)))
    assert rig.controller.faults == {}


def test_a_device_that_stays_elsewhere_is_engaged_there_anew():
    rig = Rig()
    for _ in range(100):
        rig.tick()
    for _ in range(200):
        rig.tick(reading=lambda r: r._replace(position=(0.09, 0.0, 0.0)))
    assert 0 < rig.controller.faults["jump"] < 60
    assert rig.controller.snapshot.displacement == (0.0, 0.0, 0.0)


FULL = json.dumps(HaplyEmulator(lambda time_s: (0.0, 0.0, 0.0))._message(full=True))
DEVICE_ID = device_in(FULL, "")


def fuzzed(draw: random.Random) -> str | bytes:
    """Returns a state with some of it broken."""
    kind = draw.randrange(5)
    if kind == 0:
        return bytes(draw.randrange(256) for _ in range(draw.randrange(200)))
    if kind == 1:
        return FULL[: draw.randrange(len(FULL))]
    if kind == 2:
        place = draw.randrange(len(FULL))
        return FULL[:place] + draw.choice('{}[]",:0-eEnN\x00é') + FULL[place + 1 :]
    message = json.loads(FULL)
    node = message
    while isinstance(node, (dict, list)) and node:
        key = draw.choice(list(node) if isinstance(node, dict) else range(len(node)))
        if not isinstance(node[key], (dict, list)) or not node[key] or draw.random() < 0.2:
            odd = (None, "x", [], {}, True, -1, 1e308, 10**400, math.nan, math.inf, [[[]]], {"x": {}})
            node[key] = draw.choice(odd)
            break
        node = node[key]
    return json.dumps(message)


def test_fuzzed_frames_give_finite_states_or_a_reason():
    draw, refused, taken = random.Random(3), 0, 0
    for _ in range(10_000):
        frame = fuzzed(draw)
        try:
            device_in(frame, "")
            state: HaplyState = state_in(frame, DEVICE_ID)
        except ReadingError as error:
            refused += 1
            assert error.fault and str(error)
        else:
            taken += 1
            numbers = (*state.position, *state.velocity, *state.quat_xyzw, *state.force)
            assert all(math.isfinite(each) for each in numbers)
    assert refused > 2000 and taken > 200


def test_a_deep_frame_is_refused():
    with pytest.raises(ReadingError):
        state_in("[" * 100_000, DEVICE_ID)


def test_an_inverse3_that_is_not_there_is_named():
    with pytest.raises(ReadingError, match="expected an Inverse3 XYZ, it has 04BA"):
        device_in(FULL, "XYZ")


def test_the_key_of_forces_is_found_out():
    key = ForceKey("auto")
    unfelt = [key.judge((1.0, 0.0, 0.0), (0.0, 0.0, 0.0)) for _ in range(50)]
    assert unfelt.count(False) == 1 and key.key == "values"
    assert key.judge((1.0, 0.0, 0.0), (0.9, 0.0, 0.0))
    fixed = ForceKey("vector")
    assert not all(fixed.judge((1.0, 0.0, 0.0), (0.0, 0.0, 0.0)) for _ in range(100))
    assert fixed.key == "vector"


def test_forces_are_sent_in_the_axes_of_the_device():
    sent = json.loads(command_of("04BA", (1.0, 2.0, 3.0), "values"))
    assert sent["inverse3"][0]["commands"]["set_cursor_force"]["values"] == {"x": -2.0, "y": 1.0, "z": 3.0}
