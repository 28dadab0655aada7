"""Bodies that TF moves: they carry, push and rub, keep to their path, and do not fling the world."""

import math
import random
from itertools import pairwise

import pybullet
import pytest
from scripted_session import recorded
from worlds import FLOOR, ball, box, iiwa, write_world

from robot_model.geometry import rotation_between
from rpbi.control.pose_follower import PosePath
from rpbi.geometry import Pose
from rpbi.replay.session import Checkpoint, Recording, Replay
from rpbi.samples import BaseStateSample
from rpbi.world import World
from rpbi.world.saved.description import WorldDescription

TICKS_A_SECOND = 1000
HZ = 30
SPEED = 0.3
MU = 0.5
GRAVITY = 9.81
LOAD = box("load", (0.05, 0.05, 0.05), basePosition=[0.0, 0.0, 0.1])


@pytest.fixture
def build(tmp_path):
    worlds = []

    def build_world(*dynamic, more=(FLOOR,), object_tf=None, **parts):
        """Builds a world with a hand, a plate of 0.1 m thickness whose rim rubs at nothing, that follows TF."""
        hand = {**box("hand", (0.3, 0.3, 0.05)), "object_tf": {"tf_id": "hand", **(object_tf or {})}}
        hand["changeDynamics"] = {"lateralFriction": 1.0}
        del hand["baseMass"]
        main = {"collision": (*more, hand), "dynamic": dynamic, "timeStep": 1.0 / TICKS_A_SECOND, **parts}
        worlds.append(World.from_file(write_world(tmp_path, **main)))
        return worlds[-1]

    yield build_world
    for world in worlds:
        world.close()


def _course(seconds):
    """Returns how far a hand is that starts with 1 m/s^2, goes on at 0.3 m/s and stops alike after 2 s [m]."""
    ramp_s = SPEED / 1.0
    t = min(seconds, 2.0)
    rising, falling = min(t, ramp_s), max(0.0, t - (2.0 - ramp_s))
    return 0.5 * rising**2 + SPEED * (t - rising) - 0.5 * falling**2


def _follow(world, pose_at, seconds, name="hand", hz=HZ):
    """Runs a world while poses come at a rate; yields after each tick."""
    sent = -1
    start = world.clock.tick
    while world.clock.tick - start < seconds * TICKS_A_SECOND:
        elapsed = (world.clock.tick - start) / TICKS_A_SECOND
        if math.floor(elapsed * hz) > sent:
            sent = math.floor(elapsed * hz)
            world.put(f"{name}/pose", pose_at(elapsed))
        world.step()
        yield elapsed


def _x(world, name):
    return world.bodies[name].base_pose().position[0]


def _speed(world, name):
    return world.bodies[name].base_twist().linear[0]


def test_moving_hand_carries_a_load_and_stops_at_last_pose(build):
    world = build(LOAD, more=())
    for elapsed in _follow(world, lambda t: Pose((_course(t), 0.0, 0.0)), 2.5):
        assert _x(world, "load") == pytest.approx(_x(world, "hand"), abs=1e-4), f"it slips at {elapsed} s"
        if 0.5 < elapsed < 1.6:
            assert _speed(world, "hand") == pytest.approx(SPEED, rel=1e-4)
            assert _speed(world, "load") == pytest.approx(SPEED, rel=1e-3)
    assert _x(world, "hand") == pytest.approx(_course(9.0), abs=1e-7)
    assert world.bodies["hand"].base_twist() == ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def test_put_anew_at_every_tick_instead_it_carries_nothing(build):
    world = build(LOAD, more=())
    for tick in range(TICKS_A_SECOND):
        world.bodies["hand"].set_base_pose(Pose((_course(tick / TICKS_A_SECOND), 0.0, 0.0)))
        world.step()
    assert _x(world, "hand") > 0.25
    assert abs(_x(world, "load")) < 1e-3


@pytest.mark.parametrize("mass_kg", [1.0, 20.0])
def test_hand_pushes_a_box_at_its_own_speed_without_slowing(build, mass_kg):
    world = build(box("pushed", basePosition=[0.45, 0.0, 0.1], baseMass=mass_kg))
    speeds = []
    for elapsed in _follow(world, lambda t: Pose((_course(t), 0.0, 0.1)), 1.6):
        if elapsed > 1.0:
            assert _speed(world, "hand") == pytest.approx(SPEED, rel=1e-4)
            assert _x(world, "pushed") - _x(world, "hand") == pytest.approx(0.4, abs=1e-4)
            speeds.append(_speed(world, "pushed"))
    assert speeds == pytest.approx([SPEED] * len(speeds), rel=0.02)
    assert sum(speeds) / len(speeds) == pytest.approx(SPEED, rel=1e-3)


def test_slipping_load_is_dragged_by_the_force_of_friction(build):
    world = build(LOAD, more=(), object_tf={"hz": TICKS_A_SECOND})
    speeds = [_speed(world, "load") for _ in _follow(world, lambda t: Pose((t, 0.0, 0.0)), 0.1, hz=TICKS_A_SECOND)]
    assert speeds[-1] < 0.6 * _speed(world, "hand"), "it does not slip"
    assert (speeds[-1] - speeds[9]) * TICKS_A_SECOND / (len(speeds) - 10) == pytest.approx(MU * GRAVITY, rel=0.02)


def test_jump_teleports_the_body_at_rest_and_is_reported_once(build, caplog):
    world = build(LOAD)
    jumps = {0.5: 1.0, 0.7: 1.5}
    fastest = 0.0

    def pose_at(seconds):
        return Pose((sum(way for begin, way in jumps.items() if seconds >= begin), 0.0, 0.0))

    for elapsed in _follow(world, pose_at, 1.0):
        fastest = max(fastest, math.hypot(*world.bodies["load"].base_twist().linear))
        if elapsed == 0.51:
            assert _x(world, "hand") == 1.0
        assert world.bodies["hand"].base_twist().linear == (0.0, 0.0, 0.0)
    assert fastest < 1.0, "it falls by 0.1 m at most"
    assert [line for line in caplog.messages if "jumped" in line] == [
        "hand: TF: 'hand' jumped by 1 m and 0 rad: it was put there at tick 500, at rest"
    ]


def test_first_pose_applies_immediately_and_later_ones_wait_for_ticks(build):
    world = build(more=())
    for position in (3.0, 3.1):
        world.put("hand/pose", Pose((position, 0.0, 0.0)))
        world.apply_inputs()
        assert _x(world, "hand") == 3.0
    world.step()
    assert 3.0 < _x(world, "hand") < 3.1


@pytest.mark.parametrize("hz", [3, 30, 100])
def test_follower_lags_one_and_a_half_periods_and_accelerates_evenly(build, hz):
    world = build(more=(), object_tf={"hz": hz})
    lags, speeds = [], [0.0]
    for elapsed in _follow(world, lambda t: Pose((SPEED * t, 0.0, 0.0)), 2.0 + 6.0 / hz, hz=hz):
        speeds.append(_speed(world, "hand"))
        lags.append(elapsed + 1.0 / TICKS_A_SECOND - _x(world, "hand") / SPEED)
    assert speeds[-1] == pytest.approx(SPEED, rel=1e-3)
    assert lags[-1] == pytest.approx(1.5 / hz, abs=1.5 / TICKS_A_SECOND)
    steps = [later - earlier for earlier, later in pairwise(speeds)]
    assert max(steps) < 1.2 * SPEED * hz / TICKS_A_SECOND + 1e-6, "within a period, not at once"


def _random_stream(seed):
    """Returns poses by the tick that they come at, as rough as TF may be."""
    draw = random.Random(seed)
    tick, stream = 0, {}
    for _ in range(60):
        tick += draw.choice((1, 8, 16, 17, 17, 40))
        quat = pybullet.getQuaternionFromEuler([draw.uniform(-0.3, 0.3) for _ in range(3)])
        stream[tick] = Pose(tuple(draw.uniform(-0.1, 0.1) for _ in range(3)), quat)
    return stream


@pytest.mark.parametrize("seed", range(5))
def test_a_path_never_overshoots_nor_exceeds_its_speeds(seed):
    max_step, max_turn = 0.004, 0.02
    path = PosePath(Pose(), 17, max_step, max_turn)
    stream = _random_stream(seed)
    seen, before = [Pose()], Pose()
    for tick in range(max(stream) + 500):
        if tick in stream:
            path.push(stream[tick], tick)
            seen.append(stream[tick])
        pose = path.next() if path.ticks_left else path.goal
        for axis in range(3):
            places = [each.position[axis] for each in seen]
            assert min(places) - 1e-12 <= pose.position[axis] <= max(places) + 1e-12
        assert math.dist(pose.position, before.position) <= max_step * (1.0 + 1e-9)
        assert math.hypot(*rotation_between(before.quat_xyzw, pose.quat_xyzw)) <= max_turn * 1.001
        before = pose
    assert path.goal == before == seen[-1] and not path.ticks_left


@pytest.mark.parametrize("dt_s", [0.001, 0.02])
def test_arm_on_a_moving_base_keeps_path_and_joint_positions(build, dt_s):
    arm = iiwa(
        initial_joint_position={"lbr_iiwa_joint_2": 40.0, "lbr_iiwa_joint_4": -60.0},
        object_tf={"tf_id": "carrier", "hz": 1.0 / dt_s, "max_angular_speed": 20.0},
    )
    world = build(robots=(arm,), timeStep=dt_s)
    body = world.bodies["iiwa"]
    assert body.inertial_pose_in_base.position != (0.0, 0.0, 0.0)  # else this test would show less
    start = body.joint_positions()
    for tick in range(round(2.0 / dt_s)):
        t = tick * dt_s
        yaw = 1.5 * t
        pose = Pose((math.cos(2.0 * t), 0.5 * t, 0.2), (0.0, 0.0, math.sin(yaw), math.cos(yaw)))
        world.put("iiwa/pose", pose)
        world.step()
        here = body.base_pose()
        if tick > 1:
            assert here.position == pytest.approx(pose.position, abs=1e-6)
            assert math.hypot(*rotation_between(here.quat_xyzw, pose.quat_xyzw)) < 1e-6
    assert body.base_twist().angular == pytest.approx((0.0, 0.0, 3.0), abs=1e-4)
    assert body.joint_positions() == pytest.approx(start, abs=2e-3)


def test_body_without_settable_velocity_is_placed_at_its_tf_pose(build):
    plate = {
        "name": "plate",
        "loadURDF": {"fileName": "cube.urdf", "useFixedBase": True, "useMaximalCoordinates": True},
    }
    world = build(urdfs=({**plate, "object_tf": {"tf_id": "plate"}},))
    for x in (1.0, 1.2):
        world.put("plate/pose", Pose((x, 0.0, 0.0)))
        world.step()
        assert _x(world, "plate") == pytest.approx(x)


def test_session_with_pose_streams_is_identical_when_replayed(build):
    world = build(LOAD, ball(basePosition=[0.35, 0.0, 0.1]))
    description = world.describe()
    states = []
    draw = random.Random(1)
    for _ in _follow(world, lambda t: Pose((_course(t) + draw.uniform(0.0, 0.01), 0.3 * math.sin(3.0 * t), 0.0)), 2.0):
        if world.clock.tick % 100 == 0:
            states.append(Checkpoint(0, world.clock.tick, world.commands.count, world.state_hash()))
    assert math.dist(world.bodies["load"].base_pose().position[:2], (0.0, 0.0)) > 0.1
    recording = Recording(WorldDescription(description), {0: recorded(world)}, set(states))
    result = Replay(recording).run()
    assert (result.difference, result.left_out, result.agreed) == (None, (), len(states) + 1)


def test_dynamic_and_urdf_objects_report_their_motion_if_requested(build):
    falling = ball(basePosition=[0.0, 0.0, 5.0], base_state_hz=100)
    cube = {"name": "cube", "loadURDF": {"fileName": "cube_small.urdf", "basePosition": [3.0, 0.0, 5.0]}}
    turning = {"angularVelocity": [0.0, 0.0, 2.0], "linearVelocity": [0.5, 0.0, 0.0]}
    world = build(
        falling,
        ball("silent", basePosition=[1.0, 0.0, 5.0]),
        urdfs=({**cube, "base_state_hz": 100, "resetBaseVelocity": turning},),
    )
    samples = [one for _ in range(50) for one in world.step() if isinstance(one, BaseStateSample)]
    assert [one.name for one in samples] == ["ball", "cube"] * 5
    drop, turn = samples[-2:]
    assert (drop.frame, turn.frame) == ("rpbi/ball", "rpbi/cube/baseLink")
    assert drop.twist.linear[2] == pytest.approx(-GRAVITY * 50 / TICKS_A_SECOND, rel=1e-6)
    assert turn.twist.angular == pytest.approx((0.0, 0.0, 2.0), rel=0.02)
