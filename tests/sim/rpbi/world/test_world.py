"""The physics of a world, through its own eyes."""

import math

import pybullet
import pytest
from worlds import FLOOR, ball, box, iiwa, write_world

from custom_ros_tools.errors import ConfigError, PhysicsError, UnknownNameError
from rpbi.control.joint_command import JointCommand
from rpbi.geometry import Pose
from rpbi.samples import JointStateSample, LinkPoseSample
from rpbi.world import World
from rpbi.world.loading import load_object


@pytest.fixture
def build(tmp_path):
    worlds = []

    def build_world(**arguments):
        worlds.append(World.from_file(write_world(tmp_path, **arguments)))
        return worlds[-1]

    yield build_world
    for world in worlds:
        world.close()


def _config(kind, data):
    return load_object(kind, data, "test.yaml")


def _positions(world):
    robot = world.bodies["iiwa"]
    return dict(zip((joint.name for joint in robot.joints), robot.state().joints))


def _run(world, ticks):
    return [sample for _ in range(ticks) for sample in world.step()]


def test_a_ball_falls_by_half_g_t_squared(build):
    world = build(dynamic=(ball(basePosition=[0.0, 0.0, 10.0]),))
    _run(world, 1000)
    fallen = 10.0 - world.bodies["ball"].base_pose().position[2]
    # Semi-implicit Euler, which Bullet uses, adds g * t * dt / 2.
    assert fallen == pytest.approx(9.81 / 2 * 1.0 + 9.81 * 0.001 / 2, rel=1e-4)


@pytest.mark.parametrize(("angle_deg", "slides"), [(20.0, False), (33.0, True)])
def test_a_box_slides_iff_the_slope_exceeds_friction(build, angle_deg, slides):
    angle = math.radians(angle_deg)  # friction is 0.5 * 1, whose angle is 26.6 deg
    world = build(
        collision=(FLOOR,),
        dynamic=(box(basePosition=[0.0, 0.0, 0.1]),),
        setGravity={"gravX": 9.81 * math.sin(angle), "gravZ": -9.81 * math.cos(angle)},
    )
    _run(world, 1000)
    moved = world.bodies["box"].base_pose().position[0]
    expected = 0.5 * 9.81 * (math.sin(angle) - 0.5 * math.cos(angle))
    assert moved == pytest.approx(expected if slides else 0.0, abs=0.02)


def test_a_box_without_collision_shape_is_fallen_through(build):
    world = build(visual=({"name": "ghost", "createVisualShape": FLOOR["createVisualShape"]},), dynamic=(box(),))
    _run(world, 500)
    assert world.bodies["box"].base_pose().position[2] < -1.0


def test_collision_object_holds_a_falling_body(build):
    world = build(collision=(FLOOR,), dynamic=(box(basePosition=[0.0, 0.0, 0.3]),))
    _run(world, 1500)
    assert world.bodies["box"].base_pose().position[2] == pytest.approx(0.1, abs=2e-3)


def test_robot_reaches_its_target_and_other_joints_keep_theirs(build):
    world = build(robots=(iiwa(initial_joint_position={"lbr_iiwa_joint_2": 30.0}),))
    world.put("iiwa/target", JointCommand(["lbr_iiwa_joint_4"], [-0.7]))
    _run(world, 3000)
    position = _positions(world)
    assert position["lbr_iiwa_joint_4"] == pytest.approx(-0.7, abs=2e-3)
    assert position["lbr_iiwa_joint_2"] == pytest.approx(math.radians(30.0), abs=2e-3)


def test_a_robot_holds_its_start_pose_against_gravity(build):
    start = {"lbr_iiwa_joint_2": 60.0, "lbr_iiwa_joint_4": -30.0}
    world = build(robots=(iiwa(initial_joint_position=start),))
    _run(world, 5000)
    position = _positions(world)
    for joint, value_deg in start.items():
        assert position[joint] == pytest.approx(math.radians(value_deg), abs=1e-3)


def test_start_positions_in_radians_are_taken_as_such(build):
    world = build(
        robots=(iiwa(initial_joint_position={"lbr_iiwa_joint_2": 0.5}, initial_revolute_joint_positions_are_deg=False),)
    )
    assert _positions(world)["lbr_iiwa_joint_2"] == 0.5


def test_motors_obey_effort_and_velocity_limits_of_the_urdf(build):
    world = build(robots=(iiwa(joint_state_publisher_hz=1000),))
    robot = world.bodies["iiwa"]
    limit = robot.model["lbr_iiwa_joint_1"]
    assert (limit.max_effort, limit.max_velocity) == (300.0, 10.0)
    world.put("iiwa/target", JointCommand(["lbr_iiwa_joint_1"], [2.9]))
    samples = _run(world, 600)
    efforts = [abs(effort) for sample in samples for effort in sample.effort]
    assert 0.9 * 300.0 < max(efforts) <= 300.0
    assert max(abs(velocity) for sample in samples for velocity in sample.velocity) <= 10.0 * 1.02


def test_effort_limits_can_be_switched_off(build):
    world = build(robots=(iiwa(joint_state_publisher_hz=1000, enforce_effort_limits=False),))
    world.put("iiwa/target", JointCommand(["lbr_iiwa_joint_1"], [2.9]))
    assert max(abs(effort) for sample in _run(world, 100) for effort in sample.effort) > 300.0


def test_samples_come_at_their_rates(build):
    world = build(
        dynamic=(ball(broadcast_hz=30),),
        robots=(iiwa(joint_state_publisher_hz=100, broadcast_link_states=True, broadcast_link_states_hz=50),),
    )
    samples = _run(world, 1000)
    assert sum(isinstance(sample, JointStateSample) for sample in samples) == 100
    poses = [sample for sample in samples if isinstance(sample, LinkPoseSample)]
    assert sum(sample.name == "iiwa" for sample in poses) == 50
    assert sum(sample.name == "ball" for sample in poses) == 30


def test_link_poses_are_those_of_urdf_frames(build):
    world = build(robots=(iiwa(broadcast_link_states=True),))
    robot = world.bodies["iiwa"]
    assert robot.inertial_pose_in_base.position != (0.0, 0.0, 0.0)  # else this test would show nothing
    sample = next(sample for sample in world.read_rest() if isinstance(sample, LinkPoseSample))
    poses = dict(zip(sample.frames, sample.poses))
    assert poses["rpbi/iiwa/lbr_iiwa_link_0"].position == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
    # Joint origins of the stretched arm, as the URDF has them: 0.1575 + 0.2025 + 0.2045 + 0.2155 + ... [m]
    assert poses["rpbi/iiwa/lbr_iiwa_link_1"].position == pytest.approx((0.0, 0.0, 0.1575), abs=1e-6)
    assert poses["rpbi/iiwa/lbr_iiwa_link_7"].position == pytest.approx((0.0, 0.0, 1.261), abs=1e-3)


def test_an_object_follows_its_frame(build):
    visual = {
        "name": "hand",
        "createVisualShape": {"shapeType": "GEOM_SPHERE", "radius": 0.1},
        "object_tf": {"tf_id": "hand"},
    }
    world = build(visual=(visual,))
    world.put("hand/pose", Pose((1.0, 2.0, 3.0), (0.0, 0.0, 2.0, 0.0)))
    world.step()
    position, quat = world.bodies["hand"].base_pose()
    assert position == pytest.approx((1.0, 2.0, 3.0))
    assert quat == pytest.approx((0.0, 0.0, 1.0, 0.0))


@pytest.mark.parametrize(
    ("slot", "value", "error", "message"),
    [
        ("iiwa/target", JointCommand(["lbr_iiwa_joint_1"], [math.nan]), ValueError, "finite"),
        ("iiwa/target", JointCommand(["lbr_iiwa_joint_9"], [0.1]), UnknownNameError, "lbr_iiwa_joint_9"),
        ("iiwa/target", JointCommand(["lbr_iiwa_joint_1"], []), ValueError, "got no values"),
        ("iiwa/goal", None, UnknownNameError, "iiwa/target"),
    ],
)
def test_bad_input_is_refused_and_leaves_the_world_alone(build, slot, value, error, message):
    world = build(robots=(iiwa(),))
    with pytest.raises(error, match=message):
        world.put(slot, value)
    before = _positions(world)
    _run(world, 10)
    assert _positions(world) == pytest.approx(before, abs=1e-4)


def test_physics_that_blows_up_is_reported_not_passed_on(build):
    world = build(robots=(iiwa(joint_state_publisher_hz=1000),))
    world.pb.resetJointState(world.bodies["iiwa"].body_id, 2, math.nan)
    with pytest.raises(PhysicsError, match="iiwa"):
        _run(world, 5)


def test_a_taken_name_is_refused(build):
    world = build(dynamic=(ball(),))
    with pytest.raises(ConfigError, match="'ball' is taken"):
        world.add("dynamic", _config("dynamic", ball()))
    assert list(world.bodies) == ["ball"]


def test_close_ends_all_clients_of_robots(tmp_path):
    def clients():
        return [number for number in range(100) if pybullet.isConnected(number)]

    before = clients()
    world = World.from_file(write_world(tmp_path, robots=(iiwa(),)))
    world.bodies["iiwa"].robot_model.mass_matrix([0.0] * 7)
    world.close()
    assert clients() == before


def test_a_window_without_a_screen_is_refused_and_ends_nothing(build, monkeypatch):
    monkeypatch.setenv("DISPLAY", ":4711")
    with pytest.raises(PhysicsError, match="connect.connection_mode: .* none answers at DISPLAY ':4711': write DIRECT"):
        build(connect={"connection_mode": "GUI"})


def test_removing_an_unknown_body_names_known_ones(build):
    world = build(dynamic=(ball(),))
    with pytest.raises(UnknownNameError, match="ball"):
        world.remove("bal")


@pytest.mark.parametrize(
    ("kind", "data"),
    [
        ("robot", iiwa(initial_joint_position={"no_such_joint": 1.0})),
        ("robot", iiwa(setJointMotorControlArray={"controlMode": "POSITION_CONTROL", "positionGains": [0.1, 0.2]})),
    ],
)
def test_a_failing_add_leaves_the_world_as_it_was(build, kind, data):
    world = build(collision=(FLOOR,), dynamic=(ball(),))
    bodies, log = world.pb.getNumBodies(), list(world.log)
    with pytest.raises((ConfigError, UnknownNameError)):
        world.add(kind, _config(kind, data))
    assert world.pb.getNumBodies() == bodies
    assert world.log == log
    assert "iiwa" not in world.bodies
    world.add("robot", _config("robot", iiwa()))
    _run(world, 10)


def test_problems_of_all_bodies_are_reported_with_their_files(tmp_path):
    path = write_world(
        tmp_path,
        robots=(
            iiwa("one", initial_joint_position={"no_such_joint": 1.0}),
            iiwa("two", setJointMotorControlArray={"controlMode": "POSITION_CONTROL", "velocityGains": [0.1, 0.2]}),
        ),
    )
    with pytest.raises(ConfigError) as caught:
        World.from_file(path)
    text = str(caught.value)
    assert "one.yaml: " in text and "no_such_joint" in text
    assert "two.yaml: setJointMotorControlArray.velocityGains" in text and "got 2" in text


def test_two_worlds_in_one_process_do_not_touch(build, tmp_path):
    first = build(dynamic=(ball(basePosition=[0.0, 0.0, 1.0]),))
    second = build(dynamic=(ball(basePosition=[0.0, 0.0, 5.0]),))
    _run(first, 100)
    assert second.bodies["ball"].base_pose().position[2] == 5.0


def test_bodies_come_and_go_without_leaving_anything(build):
    world = build(collision=(FLOOR,))
    for turn in range(200):
        world.add("dynamic", _config("dynamic", ball(f"ball{turn}", broadcast_hz=50)))
        _run(world, 3)
        world.remove(f"ball{turn}")
    assert world.pb.getNumBodies() == 1
    assert list(world.inputs) == []
    assert _run(world, 100) == []
