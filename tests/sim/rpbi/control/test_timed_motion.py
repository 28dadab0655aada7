"""Motions to a goal in a given time: they arrive, keep to limits, and tell the truth about it."""

from __future__ import annotations

import random
import re

import pybullet
import pytest
from worlds import FLOOR, box, iiwa, write_world

from rpbi.control.joint_command import JointCommand
from rpbi.control.timed_motion import SETTLING_S, TOLERANCES, TimedMotion
from rpbi.geometry import Pose
from rpbi.world import World

JOINTS = [f"lbr_iiwa_joint_{i}" for i in range(1, 8)]


@pytest.fixture
def build(tmp_path):
    worlds = []

    def build_world(mode: str = "POSITION_CONTROL", **more) -> World:
        dynamic = more.pop("dynamic", ())
        time_step = more.pop("timeStep", 0.005)
        robot = iiwa(setJointMotorControlArray={"controlMode": mode}, **more)
        path = write_world(
            tmp_path,
            collision=(FLOOR,) if dynamic else (),
            robots=(robot,),
            dynamic=dynamic,
            timeStep=time_step,
            setGravity={"gravZ": -9.81},
        )
        worlds.append(World.from_file(path))
        return worlds[-1]

    yield build_world
    for world in worlds:
        world.close()


def start(world: World, goal: dict[str, float], duration_s: float) -> TimedMotion:
    robot = world.bodies["iiwa"]
    motion = TimedMotion(robot.model, robot.model.resolve(list(goal), list(goal.values())), duration_s)
    robot.drive.run(motion)
    return motion


def finish(world: World, motion: TimedMotion, longest_s: float = 60.0) -> tuple[bool, str]:
    for _ in range(round(longest_s / world.clock.dt_s)):
        world.step()
        if motion.is_over:
            return motion.result.result()
    raise AssertionError("the motion did not end")


def positions(world: World) -> dict[str, float]:
    robot = world.bodies["iiwa"]
    return {robot.joints[i].name: q for i, q in robot.joint_positions().items()}


def test_a_motion_ends_at_its_goal_in_its_time(build):
    world = build()
    motion = start(world, {JOINTS[0]: 0.5, JOINTS[3]: -1.0}, 2.0)
    success, message = finish(world, motion)
    assert success
    assert world.clock.time_s == pytest.approx(2.0, abs=0.05)
    assert positions(world)[JOINTS[0]] == pytest.approx(0.5, abs=0.01)
    assert positions(world)[JOINTS[3]] == pytest.approx(-1.0, abs=0.01)
    assert "from its goal" in message


def test_the_path_has_minimum_jerk_and_other_joints_stay(build):
    world = build(timeStep=0.001)
    start(world, {JOINTS[0]: 1.0}, 2.0)
    for tick in range(1, 2001):
        world.step()
        if tick % 250 == 0:
            s = tick / 2000
            expected = 10 * s**3 - 15 * s**4 + 6 * s**5
            assert positions(world)[JOINTS[0]] == pytest.approx(expected, abs=2e-4)
    assert all(abs(positions(world)[name]) < 2e-3 for name in JOINTS[1:])


def test_too_fast_motion_takes_the_time_its_joints_need(build):
    world = build(timeStep=0.001)
    motion = start(world, {JOINTS[0]: 2.0}, 0.1)
    limit = world.bodies["iiwa"].model[JOINTS[0]].max_velocity
    fastest = 0.0
    while not motion.is_over:
        world.step()
        fastest = max(fastest, abs(world.bodies["iiwa"].drive.measured()[0][1]))
    assert motion.result.result().success
    assert "it took" in motion.result.result().message
    assert fastest <= 1.02 * limit


def test_a_thousand_random_moves_end_where_they_say(build):
    """None is reported as successful that is not, and the error told is the error there is."""
    world = build(timeStep=0.01)
    robot = world.bodies["iiwa"]
    random_goals = random.Random(7)
    told = re.compile(r"joint '(\w+)' is (\S+) rad from its goal")
    succeeded = 0
    for _ in range(1000):
        named = random_goals.sample(robot.model.driven, random_goals.randint(1, 7))
        goal = {joint.name: random_goals.uniform(joint.lower, joint.upper) for joint in named}
        success, message = finish(world, start(world, goal, random_goals.uniform(0.0, 1.0)))
        errors = {name: abs(positions(world)[name] - value) for name, value in goal.items()}
        stated = [(name, float(error)) for name, error in told.findall(message)]
        assert stated, message
        for name, error in stated:
            # It was measured at the beginning of the last tick, at which a joint may move by 0.05 rad/s.
            assert errors[name] == pytest.approx(error, abs=1e-3), message
        if success:
            succeeded += 1
            assert max(errors.values()) <= TOLERANCES["rad"] + 5e-4, message
    assert succeeded > 950, f"only {succeeded} of 1000 arrived"


def test_a_blocked_arm_answers_false_with_the_error_that_remains(build):
    wall = box("wall", (0.3, 0.05, 1.0), basePosition=[0.0, 0.45, 1.0], baseMass=1000.0)
    bent = dict(zip(JOINTS, [0.0, 90.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    world = build(dynamic=(wall,), initial_joint_position=bent)
    motion = start(world, {JOINTS[0]: 1.5}, 1.0)
    success, message = finish(world, motion, longest_s=SETTLING_S + 2.0)
    assert not success
    assert "missed the goal" in message
    assert "state reached" in message
    assert positions(world)[JOINTS[0]] < 1.4


def test_a_newer_motion_replaces_the_older_which_answers(build):
    world = build()
    first = start(world, {JOINTS[0]: 1.0}, 2.0)
    for _ in range(100):
        world.step()
    second = start(world, {JOINTS[1]: 0.5}, 1.0)
    success, message = first.result.result()
    assert not success
    assert "a newer motion replaced it" in message
    reached = float(re.search(rf"{JOINTS[0]}=(\S+)", message)[1])
    assert reached == pytest.approx(positions(world)[JOINTS[0]], abs=1e-5)
    assert finish(world, second).success
    assert positions(world)[JOINTS[0]] == pytest.approx(reached, abs=0.03), "joints of the older one stop"


@pytest.mark.parametrize(
    ("what", "act"),
    [
        ("the simulation was stopped", lambda world: world.halt("the simulation was stopped")),
        ("the robot was removed", lambda world: world.remove("iiwa")),
        ("the control mode was changed", lambda world: world.bodies["iiwa"].switch_mode(pybullet.VELOCITY_CONTROL)),
        (
            "its joints were set to other positions",
            lambda world: world.bodies["iiwa"].set_joint_state(JointCommand([JOINTS[0]], [0.0])),
        ),
        ("the simulation ended", lambda world: world.close()),
    ],
)
def test_interrupted_motion_reports_its_cause_and_the_reached_state(build, what, act):
    world = build()
    motion = start(world, {JOINTS[0]: 1.0}, 2.0)
    for _ in range(100):
        world.step()
    act(world)
    success, message = motion.result.result()
    assert not success
    assert message.startswith(what)
    assert f"state reached: {JOINTS[0]}=" in message


@pytest.mark.parametrize("goal", [3.0, -1e8])
def test_motion_beyond_a_limit_stops_there_without_success(build, goal):
    world = build()
    success, message = finish(world, start(world, {JOINTS[0]: 0.5, JOINTS[1]: goal}, 1.0))
    assert not success
    assert re.match(
        rf"went to the limits only: joint '{JOINTS[1]}' must be within -2.094\d* to 2.094\d* rad, got", message
    )
    limit = world.bodies["iiwa"].model[JOINTS[1]].nearest_allowed(goal)
    assert positions(world)[JOINTS[0]] == pytest.approx(0.5, abs=0.01)
    assert positions(world)[JOINTS[1]] == pytest.approx(limit, abs=0.01)


@pytest.mark.parametrize("duration_s", [-1.0, 1e100, float("nan"), float("inf")])
def test_a_senseless_duration_is_refused(build, duration_s):
    with pytest.raises(ValueError, match="duration must be 0 to"):
        start(build(), {JOINTS[0]: 0.5}, duration_s)


def test_under_torque_control_a_motion_is_refused(build):
    with pytest.raises(ValueError, match="TORQUE_CONTROL"):
        start(build("TORQUE_CONTROL"), {JOINTS[0]: 0.5}, 1.0)


def test_motion_under_velocity_control_arrives_and_the_robot_then_rests(build):
    world = build("VELOCITY_CONTROL")
    assert finish(world, start(world, {JOINTS[0]: 0.5}, 1.0)).success
    for _ in range(200):
        world.step()
    assert positions(world)[JOINTS[0]] == pytest.approx(0.5, abs=0.01)
    world.put("iiwa/target", JointCommand([JOINTS[0]], velocity=[0.2]))
    for _ in range(50):
        world.step()
    assert world.bodies["iiwa"].drive.measured()[0][1] == pytest.approx(0.2, rel=0.05)


def test_targets_of_moving_joints_are_refused_and_others_obeyed(build):
    world = build()
    motion = start(world, {JOINTS[0]: 0.5}, 1.0)
    with pytest.raises(ValueError, match=f"a motion drives {JOINTS[0]}"):
        world.put("iiwa/target", JointCommand(JOINTS[:2], [0.0, 0.3]))
    world.put("iiwa/target", JointCommand([JOINTS[1]], [0.3]))
    assert finish(world, motion).success
    world.put("iiwa/target", JointCommand([JOINTS[0]], [0.0]))
    for _ in range(400):
        world.step()
    assert positions(world)[JOINTS[0]] == pytest.approx(0.0, abs=0.01)
    assert positions(world)[JOINTS[1]] == pytest.approx(0.3, abs=0.01)


def test_a_teleport_ends_a_motion(build):
    world = build()
    motion = start(world, {JOINTS[0]: 1.0}, 2.0)
    world.step()
    world.bodies["iiwa"].teleport(Pose((1.0, 0.0, 0.0)))
    assert motion.result.result().message.startswith("the robot was moved to another pose")


def test_very_long_motion_does_not_break_the_world(build, tmp_path):
    urdf = tmp_path / "wheel.urdf"
    urdf.write_text(
        "<robot name='r'><link name='a'/><link name='b'/><joint name='spin' type='continuous'><parent link='a'/>"
        "<child link='b'/><axis xyz='0 0 1'/><limit effort='10' velocity='1'/></joint></robot>"
    )
    world = build(loadURDF={"fileName": str(urdf), "useFixedBase": True})
    motion = start(world, {"spin": 1e9}, 1.0)
    for _ in range(10):
        world.step()
    assert not motion.is_over
    with pytest.raises(ValueError, match="values must be within"):
        start(world, {"spin": 1e80}, 1.0)
