"""Force feedback that cannot hurt, tick by tick in virtual time: silence, limits, engagement."""

from __future__ import annotations

import math
import random

import pytest
from haptic_rig import DEVICE, DT_S, Rig

from custom_ros_tools.errors import ConfigError
from operator_node.haptics.config import HapticNodeConfig
from operator_node.haptics.controller import ForceFeedbackConfig, ForceLimiter, HapticController
from operator_node.haptics.device import HapticReading
from operator_node.haptics.devices.scripted import ScriptedConfig

SILENCE_S = 0.02
PUSH = (0.0, 0.0, 5.0)


def press(rig: Rig, ticks: int) -> None:
    """Comes back, and presses into a spring of 300 N/m that the simulator has at 0."""
    for tick in range(-200, ticks):
        rig.tick((0.0, 0.0, 0.01 if tick < 0 else -0.03), (0.0, 0.0, max(-300.0 * rig.hand.position[2], 0.0)))


@pytest.mark.parametrize("silent", ["simulator", "device", "both"])
def test_no_force_20_ms_after_anybody_falls_silent(silent):
    """200 faults at random moments of a press, one third of them of each kind."""
    rig, draw = Rig(), random.Random(silent)
    for _ in range(67):
        press(rig, draw.randrange(150, 250))
        assert math.hypot(*rig.controller.force) > 1.0
        for tick in range(1, draw.randrange(25, 60)):
            wrench = None if silent != "device" else PUSH
            force = rig.tick((0.0, 0.0, -0.03), wrench, None if silent != "simulator" else lambda reading: reading)
            assert force == (0.0, 0.0, 0.0) or tick * DT_S < SILENCE_S
        assert force == (0.0, 0.0, 0.0)


def test_a_force_fades_before_it_ends():
    rig = Rig()
    press(rig, 200)
    forces = [rig.tick((0.0, 0.0, -0.03))[2] for _ in range(20)]
    assert max(a - b for a, b in zip(forces, forces[1:])) < 0.5 * forces[0]


def test_forces_are_clamped_and_obey_the_slew_limit():
    rig, draw = Rig(slew_n_per_s=500.0, passivity=False), random.Random(1)
    last = (0.0, 0.0, 0.0)
    for tick in range(2000):
        wrench = tuple(draw.uniform(-1e6, 1e6) if tick // 50 % 2 else 0.0 for _ in range(3))
        force = rig.tick((0.0, 0.0, 0.0), wrench)
        length = math.hypot(*force)
        assert length <= DEVICE.max_force_n + 1e-9
        along = sum(a * b for a, b in zip(last, force)) / length if length else 0.0
        assert length <= max(along, 0.0) + 500.0 * DT_S + 1e-9
        last = force


def test_limiter_replaces_non_finite_forces_by_zero():
    limiter = ForceLimiter(10.0, 1000.0)
    for force in ((math.nan, 0.0, 0.0), (math.inf, 1.0, 0.0), (1e300, 1e300, 0.0)):
        assert limiter.limited(force, 0.001) == (0.0, 0.0, 0.0)
    assert limiter.not_finite == 3


def test_nothing_jumps_at_start_reset_and_return():
    """1,000 random offsets: wherever the handle is, the target begins where it was, and never goes too fast."""
    draw, most_m = random.Random(2), 0.5 * DT_S + 1e-12
    rig = Rig(clutch_button=None, max_target_speed=0.5)
    now_s, last = 0.0, (0.0, 0.0, 0.0)
    for case in range(1000):
        place = tuple(draw.uniform(-0.09, 0.09) for _ in range(3))
        if case % 3 == 1:
            rig.controller.lose()  # the device went away and is back elsewhere
        elif case % 3 == 2:
            rig.controller.reset()
            rig.controller.lose()
        else:
            now_s += 0.5  # it was silent
            rig.controller.lose()
        for tick in range(4):
            now_s += DT_S
            rig.controller.tick(now_s, HapticReading(tuple(p + 0.0003 * tick for p in place)))
            way = rig.controller.snapshot.displacement
            assert math.dist(way, last) <= most_m, (case, tick)
            if tick == 0:
                assert rig.controller.snapshot.deviation == (0.0, 0.0, 0.0)
            last = way


def test_clutch_moves_the_tool_only_while_its_button_is_held():
    rig = Rig(clutch_button=0)
    held = 0

    def reading(true: HapticReading) -> HapticReading:
        return true._replace(buttons=(held,))

    def go(wanted):
        for _ in range(400):
            rig.tick(wanted, reading=reading)
        return rig.controller.snapshot

    assert go((0.02, 0.0, 0.0)).displacement == (0.0, 0.0, 0.0)
    held = 1
    assert go((0.03, 0.0, 0.0)).displacement[0] == pytest.approx(0.01, abs=1e-4)
    held = 0
    snapshot = go((-0.05, 0.0, 0.0))
    assert not snapshot.is_engaged and snapshot.displacement[0] == pytest.approx(0.01, abs=1e-4)
    held = 1
    assert go((-0.04, 0.0, 0.0)).displacement[0] == pytest.approx(0.02, abs=1e-4)


def test_coupling_pulls_towards_a_tool_that_stays_behind():
    rig = Rig(mode="coupling", stiffness=200.0, damping=1.0)
    for _ in range(600):
        rig.controller.observe_tool((0.0, 0.0, max(rig.hand.position[2], -0.005)), rig.now_s + DT_S)
        rig.tick((0.0, 0.0, -0.03))
    depth_m = -0.005 - rig.hand.position[2]
    assert depth_m > 0.005
    assert rig.controller.force[2] == pytest.approx(200.0 * depth_m, rel=0.05)


def test_axes_are_turned_there_and_back():
    rig = Rig(yaw_deg=90.0, passivity=False, max_target_speed=10.0)
    for _ in range(300):
        rig.tick((0.02, 0.0, 0.0), (0.0, 1.0, 0.0))
    assert rig.controller.snapshot.displacement == pytest.approx((0.0, rig.hand.position[0], 0.0), abs=1e-6)
    assert rig.controller.force == pytest.approx((1.0, 0.0, 0.0), abs=1e-3)


def test_controller_continues_from_the_displacement_of_its_predecessor():
    way = (0.02, 0.03, -0.04)
    config = ForceFeedbackConfig(yaw_deg=90.0, motion_scale=(2.0, 0.5, 1.0))
    controller = HapticController(config, DEVICE, 1.0 / DT_S, way)
    for tick in range(100):
        controller.tick(tick * DT_S, HapticReading((0.01, 0.0, 0.0)))
    assert controller.snapshot.displacement == pytest.approx(way)


@pytest.mark.parametrize(
    ("model", "options", "told"),
    [
        (HapticNodeConfig, {"expiry_s": 0.5}, "expiry_s"),
        (HapticNodeConfig, {"way_low": [0.1, 0.0, 0.0]}, "way_low"),
        (HapticNodeConfig, {"stiffness": -1.0}, "stiffness"),
        (HapticNodeConfig, {"mode": "force"}, "mode"),
        (ScriptedConfig, {"depth": 1.0}, "depth"),
        (ScriptedConfig, {"max_force_n": 0.0}, "max_force_n"),
    ],
)
def test_wrong_options_are_reported(model, options, told):
    with pytest.raises(ConfigError, match=told):
        model.parse(options, "test")
