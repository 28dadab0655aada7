"""External forces and torques move what they push as Newton and Euler say, for as long as they are to."""

from __future__ import annotations

import math
import re

import pytest
from worlds import FLOOR, box, iiwa, write_world

from custom_ros_tools.errors import InterfaceError
from rpbi.control.external_wrenches import ExternalWrench
from rpbi.geometry import Pose
from rpbi.samples import WrenchSample
from rpbi.world import World

FREE = {"linearDamping": 0.0, "angularDamping": 0.0}
HAND = "lbr_iiwa_link_7"
SIDE_M = 0.2
INERTIA = SIDE_M**2 / 6.0
"""Of a cube of 1 kg [kg m^2]."""
QUARTER = (0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5))


@pytest.fixture
def world(tmp_path):
    arm = iiwa(
        enabled_joint_force_torque_sensors=["lbr_iiwa_joint_7"],
        joint_state_publisher_hz=1000,
        initial_joint_position={"lbr_iiwa_joint_2": 40.0, "lbr_iiwa_joint_4": -60.0},
    )
    cube = box(basePosition=[3.0, 0.0, 3.0], baseOrientation=list(QUARTER), changeDynamics=FREE)
    path = write_world(tmp_path, collision=(FLOOR,), dynamic=(cube,), robots=(arm,), setGravity={})
    made = World.from_file(path)
    yield made
    made.close()


def run(world, ticks):
    wrench = None
    for _ in range(ticks):
        wrench = next((sample for sample in world.step() if isinstance(sample, WrenchSample)), wrench)
    return wrench


def velocity(world):
    return world.bodies["box"].base_twist()


def test_force_accelerates_for_its_duration(world):
    world.act("box", "push", ExternalWrench((1.0, 2.0, 3.0), duration_s=0.1))
    run(world, 300)
    assert velocity(world).linear == pytest.approx((0.1, 0.2, 0.3), rel=1e-6)
    assert velocity(world).angular == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)


@pytest.mark.parametrize(("in_link_axes", "expected"), [(False, (0.1, 0.0, 0.0)), (True, (0.0, 0.1, 0.0))])
def test_wrench_axes_are_those_of_the_world_or_the_link(world, in_link_axes, expected):
    world.act("box", "push", ExternalWrench((1.0, 0.0, 0.0), in_link_axes=in_link_axes, duration_s=0.1))
    run(world, 200)
    assert velocity(world).linear == pytest.approx(expected, abs=1e-6)


def test_torque_turns_a_body_and_eccentric_force_also_moves_it(world):
    world.act("box", "push", ExternalWrench((0.0, 0.0, 0.0), (0.0, 0.0, 0.01), duration_s=0.1))
    run(world, 100)
    assert velocity(world).angular == pytest.approx((0.0, 0.0, 0.001 / INERTIA), rel=1e-4)
    assert velocity(world).linear == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
    # At 0.1 m along the link's x axis, which is the world's y: about z it turns against the torque before
    world.act("box", "push", ExternalWrench((0.1, 0.0, 0.0), point=(0.1, 0.0, 0.0), duration_s=0.1))
    run(world, 100)
    assert velocity(world).angular == pytest.approx((0.0, 0.0, 0.0), abs=1e-4)
    assert velocity(world).linear == pytest.approx((0.01, 0.0, 0.0), rel=1e-3)


def test_wrench_without_duration_acts_until_replaced_or_zeroed(world):
    world.act("box", "push", ExternalWrench((1.0, 0.0, 0.0)))
    run(world, 1000)
    assert velocity(world).linear[0] == pytest.approx(1.0, rel=1e-6)
    world.act("box", "push", ExternalWrench((-1.0, 0.0, 0.0)))
    run(world, 500)
    assert velocity(world).linear[0] == pytest.approx(0.5, rel=1e-6)
    world.act("box", "push", ExternalWrench((0.0, 0.0, 0.0)))
    run(world, 500)
    assert velocity(world).linear[0] == pytest.approx(0.5, rel=1e-6)


def test_as_an_input_it_acts_from_the_next_tick_on(world):
    world.put("box/external_wrench", ExternalWrench((1.0, 0.0, 0.0), link="box", duration_s=0.05))
    run(world, 100)
    assert velocity(world).linear[0] == pytest.approx(0.05, rel=1e-6)


def test_wrist_sensor_measures_a_push_on_the_hand(world):
    world.act("iiwa", "push", ExternalWrench((10.0, 0.0, 0.0), (0.0, 0.0, 0.5), HAND, (0.0, 0.0, 0.1), True))
    wrench = run(world, 1000)
    assert wrench.force == pytest.approx((-10.0, 0.0, 0.0), abs=1e-3)
    assert wrench.torque == pytest.approx((0.0, -1.0, -0.5), abs=1e-3)


def test_wrench_does_not_act_after_a_reset(world):
    world.act("box", "push", ExternalWrench((1.0, 0.0, 0.0)))
    run(world, 10)
    world.reset()
    run(world, 10)
    assert velocity(world).linear == (0.0, 0.0, 0.0)


def test_a_body_that_sleeps_is_woken(world):
    box_id = world.bodies["box"].body_id
    sleeping = {"activationState": world.pb.ACTIVATION_STATE_ENABLE_SLEEPING | world.pb.ACTIVATION_STATE_SLEEP}
    world.pb.changeDynamics(box_id, -1, **sleeping)
    world.act("box", "push", ExternalWrench((1.0, 0.0, 0.0), duration_s=0.1))
    run(world, 100)
    assert velocity(world).linear[0] == pytest.approx(0.1, rel=1e-6)


@pytest.mark.parametrize(
    ("name", "wrench", "message"),
    [
        ("floor", ExternalWrench((1.0, 0.0, 0.0)), "'floor/link0' is static"),
        ("iiwa", ExternalWrench((1.0, 0.0, 0.0)), "'iiwa/lbr_iiwa_link_0' is static"),
        ("iiwa", ExternalWrench((1.0, 0.0, 0.0), link="hand"), "unknown link of iiwa 'hand'"),
        ("box", ExternalWrench((math.nan, 0.0, 0.0)), "force must be finite"),
        ("box", ExternalWrench((0.0, 0.0, 0.0), (0.0, math.inf, 0.0)), "torque must be finite"),
        ("box", ExternalWrench((0.0, 0.0, 1.0), point=(math.nan, 0.0, 0.0)), "point must be finite"),
        ("box", ExternalWrench((1e300, 0.0, 0.0)), "force must be within +-1e+09"),
        ("box", ExternalWrench((1.0, 0.0, 0.0), duration_s=math.nan), "duration must be > 0 [s]"),
        ("ball", ExternalWrench((1.0, 0.0, 0.0)), "unknown object 'ball'"),
    ],
)
def test_invalid_wrenches_are_refused(world, name, wrench, message):
    noted = world.commands.count
    with pytest.raises((InterfaceError, ValueError), match=re.escape(message)):
        world.act(name, "push", wrench)
    run(world, 2)
    assert world.commands.count == noted
    assert velocity(world).linear == (0.0, 0.0, 0.0)


def test_immovable_bodies_accept_no_wrenches(world):
    assert "floor/external_wrench" not in world.inputs
    assert {"box/external_wrench", "iiwa/external_wrench"} <= set(world.inputs)


def test_the_pushed_body_may_be_elsewhere_by_then(world):
    world.act("box", "push", ExternalWrench((0.0, 1.0, 0.0), point=(0.1, 0.0, 0.0), duration_s=0.1))
    world.act("box", "teleport", Pose((5.0, 5.0, 5.0)))
    run(world, 100)
    assert velocity(world).linear == pytest.approx((0.0, 0.1, 0.0), rel=1e-3, abs=1e-4)
