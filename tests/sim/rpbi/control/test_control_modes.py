"""Position, velocity and torque control of a robot, and the change between them."""

from __future__ import annotations

import math

import numpy as np
import pybullet
import pytest
from worlds import iiwa, write_world

from custom_ros_tools.errors import ConfigError
from rpbi.control.joint_command import JointCommand, WrongQuantityError
from rpbi.world import World

FIRST, SECOND = "lbr_iiwa_joint_1", "lbr_iiwa_joint_2"
JOINTS = [f"lbr_iiwa_joint_{i}" for i in range(1, 8)]
BENT = dict(zip(JOINTS, [20.0, 30.0, 10.0, -60.0, 10.0, 40.0, 5.0]))


@pytest.fixture
def build(tmp_path):
    worlds = []

    def build_world(mode: str, gravity: float = -9.81, **more) -> World:
        motors = {"controlMode": mode, **more.pop("gains", {})}
        robot = iiwa(setJointMotorControlArray=motors, **more)
        world = World.from_file(write_world(tmp_path, robots=(robot,), timeStep=0.001, setGravity={"gravZ": gravity}))
        worlds.append(world)
        return world

    yield build_world
    for world in worlds:
        world.close()


def run(world: World, ticks: int) -> None:
    for _ in range(ticks):
        world.step()


def without_damping(world: World) -> World:
    robot = world.bodies["iiwa"]
    for index in robot.joint_indices:
        robot.pb.changeDynamics(robot.body_id, index, jointDamping=0.0, linearDamping=0.0, angularDamping=0.0)
    return world


def state(world: World, name: str = FIRST) -> tuple[float, float]:
    robot = world.bodies["iiwa"]
    return robot.drive.measured()[robot.model[name].index]


def test_velocity_target_moves_a_joint_until_it_expires(build):
    world = build("VELOCITY_CONTROL", target_timeout_s=0.2)
    world.put("iiwa/target", JointCommand([FIRST], velocity=[0.5]))
    run(world, 200)
    assert state(world) == pytest.approx((0.1, 0.5), rel=0.05)
    run(world, 50)
    assert state(world)[1] == pytest.approx(0.0, abs=1e-3)
    assert state(world)[0] == pytest.approx(0.1, rel=0.05)


def test_renewed_target_does_not_expire_and_joints_expire_separately(build):
    world = build("VELOCITY_CONTROL", target_timeout_s=0.1)
    world.put("iiwa/target", JointCommand([FIRST, JOINTS[6]], velocity=[0.5, 0.5]))
    for _ in range(5):
        run(world, 50)
        world.put("iiwa/target", JointCommand([FIRST], velocity=[0.5]))
    run(world, 1)
    assert state(world)[1] == pytest.approx(0.5, rel=0.02)
    assert state(world, JOINTS[6])[1] == pytest.approx(0.0, abs=1e-3)


def test_velocity_targets_are_held_to_the_joints_velocity(build):
    world = build("VELOCITY_CONTROL")
    world.put("iiwa/target", JointCommand([JOINTS[6]], velocity=[100.0]))
    run(world, 300)
    limit = world.bodies["iiwa"].model[JOINTS[6]].max_velocity
    assert math.isfinite(limit)
    assert state(world, JOINTS[6])[1] <= 1.001 * limit


def test_torque_accelerates_a_joint_by_its_inertia_and_is_held(build):
    world = without_damping(build("TORQUE_CONTROL", gravity=0.0))
    robot = world.bodies["iiwa"]
    mass_matrix = robot.pb.calculateMassMatrix(robot.body_id, [0.0] * 7)
    world.put("iiwa/target", JointCommand([FIRST], effort=[0.2]))
    run(world, 100)
    inverse = np.linalg.inv(mass_matrix)
    assert state(world)[1] == pytest.approx(inverse[0, 0] * 0.2 * 0.1, rel=0.05)


def test_torque_control_releases_the_motors_and_torques_expire(build):
    world = build("TORQUE_CONTROL", initial_joint_position=BENT, target_timeout_s=0.05)
    run(world, 300)
    assert abs(state(world, SECOND)[0] - math.radians(30.0)) > 0.05, "an arm without torques falls"
    still = without_damping(build("TORQUE_CONTROL", gravity=0.0, target_timeout_s=0.05))
    still.put("iiwa/target", JointCommand([FIRST], effort=[0.2]))
    run(still, 50)
    speed = state(still)[1]
    run(still, 100)
    assert speed > 0.0
    assert state(still)[1] == pytest.approx(speed, rel=0.02), "after its time a torque accelerates no more"


def test_joint_states_report_applied_torques_within_limits(build):
    world = build("TORQUE_CONTROL", gravity=0.0, joint_state_publisher_hz=1000.0)
    world.put("iiwa/target", JointCommand([FIRST, SECOND], effort=[1.5, 1e6]))
    (sample,) = world.step()
    efforts = dict(zip(sample.joint_names, sample.effort))
    assert efforts[FIRST] == 1.5
    assert efforts[SECOND] == world.bodies["iiwa"].model[SECOND].max_effort


def test_gravity_compensation_holds_an_arm_for_a_minute(build):
    world = build("TORQUE_CONTROL", initial_joint_position=BENT, gravity_compensation=True)
    start = world.bodies["iiwa"].joint_positions()
    world.put("iiwa/target", JointCommand([SECOND], effort=[0.0]))
    run(world, 60_000)
    drift = max(abs(q - start[i]) for i, q in world.bodies["iiwa"].joint_positions().items())
    assert drift < 0.01


def test_gravity_compensation_respects_base_orientation_and_adds_to_targets(build):
    load = {
        "fileName": "kuka_iiwa/model.urdf",
        "useFixedBase": True,
        "baseOrientation": pybullet.getQuaternionFromEuler([0.7, 0.2, 0.3]),
    }
    world = build("TORQUE_CONTROL", initial_joint_position=BENT, gravity_compensation=True, loadURDF=load)
    start = world.bodies["iiwa"].joint_positions()
    run(world, 2000)
    held = world.bodies["iiwa"].joint_positions()
    assert max(abs(held[i] - start[i]) for i in start) < 1e-3
    world.put("iiwa/target", JointCommand([FIRST], effort=[2.0]))
    run(world, 300)
    assert state(world)[1] > 0.01


def test_switching_to_position_holds_where_the_robot_is(build):
    world = build("VELOCITY_CONTROL")
    world.put("iiwa/target", JointCommand([FIRST], velocity=[0.5]))
    run(world, 300)
    here = state(world)[0]
    world.bodies["iiwa"].switch_mode(pybullet.POSITION_CONTROL)
    run(world, 1000)
    assert state(world) == pytest.approx((here, 0.0), abs=0.01)
    world.put("iiwa/target", JointCommand([FIRST], position=[0.0]))
    run(world, 2000)
    assert state(world)[0] == pytest.approx(0.0, abs=0.01)


def test_a_target_that_was_checked_for_another_mode_is_dropped(build):
    world = build("POSITION_CONTROL")
    world.put("iiwa/target", JointCommand([FIRST], position=[1.0], velocity=[1.0]))
    world.bodies["iiwa"].switch_mode(pybullet.VELOCITY_CONTROL)
    run(world, 200)
    assert state(world) == pytest.approx((0.0, 0.0), abs=1e-3)


@pytest.mark.parametrize(
    ("mode", "target", "message"),
    [
        (
            "POSITION_CONTROL",
            JointCommand([FIRST], velocity=[1.0]),
            "expected position.*POSITION_CONTROL; got velocity",
        ),
        ("VELOCITY_CONTROL", JointCommand([FIRST], [1.0], effort=[1.0]), "expected velocity.*got position and effort"),
        ("TORQUE_CONTROL", JointCommand([FIRST], position=[1.0]), "expected effort.*got position"),
    ],
)
def test_target_for_another_mode_is_refused_with_the_expected_quantity(build, mode, target, message):
    world = build(mode)
    with pytest.raises(WrongQuantityError, match=message):
        world.put("iiwa/target", target)


def test_gains_may_be_common_per_joint_or_by_name(build):
    weak = build("POSITION_CONTROL", gains={"positionGains": {SECOND: 1e-5}, "velocityGains": [1.0]})
    weak.put("iiwa/target", JointCommand([FIRST, SECOND], [0.5, 0.5]))
    run(weak, 1000)
    assert state(weak)[0] == pytest.approx(0.5, abs=0.01)
    assert state(weak, SECOND)[0] < 0.1, "its own gain makes it slow"


def test_gains_of_an_unknown_joint_are_named(build):
    with pytest.raises(ConfigError, match="setJointMotorControlArray.positionGains.elbow: unknown joint 'elbow'"):
        build("POSITION_CONTROL", gains={"positionGains": {"elbow": 0.1}})


def test_joints_are_put_somewhere_at_once_and_held_there(build):
    world = build("POSITION_CONTROL")
    robot = world.bodies["iiwa"]
    robot.set_joint_state(JointCommand([FIRST, SECOND], [0.5, -0.4]))
    assert state(world)[0] == 0.5
    run(world, 500)
    assert (state(world)[0], state(world, SECOND)[0]) == pytest.approx((0.5, -0.4), abs=1e-3)
    with pytest.raises(ValueError, match=f"joint '{SECOND}' must be within -2.094"):
        robot.set_joint_state(JointCommand([FIRST, SECOND], [0.1, 3.0]))
    assert state(world)[0] == pytest.approx(0.5, abs=1e-3), "nothing of a refused state is taken over"


def test_joints_that_were_not_put_keep_their_targets(build):
    world = build("POSITION_CONTROL")
    world.put("iiwa/target", JointCommand([FIRST], [0.8]))
    run(world, 50)
    world.bodies["iiwa"].set_joint_state(JointCommand([JOINTS[6]], [0.3]))
    run(world, 2000)
    assert (state(world)[0], state(world, JOINTS[6])[0]) == pytest.approx((0.8, 0.3), abs=1e-3)


def test_target_beyond_a_limit_stops_there_and_is_reported_once(build, caplog):
    world = build("POSITION_CONTROL")
    for _ in range(3):
        world.put("iiwa/target", JointCommand([SECOND], [30.0]))
        run(world, 500)
    assert state(world, SECOND)[0] == pytest.approx(2.0944, abs=0.01)
    assert len([message for message in caplog.messages if "must be within" in message]) == 1


@pytest.mark.parametrize(
    ("target", "message"),
    [
        (JointCommand([FIRST], [0.1], [1e300]), "must be within"),
        (JointCommand([FIRST], [0.1], [50.0]), f"velocity of joint '{FIRST}' must be within"),
        (JointCommand([FIRST], [1e300]), "must be within"),
        (JointCommand([FIRST, SECOND], [0.1]), "expected one value for each"),
    ],
)
def test_a_joint_state_that_cannot_be_is_refused(build, target, message):
    world = build("POSITION_CONTROL")
    with pytest.raises(ValueError, match=message):
        world.bodies["iiwa"].set_joint_state(target)
    assert state(world) == (0.0, 0.0)


def test_start_position_beyond_limits_is_a_fault_of_the_file(build):
    with pytest.raises(ConfigError, match=f"initial_joint_position.{SECOND}: joint '{SECOND}' must be within"):
        build("POSITION_CONTROL", initial_joint_position={SECOND: 400.0})


def test_one_number_is_a_gain_for_all(build):
    world = build("POSITION_CONTROL", gains={"positionGains": 0.2})
    run(world, 10)


@pytest.mark.parametrize(
    ("gains", "message"),
    [
        ("much", "positionGains: expected a number, a list of numbers or a mapping"),
        ({FIRST: -1.0}, f"positionGains.{FIRST}: must be >= 0"),
        ([0.1, 0.1], "expected 1 number or 7"),
    ],
)
def test_gains_that_make_no_sense_are_one_problem(build, gains, message):
    with pytest.raises(ConfigError, match=message) as caught:
        build("POSITION_CONTROL", gains={"positionGains": gains})
    assert len(caught.value.problems) == 1
