"""Bases of robots: fixed, following TF, floating, and driving over the ground."""

import math
import pickle

import pytest
from mobile_base import ARM_KG, BASE_KG, CENTRE_OF_BASE_M, HALF_LENGTH_M, mobile_base
from worlds import FLOOR, box, iiwa, write_world

from custom_ros_tools.errors import ConfigError, PhysicsError, UnknownNameError
from rpbi.control.joint_command import JointCommand
from rpbi.control.planar_base import PLANAR_JOINTS
from rpbi.geometry import Pose, Twist
from rpbi.samples import BaseStateSample, JointStateSample, LinkPoseSample
from rpbi.world import World

TICKS_A_SECOND = 1000
STILL = {"planar_base": None}
WALL_AT_M = 1.0
WALL = box("wall", (0.1, 2.0, 0.5), baseMass=1e6, basePosition=[WALL_AT_M + 0.1, 0.0, 0.5])


@pytest.fixture
def build(tmp_path):
    worlds = []

    def build_world(*robots, **parts):
        worlds.append(World.from_file(write_world(tmp_path, robots=robots, **parts)))
        return worlds[-1]

    yield build_world
    for world in worlds:
        world.close()


def _run(world, seconds):
    return [sample for _ in range(round(seconds * TICKS_A_SECOND)) for sample in world.step()]


def _drive(world, x=0.0, y=0.0, yaw=0.0):
    world.put("mobile/cmd_vel", Twist((x, y, 0.0), (0.0, 0.0, yaw)))


def _plane(world, name="mobile"):
    """Returns x, y [m] and yaw [rad] of a robot that must be upright at its start height."""
    (x, y, z), (qx, qy, qz, qw) = world.bodies[name].base_pose()
    assert (z, qx, qy) == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
    return x, y, 2.0 * math.atan2(qz, qw)


def _speed(world):
    return math.hypot(*world.bodies["mobile"].base_twist().linear[:2])


def _base_state(world):
    """Returns the state of the base as its sensor tells it now."""
    world.step()
    return next(sample for sample in world.read_rest() if isinstance(sample, BaseStateSample))


# Fixed, floating and following bases


def test_a_fixed_base_stays_whatever_pushes_it(build):
    pose = {"basePosition": [0.3, -0.2, 0.1], "baseOrientation": [0.0, 0.0, 0.6, 0.8]}
    robot = iiwa(initial_joint_position={"lbr_iiwa_joint_2": 90.0})
    robot["loadURDF"] |= pose
    world = build(robot, dynamic=(box(baseMass=20.0, basePosition=[0.3, -0.2, 2.0]),))
    _run(world, 1.0)
    position, quat = world.bodies["iiwa"].base_pose()
    assert position == pytest.approx(pose["basePosition"], abs=1e-6)
    assert quat == pytest.approx(pose["baseOrientation"], abs=1e-6)


def test_base_that_follows_tf_places_its_link_frame_there(build, tmp_path):
    robot = mobile_base(
        tmp_path,
        loadURDF={"useFixedBase": True},
        object_tf={"tf_id": "carrier"},
        broadcast_link_states=True,
        **STILL,
    )
    world = build(robot)
    followed = world.inputs["mobile/pose"]
    assert (followed.tf_id, followed.hz) == ("carrier", 30.0)
    pose = Pose((1.0, 2.0, 0.5), (0.5, 0.5, 0.5, 0.5))
    world.put("mobile/pose", pose)
    sample = [sample for sample in _run(world, 0.5) if isinstance(sample, LinkPoseSample)][-1]
    frames = dict(zip(sample.frames, sample.poses, strict=True))
    assert frames["rpbi/mobile/base_link"].position == pytest.approx(pose.position, abs=1e-6)
    assert frames["rpbi/mobile/base_link"].quat_xyzw == pytest.approx(pose.quat_xyzw, abs=1e-6)
    # The arm's joint is 0.5 m along the base's z, which this rotation turns into the world's x.
    assert frames["rpbi/mobile/arm"].position == pytest.approx((1.5, 2.0, 0.5), abs=1e-6)


def test_a_mobile_robot_by_its_type_needs_a_planar_base(build, tmp_path):
    with pytest.raises(ConfigError, match="planar_base: missing: a mobile_robot needs it"):
        build({**mobile_base(tmp_path, **STILL), "type": "mobile_robot"})


@pytest.mark.parametrize("planar_base", [None, {}])
def test_base_moved_by_physics_warns_that_tf_has_no_effect(build, tmp_path, caplog, planar_base):
    world = build(mobile_base(tmp_path, object_tf={"tf_id": "carrier"}, planar_base=planar_base))
    assert "mobile/pose" not in world.inputs
    assert "mobile: object_tf: has no effect" in caplog.text


def test_start_velocity_of_a_fixed_base_only_causes_a_warning(build, caplog):
    world = build(iiwa(resetBaseVelocity={"linearVelocity": [1.0, 0.0, 0.0]}))
    _run(world, 0.2)
    assert world.bodies["iiwa"].base_pose().position == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
    assert "iiwa: resetBaseVelocity: has no effect" in caplog.text


def test_a_floating_base_flies_as_it_was_thrown(build, tmp_path):
    velocity = {"linearVelocity": [1.0, -0.5, 2.0]}
    world = build(mobile_base(tmp_path, resetBaseVelocity=velocity, **STILL))
    body = world.bodies["mobile"]
    world.pb.changeDynamics(body.body_id, -1, linearDamping=0.0, angularDamping=0.0)
    _run(world, 1.0)
    # Semi-implicit Euler, which Bullet uses, adds g * t * dt / 2.
    assert body.base_pose().position == pytest.approx((1.0, -0.5, 2.0 - 9.81 / 2 * 1.001), rel=1e-3)


def test_twist_of_a_spinning_base_is_that_of_its_frame(build, tmp_path):
    spin = {"linearVelocity": [0.3, 0.0, 0.0], "angularVelocity": [0.0, 0.0, 2.0]}
    robot = mobile_base(tmp_path, loadURDF={"baseOrientation": [0.0, 0.0, 0.6, 0.8]}, resetBaseVelocity=spin, **STILL)
    world = build(robot, setGravity={"gravZ": 0.0})
    sample = next(sample for sample in world.read_rest() if isinstance(sample, BaseStateSample))
    assert (sample.name, sample.frame) == ("mobile", "rpbi/mobile/base_link")
    # The centre of mass moves at v = (0.3, 0) in the world, so the frame at -c from it at v - w x c; base axes stand at
    # 2 atan2(0.6, 0.8) to the world's.
    yaw = 2.0 * math.atan2(0.6, 0.8)
    cx, cy, _ = CENTRE_OF_BASE_M
    expected = 0.3 * math.cos(yaw) + 2.0 * cy, -0.3 * math.sin(yaw) - 2.0 * cx
    assert sample.twist.linear == pytest.approx((*expected, 0.0), abs=1e-6)
    assert sample.twist.angular == pytest.approx((0.0, 0.0, 2.0), abs=1e-6)


@pytest.mark.parametrize(
    ("more", "count"),
    [
        ({"loadURDF": {"useFixedBase": True}, **STILL}, 0),
        ({"loadURDF": {"useFixedBase": True}, "base_state_hz": 20, **STILL}, 20),
        (STILL, 50),
        ({}, 50),
        ({"base_state_hz": 0}, 0),
    ],
)
def test_base_state_is_sampled_by_default_where_physics_moves_it(build, tmp_path, more, count):
    samples = _run(build(mobile_base(tmp_path, **more)), 1.0)
    assert sum(isinstance(sample, BaseStateSample) for sample in samples) == count


@pytest.mark.parametrize("planar_base", [None, {}])
@pytest.mark.parametrize(
    ("more", "frames"),
    [
        ({}, set()),
        ({"broadcast_root_tf_hz": 10}, {("rpbi/mobile/base_link",)}),
        ({"broadcast_root_tf_hz": 10, "broadcast_link_states": True}, {("rpbi/mobile/base_link", "rpbi/mobile/arm")}),
    ],
)
def test_the_root_frame_is_broadcast_once(build, tmp_path, planar_base, more, frames):
    samples = _run(build(mobile_base(tmp_path, planar_base=planar_base, **more)), 0.5)
    assert {sample.frames for sample in samples if isinstance(sample, LinkPoseSample)} == frames


# Planar bases: what they are


@pytest.mark.parametrize("flag", ["URDF_MERGE_FIXED_LINKS", "URDF_MAINTAIN_LINK_ORDER"])
def test_the_joints_of_a_planar_base_are_not_the_robots(build, tmp_path, flag):
    world = build(mobile_base(tmp_path, loadURDF={"flags": flag}, broadcast_link_states=True))
    robot = world.bodies["mobile"]
    assert [joint.name for joint in robot.joints] == ["shoulder"]
    assert robot.root_link == "base_link"
    samples = {type(sample): sample for sample in _run(world, 0.1)}
    assert samples[JointStateSample].joint_names == ("shoulder",)
    assert len(samples[JointStateSample].position) == 1
    assert samples[LinkPoseSample].frames == ("rpbi/mobile/base_link", "rpbi/mobile/arm")
    with pytest.raises(UnknownNameError, match="known are shoulder"):
        world.put("mobile/target", JointCommand(["planar_base/x"], [1.0]))


@pytest.mark.parametrize("fixed", [True, False])
def test_planar_base_starts_at_its_pose_and_drives_straight_ahead(build, tmp_path, fixed):
    start = {"basePosition": [1.0, 2.0, 0.0], "baseOrientation": [0.0, 0.0, 1.0, 0.0], "useFixedBase": fixed}
    world = build(mobile_base(tmp_path, loadURDF=start))
    assert _plane(world) == pytest.approx((1.0, 2.0, math.pi), abs=1e-6)
    _drive(world, x=0.5)
    _run(world, 2.0)
    x, y, _ = _plane(world)
    assert (x, y) == pytest.approx((0.75, 2.0), abs=1e-3)  # 0.5 s up to 0.5 m/s, and as long to brake


def test_a_root_link_without_inertia_adds_none(build, tmp_path):
    robot = mobile_base(tmp_path)
    path = tmp_path / "footprint.urdf"
    joint = '<joint name="up" type="fixed"><parent link="footprint"/><child link="base_link"/></joint>'
    text = (tmp_path / "mobile_base.urdf").read_text()
    path.write_text(text.replace("</robot>", f'<link name="footprint"/>{joint}</robot>'))
    world = build(robot | {"loadURDF": robot["loadURDF"] | {"fileName": str(path)}})
    body = world.bodies["mobile"]
    assert body.root_link == "footprint"
    masses = [world.pb.getDynamicsInfo(body.body_id, link)[0] for link in (-1, *body.joint_indices)]
    assert sum(masses) == pytest.approx(BASE_KG + ARM_KG)


def test_robot_of_pybullet_with_relative_meshes_can_have_planar_base(build):
    robot = iiwa("mobile", planar_base={})
    world = build(robot)
    _drive(world, x=0.5)
    _run(world, 0.5)
    assert _plane(world)[0] == pytest.approx(0.125, abs=2e-3)  # a t^2 / 2


def test_meshes_in_a_folder_above_the_description_are_found(build, tmp_path):
    robot = mobile_base(tmp_path)
    (tmp_path / "cube.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    folder = tmp_path / "urdf"
    folder.mkdir()
    visual = '<link name="base_link"><visual><geometry><mesh filename="cube.obj"/></geometry></visual>'
    text = (tmp_path / "mobile_base.urdf").read_text()
    (folder / "robot.urdf").write_text(text.replace('<link name="base_link">', visual))
    world = build(robot | {"loadURDF": {"fileName": str(folder / "robot.urdf")}})
    shapes = world.pb.getVisualShapeData(world.bodies["mobile"].body_id)
    assert (str(tmp_path / "cube.obj").encode(), PLANAR_JOINTS[-1]) in {(shape[4], shape[1]) for shape in shapes}


# Planar bases: how they drive


def test_velocity_and_acceleration_stay_within_their_limits(build, tmp_path):
    limits = {
        "max_linear_velocity": 0.8,
        "max_linear_acceleration": 0.5,
        "max_angular_velocity": 0.6,
        "max_angular_acceleration": 0.4,
    }
    world = build(mobile_base(tmp_path, planar_base=limits, base_state_hz=1000))
    twists = []
    for _ in range(10):  # 4 s of a command that asks for too much
        _drive(world, x=6.0, y=8.0, yaw=-5.0)
        twists += [sample.twist for sample in _run(world, 0.4) if isinstance(sample, BaseStateSample)]
    speeds = [math.hypot(*twist.linear[:2]) for twist in twists]
    turns = [-twist.angular[2] for twist in twists]
    assert max(speeds) == pytest.approx(0.8, abs=2e-3)
    assert max(turns) == pytest.approx(0.6, abs=2e-3)
    assert speeds[1000] == pytest.approx(0.5, abs=5e-3)  # after 1 s
    assert turns[1000] == pytest.approx(0.4, abs=5e-3)
    (x, y, _), _ = twists[-1]
    assert y / x == pytest.approx(8.0 / 6.0, rel=1e-2)  # the limit keeps the direction


def test_a_square_of_one_metre_closes(build, tmp_path):
    world = build(mobile_base(tmp_path, planar_base={"cmd_vel_timeout_s": 2.0}))
    for _ in range(4):  # 0.5 s up to speed, 2 s in all, 0.5 s to rest; then a quarter turn of the same kind
        _drive(world, x=0.5)
        _run(world, 2.0)
        _drive(world)
        _run(world, 1.0)
        _drive(world, yaw=1.0)
        _run(world, math.pi / 2)
        _drive(world)
        _run(world, 1.0)
    x, y, yaw = _plane(world)
    assert math.hypot(x, y) < 2e-3
    assert math.remainder(yaw, 2.0 * math.pi) == pytest.approx(0.0, abs=3e-3)


def test_a_circle_has_the_radius_v_over_w_and_closes(build, tmp_path):
    world = build(mobile_base(tmp_path, planar_base={"cmd_vel_timeout_s": 100.0}))
    _drive(world, x=0.5, yaw=0.5)
    _run(world, 2.0)
    start, half = _plane(world), math.pi / 0.5
    _run(world, half)
    middle = _plane(world)
    _run(world, half)
    end = _plane(world)
    assert math.dist(start[:2], middle[:2]) == pytest.approx(2.0, abs=2e-3)
    assert math.dist(start[:2], end[:2]) < 2e-3


@pytest.mark.parametrize("time_step_s", [0.001, 0.02])
def test_driven_path_is_independent_of_the_tick_length(build, tmp_path, time_step_s):
    at_once = {"max_linear_acceleration": 1e4, "max_angular_acceleration": 1e4, "max_force": 1e8, "max_torque": 1e8}
    world = build(mobile_base(tmp_path, planar_base=at_once | {"cmd_vel_timeout_s": 10.0}), timeStep=time_step_s)
    _drive(world, x=0.5, yaw=1.0)
    for _ in range(round(2.0 / time_step_s)):
        world.step()
    radius_m = 0.5
    expected = radius_m * math.sin(2.0), radius_m * (1.0 - math.cos(2.0)), 2.0
    assert _plane(world) == pytest.approx(expected, abs=2e-4)


def test_the_twist_is_in_the_base_frame_while_it_turns(build, tmp_path):
    world = build(mobile_base(tmp_path, planar_base={"cmd_vel_timeout_s": 100.0}))
    _drive(world, x=0.4, y=0.2, yaw=1.0)
    _run(world, 3.0)
    before = _base_state(world)
    after = _base_state(world)
    assert before.twist.linear == pytest.approx((0.4, 0.2, 0.0), abs=2e-3)
    assert before.twist.angular == pytest.approx((0.0, 0.0, 1.0), abs=2e-3)
    # Turned by the pose that goes with it, it is what the pose changes by.
    travelled = [(b - a) * TICKS_A_SECOND for a, b in zip(before.pose.position, after.pose.position)]
    assert math.hypot(*travelled[:2]) == pytest.approx(math.hypot(0.4, 0.2), rel=1e-2)
    yaw = 2.0 * math.atan2(after.pose.quat_xyzw[2], after.pose.quat_xyzw[3])
    heading = math.atan2(travelled[1], travelled[0]) - yaw
    assert math.remainder(heading, 2.0 * math.pi) == pytest.approx(math.atan2(0.2, 0.4), abs=1e-2)


def test_it_brakes_when_commands_cease(build, tmp_path):
    world = build(mobile_base(tmp_path, planar_base={"cmd_vel_timeout_s": 0.3, "max_linear_acceleration": 2.0}))
    for _ in range(20):  # renewed, it goes on
        _drive(world, x=0.5)
        _run(world, 0.1)
    assert _speed(world) == pytest.approx(0.5, abs=2e-3)
    _run(world, 0.19)
    assert _speed(world) == pytest.approx(0.5, abs=2e-3)
    _run(world, 0.3)  # 0.25 s from 0.5 m/s to rest
    assert _speed(world) == pytest.approx(0.0, abs=1e-3)
    place = _plane(world)
    _run(world, 5.0)
    assert _plane(world) == pytest.approx(place, abs=1e-4)


@pytest.mark.parametrize(("time_step_s", "tolerance"), [(0.001, 1e-6), (0.02, 5e-3)])
def test_standing_base_does_not_drift_under_a_swinging_arm(build, tmp_path, time_step_s, tolerance):
    world = build(mobile_base(tmp_path), collision=(FLOOR,), timeStep=time_step_s)
    for swing in range(60):
        world.put("mobile/target", JointCommand(["shoulder"], [1.5 * (-1.0) ** swing]))
        for _ in range(round(0.9 / time_step_s)):
            world.step()
    world.put("mobile/target", JointCommand(["shoulder"], [0.0]))
    for _ in range(round(2.0 / time_step_s)):
        world.step()
    assert _plane(world) == pytest.approx((0.0, 0.0, 0.0), abs=tolerance)


def test_the_arm_feels_how_the_base_accelerates(build, tmp_path):
    world = build(mobile_base(tmp_path, joint_state_publisher_hz=1000, planar_base={"max_linear_acceleration": 1.0}))
    _run(world, 0.5)
    _drive(world, y=1.0)
    _run(world, 0.2)
    efforts = [sample.effort[0] for sample in _run(world, 0.1) if isinstance(sample, JointStateSample)]
    # The arm's centre of mass, 0.4 m ahead of the joint, is pushed sideways by the joint: m a l.
    assert sum(efforts) / len(efforts) == pytest.approx(ARM_KG * 1.0 * 0.4, rel=0.02)


# Planar bases: what is in the way


def test_wall_stops_the_base_with_its_force_and_it_returns(build, tmp_path):
    force = 150.0
    planar_base = {"max_force": force, "cmd_vel_timeout_s": 100.0}
    world = build(mobile_base(tmp_path, planar_base=planar_base), collision=(FLOOR,), dynamic=(WALL,))
    _drive(world, x=0.5)
    _run(world, 4.0)
    x, _, _ = _plane(world)
    assert x + HALF_LENGTH_M == pytest.approx(WALL_AT_M, abs=1e-3)
    base, wall = world.bodies["mobile"].body_id, world.bodies["wall"].body_id
    assert sum(point[9] for point in world.pb.getContactPoints(base, wall)) == pytest.approx(force, rel=0.01)
    _drive(world, x=-0.5)
    _run(world, 1.0)  # 0.5 s up to speed, 0.5 s at speed: it had not stored up the way it could not go
    assert x - _plane(world)[0] == pytest.approx(0.375, abs=0.01)


def test_base_does_not_jump_when_a_blocking_body_is_removed(build, tmp_path):
    planar_base = {"cmd_vel_timeout_s": 100.0}
    world = build(mobile_base(tmp_path, planar_base=planar_base), collision=(FLOOR,), dynamic=(WALL,))
    _drive(world, x=0.5)
    _run(world, 4.0)
    held = _plane(world)[0]
    world.remove("wall")
    _run(world, 1.0)
    assert _plane(world)[0] - held == pytest.approx(0.375, abs=0.01)


def test_a_box_is_pushed_and_pushes_back_with_its_friction(build, tmp_path):
    mass_kg = 20.0
    load = box("load", (0.15, 0.15, 0.15), baseMass=mass_kg, basePosition=[0.6, 0.0, 0.15])
    planar_base = {"cmd_vel_timeout_s": 100.0}
    world = build(mobile_base(tmp_path, planar_base=planar_base), collision=(FLOOR,), dynamic=(load,))
    _drive(world, x=0.3)
    _run(world, 3.0)
    base, load = world.bodies["mobile"].body_id, world.bodies["load"].body_id
    world.pb.changeDynamics(base, PLANAR_JOINTS[-1], lateralFriction=0.0)  # else the base lifts the box a little
    _run(world, 1.0)
    forces = []
    for _ in range(1000):
        world.step()
        forces.append(sum(point[9] for point in world.pb.getContactPoints(base, load)))
    assert sum(forces) / len(forces) == pytest.approx(0.5 * mass_kg * 9.81, rel=0.05)
    assert world.bodies["load"].base_pose().position[0] - _plane(world)[0] == pytest.approx(0.45, abs=0.01)
    assert _speed(world) == pytest.approx(0.3, abs=0.01)


def test_body_too_heavy_to_push_stays(build, tmp_path):
    load = box("load", (0.15, 0.15, 0.15), baseMass=100.0, basePosition=[0.6, 0.0, 0.15])
    planar_base = {"max_force": 100.0, "cmd_vel_timeout_s": 100.0}  # less than its friction of 490 N
    world = build(mobile_base(tmp_path, planar_base=planar_base), collision=(FLOOR,), dynamic=(load,))
    _run(world, 0.5)
    _drive(world, x=0.3)
    _run(world, 4.0)
    assert world.bodies["load"].base_pose().position[0] == pytest.approx(0.6, abs=0.02)


# Planar bases: being put, copied, misused


def test_planar_base_can_be_teleported_and_drives_on(build, tmp_path):
    world = build(mobile_base(tmp_path, planar_base={"cmd_vel_timeout_s": 100.0}))
    _drive(world, x=0.5, yaw=0.5)
    _run(world, 2.0)
    world.bodies["mobile"].teleport(Pose((3.0, -1.0, 0.0), (0.0, 0.0, 1.0, 0.0)))
    assert _plane(world) == pytest.approx((3.0, -1.0, math.pi), abs=1e-6)
    assert _speed(world) == 0.0
    _drive(world, x=0.5)
    _run(world, 0.5)
    x, y, _ = _plane(world)
    assert (x, y) == pytest.approx((3.0 - 0.125, -1.0), abs=2e-3)


@pytest.mark.parametrize(
    ("linear", "angular", "message"),
    [
        ((math.nan, 0.0, 0.0), (0.0, 0.0, 0.0), "must be finite, got linear.x=nan"),
        ((0.0, 0.0, 0.0), (0.0, 0.0, math.inf), "must be finite, got angular.z=inf"),
        ((0.1, 0.0, 0.2), (0.3, 0.0, 0.0), "got linear.z=0.2, angular.x=0.3"),
    ],
)
def test_velocities_that_it_cannot_have_are_refused_and_change_nothing(build, tmp_path, linear, angular, message):
    world = build(mobile_base(tmp_path))
    with pytest.raises(ValueError, match=message):
        world.put("mobile/cmd_vel", Twist(linear, angular))
    _run(world, 0.2)
    assert _plane(world) == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)


@pytest.mark.parametrize(
    ("more", "key"),
    [
        ({"planar_base": {"max_force": 0.0}}, "planar_base.max_force: must be > 0"),
        ({"planar_base": {"max_speed": 1.0}}, "planar_base.max_speed: unknown key"),
        ({"resetBaseVelocity": {"linearVelocity": [1.0, 0.0, 0.0]}}, "resetBaseVelocity: a planar base starts at rest"),
        ({"is_visual_robot": True}, "planar_base: a visual robot has no physics"),
        ({"base_state_hz": -1.0}, "base_state_hz: must be >= 0"),
        ({"loadURDF": {"useMaximalCoordinates": True}}, "loadURDF.useMaximalCoordinates: does not go with planar_base"),
    ],
)
def test_configurations_that_make_no_sense_are_named(build, tmp_path, more, key):
    with pytest.raises(ConfigError, match=key):
        build(mobile_base(tmp_path, **more))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<robot><link", "is not XML"),
        ("<robot name='r'/>", "the robot has no <link>"),
        (
            "<robot name='r'><link name='a'/><link name='b'/></robot>",
            "expected one link that is no joint's child, got a, b",
        ),
    ],
)
def test_a_description_without_one_root_is_refused(build, tmp_path, text, message):
    robot = mobile_base(tmp_path)
    path = tmp_path / "broken.urdf"
    path.write_text(text)
    with pytest.raises(ConfigError, match=message) as caught:
        build(robot | {"loadURDF": {"fileName": str(path)}})
    assert "loadURDF.fileName" in str(caught.value)


def test_a_base_that_is_not_finite_any_more_is_reported(build, tmp_path):
    world = build(mobile_base(tmp_path, base_state_hz=1000, joint_state_publisher_hz=1))
    world.pb.resetJointState(world.bodies["mobile"].body_id, 0, math.nan)
    with pytest.raises(PhysicsError, match="mobile: base is not finite"):
        _run(world, 0.01)


def _session(path):
    world = World.from_file(path)
    samples = []
    for tick in range(3000):
        if tick % 250 == 0:
            _drive(world, x=0.6, y=0.2 * (tick % 3), yaw=0.5)
            world.put("mobile/target", JointCommand(["shoulder"], [1.0 - tick % 4]))
        samples += world.step()
    world.close()
    return pickle.dumps(samples)


def test_the_same_commands_give_the_same_samples(tmp_path):
    parts = {
        "collision": (FLOOR,),
        "dynamic": (box("load", baseMass=5.0, basePosition=[0.6, 0.1, 0.1], broadcast_hz=1000),),
        "robots": (mobile_base(tmp_path, base_state_hz=1000, broadcast_link_states=True),),
    }
    path = write_world(tmp_path, **parts)
    assert _session(path) == _session(path)
