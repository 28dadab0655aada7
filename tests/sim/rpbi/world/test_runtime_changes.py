"""Gravity, the engine's parameters, gains and rates of sensors, changed while the world runs."""

from __future__ import annotations

import math

import pybullet
import pytest
import scripted_session as script
from deterministic_session import build, run
from worlds import FLOOR, box, iiwa, write_world

from custom_ros_tools.errors import ConfigError, UnknownNameError
from rpbi.config.pybullet_world_models import SetGravity, SetPhysicsEngineParameter
from rpbi.control.joint_command import JointCommand
from rpbi.control.motors import MotorGains
from rpbi.engine.client import Client
from rpbi.render.mirror import Mirror
from rpbi.samples import JointStateSample, WrenchSample
from rpbi.world import World
from rpbi.world.load_log import replay
from rpbi.world.saved.command_log import apply_command

MOON = SetGravity(gravZ=-1.62)
JOINT = "lbr_iiwa_joint_2"


@pytest.fixture
def make(tmp_path):
    worlds = []

    def build_world(**parts):
        parts.setdefault("collision", (FLOOR,))
        worlds.append(World.from_file(write_world(tmp_path, setAdditionalSearchPath="pybullet_data_path", **parts)))
        return worlds[-1]

    yield build_world
    for world in worlds:
        world.close()


def ticks(world, count):
    return [sample for _ in range(count) for sample in world.step()]


def height(world, name="box"):
    return world.bodies[name].base_pose().position[2]


def test_falling_body_follows_the_current_gravity(make):
    world = make(dynamic=(box(basePosition=[0.0, 0.0, 5.0], changeDynamics={"linearDamping": 0.0}),))
    world.change_physics(MOON)
    ticks(world, 1000)
    assert height(world) == pytest.approx(5.0 - 1.62 / 2, rel=1e-3)
    world.change_physics(SetGravity())
    before = height(world)
    ticks(world, 1000)
    assert height(world) == pytest.approx(before - 1.62, rel=1e-3), "it goes on as fast as it was"


def test_change_of_gravity_wakes_a_sleeping_body(make):
    sleeper = box(basePosition=[0.0, 0.0, 0.1], changeDynamics={"activationState": "ACTIVATION_STATE_ENABLE_SLEEPING"})
    world = make(dynamic=(sleeper,))
    ticks(world, 3000)
    world.pb.setGravity(0.0, 0.0, 2.0)
    ticks(world, 100)
    assert height(world) == pytest.approx(0.1, abs=1e-3), "it does not sleep"
    world.change_physics(SetGravity(gravZ=2.0))
    ticks(world, 500)
    assert height(world) > 0.3


def test_weight_in_sensors_and_compensation_of_gravity_follow(make):
    joints = {JOINT: 40.0, "lbr_iiwa_joint_4": -60.0}
    robot = iiwa(
        initial_joint_position=joints,
        setJointMotorControlArray={"controlMode": "TORQUE_CONTROL"},
        gravity_compensation=True,
        enabled_joint_force_torque_sensors=[{"joint": "lbr_iiwa_joint_1", "hz": 1000}],
    )
    world = make(robots=(robot,))
    arm = world.bodies["iiwa"]
    mass = sum(world.dynamics(f"iiwa/lbr_iiwa_link_{number}").mass for number in range(1, 8))
    efforts = {}
    for gravity in (SetGravity(gravZ=-9.81), MOON, SetGravity()):
        world.change_physics(gravity)
        wrench = [each for each in ticks(world, 200) if isinstance(each, WrenchSample)][-1]
        assert wrench.force[2] == pytest.approx(-mass * gravity.gravZ, abs=0.05)
        efforts[gravity.gravZ] = arm.motors.applied_efforts[arm.model[JOINT].index]
    start = arm.start_positions()
    assert arm.joint_positions() == pytest.approx(start, abs=1e-3), "nothing sinks or rises"
    assert efforts[-1.62] == pytest.approx(efforts[-9.81] * 1.62 / 9.81, rel=1e-3)
    assert efforts[0.0] == pytest.approx(0.0, abs=1e-9)


def test_a_tick_is_weighed_by_the_gravity_that_it_had(make):
    robot = iiwa(enabled_joint_force_torque_sensors=[{"joint": "lbr_iiwa_joint_7", "hz": 0.001}])
    world = make(robots=(robot,))
    ticks(world, 100)
    world.change_physics(SetGravity(gravZ=-5.0))
    (late,) = [each for each in world.read_rest() if isinstance(each, WrenchSample)]
    assert late.force[2] == pytest.approx(9.81 * world.dynamics("iiwa/lbr_iiwa_link_7").mass, rel=1e-2)


@pytest.mark.parametrize("sub_steps", [1, 4])
def test_contact_forces_are_those_of_the_whole_step(make, sub_steps):
    robot = iiwa(enabled_joint_force_torque_sensors=[{"joint": "lbr_iiwa_joint_7", "hz": 1000}])
    world = make(dynamic=(box(basePosition=[0.6, 0.0, 0.1], contacts={"hz": 1000}),), robots=(robot,))
    world.change_physics(SetPhysicsEngineParameter(numSubSteps=sub_steps))
    ticks(world, 500)
    (contacts,) = [each for each in ticks(world, 1) if hasattr(each, "points")]
    assert contacts.force[2] == pytest.approx(9.81, rel=1e-3)


@pytest.mark.parametrize(
    "change",
    [
        MOON,
        SetPhysicsEngineParameter(numSolverIterations=5),
        SetPhysicsEngineParameter(numSubSteps=3),
        SetPhysicsEngineParameter(contactBreakingThreshold=0.0005),
        SetPhysicsEngineParameter(contactERP=0.4, enableConeFriction=False),
        SetPhysicsEngineParameter(constraintSolverType="CONSTRAINT_SOLVER_LCP_DANTZIG"),
        SetPhysicsEngineParameter(deterministicOverlappingPairs=False, contactSlop=0.02),
    ],
    ids=lambda change: ", ".join(change.kwargs()),
)
def test_change_has_an_effect_that_a_reset_reverts(change):
    world = build()
    untouched = run(world, 250)
    world.reset()
    world.change_physics(change)
    assert run(world, 250) != untouched
    world.reset()
    assert run(world, 250) == untouched
    world.close()


def test_all_parameters_can_be_changed_and_are_replayed():
    world, again = build(), build()
    changes = [SetPhysicsEngineParameter(**{key: _other(key)}) for key in SetPhysicsEngineParameter.model_fields]
    for change in changes:
        world.change_physics(change)
    ticks(world, 50)
    for command in script.recorded(world).values():
        apply_command(again, command)
    ticks(again, 50)
    assert world.commands.count == len(changes)
    assert again.state_hash() == world.state_hash()
    world.close()
    again.close()


def _other(key):
    """Returns a value of an engine's parameter that is not its default."""
    special = {"constraintSolverType": "CONSTRAINT_SOLVER_LCP_SI", "jointFeedbackMode": "JOINT_FEEDBACK_IN_WORLD_SPACE"}
    annotation = str(SetPhysicsEngineParameter.model_fields[key].annotation)
    return special.get(key, False if "bool" in annotation else 3 if "int" in annotation else 0.015)


def test_log_has_the_changes_but_the_renderers_copy_ignores_gravity(make):
    world = make()
    world.change_physics(MOON)
    client = Client()
    replay(client, world.log)
    assert client.getPhysicsEngineParameters()["gravityAccelerationZ"] == -1.62 == client.gravity[2]
    mirror = Mirror(client)
    mirror.apply(world.log[-1]._replace(arguments=SetGravity(gravZ=3.0)))
    assert client.gravity[2] == -1.62
    mirror.close()
    client.disconnect()


def test_stiffer_gains_bring_a_joint_there_sooner(make):
    soft = {"controlMode": "POSITION_CONTROL", "positionGains": [0.002]}
    world = make(robots=(iiwa(setJointMotorControlArray=soft),))
    arm, index = world.bodies["iiwa"], world.bodies["iiwa"].model[JOINT].index
    world.put("iiwa/target", JointCommand([JOINT], [0.3]))
    ticks(world, 200)
    slow = arm.joint_positions()[index]
    world.act("iiwa", "set_gains", MotorGains([JOINT], [0.1], []))
    ticks(world, 200)
    assert slow < 0.1
    assert arm.joint_positions()[index] > 0.25
    world.reset()
    world.put("iiwa/target", JointCommand([JOINT], [0.3]))
    ticks(world, 200)
    assert world.bodies["iiwa"].joint_positions()[index] == slow


def test_gain_of_velocity_stays_with_the_motor_in_another_mode(make):
    world = make(robots=(iiwa(),), setGravity={})
    arm, index = world.bodies["iiwa"], world.bodies["iiwa"].model[JOINT].index
    world.act("iiwa", "set_gains", MotorGains([JOINT], [], [0.0]))
    world.act("iiwa", "switch_mode", pybullet.VELOCITY_CONTROL)
    world.put("iiwa/target", JointCommand([JOINT], velocity=[0.2]))
    ticks(world, 100)
    assert arm.joint_positions()[index] == pytest.approx(0.0, abs=1e-6), "a motor without gain does nothing"
    world.act("iiwa", "set_gains", MotorGains([JOINT], [], [1.0]))
    ticks(world, 100)
    assert arm.joint_positions()[index] > 0.015


@pytest.mark.parametrize(
    ("gains", "message"),
    [
        (MotorGains([JOINT], [], []), "expected joints, and a position or velocity gain of each"),
        (MotorGains([], [], []), "expected joints"),
        (MotorGains([JOINT], [0.1, 0.2], []), "expected one value for each of the 1 joints named, got 2"),
        (MotorGains([JOINT], [-0.1], []), f"positionGain of '{JOINT}' must be >= 0, got -0.1"),
        (MotorGains([JOINT], [0.5], [math.nan]), f"values must be finite, got nan for joint '{JOINT}'"),
        (MotorGains(["elbow"], [0.5], []), "unknown joint 'elbow'"),
    ],
)
def test_gains_that_make_no_sense_change_nothing(make, gains, message):
    world = make(robots=(iiwa(),))
    with pytest.raises((ValueError, UnknownNameError)) as raised:
        world.act("iiwa", "set_gains", gains)
    assert message in str(raised.value)
    assert not world.commands.count
    hashes = []
    for _ in range(2):
        world.put("iiwa/target", JointCommand([JOINT], [0.3]))
        ticks(world, 50)
        hashes.append(world.state_hash())
        world.reset()
    assert hashes[0] == hashes[1]


def test_rate_of_a_sensor_changes_from_this_tick_on(make):
    world = make(robots=(iiwa(joint_state_publisher_hz=100, broadcast_link_states=True),))
    (number,) = [n for n, each in enumerate(world.sensors_of("iiwa")) if each.sample_type is JointStateSample]

    def count(ticks_long):
        return sum(isinstance(each, JointStateSample) for each in ticks(world, ticks_long))

    assert count(100) == 10
    for hz, expected in ((500.0, 50), (0.0, 0), (1000.0, 100), (10.0, 1)):
        world.set_sensor_rate("iiwa", number, hz)
        assert count(100) == expected
    world.set_sensor_rate("iiwa", number, 0.0)
    ticks(world, 1)
    assert not any(isinstance(each, JointStateSample) for each in [*world.read_rest(), *world.read_idle(10**6, 0)])
    world.reset()
    assert count(100) == 10


@pytest.mark.parametrize("hz", [-1.0, math.nan, math.inf])
def test_rates_that_make_no_sense_are_refused(make, hz):
    world = make(robots=(iiwa(),))
    with pytest.raises(ValueError, match="hz: must be finite and >= 0"):
        world.set_sensor_rate("iiwa", 0, hz)
    with pytest.raises(ValueError, match="has 1 sensors, got number 1"):
        world.set_sensor_rate("iiwa", 1, 10.0)
    with pytest.raises(UnknownNameError, match="iwa"):
        world.set_sensor_rate("iwa", 0, 10.0)
    assert not world.commands.count


def test_joint_states_can_be_off(make):
    world = make(robots=(iiwa(joint_state_publisher_hz=0),))
    assert world.sensors_of("iiwa") == []
    assert ticks(world, 100) == []


def test_force_torque_sensor_needs_a_rate_of_its_own_then(make):
    with pytest.raises(ConfigError, match=r"enabled_joint_force_torque_sensors\[0\].hz: missing"):
        make(robots=(iiwa(joint_state_publisher_hz=0, enabled_joint_force_torque_sensors=[JOINT]),))
    sensor = {"joint": JOINT, "hz": 100}
    world = make(robots=(iiwa(joint_state_publisher_hz=0, enabled_joint_force_torque_sensors=[sensor]),))
    assert len(ticks(world, 100)) == 10
