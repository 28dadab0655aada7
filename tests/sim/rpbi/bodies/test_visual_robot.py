"""Visual robots: shown, never felt."""

from __future__ import annotations

import math

import pytest
from worlds import ball, iiwa, write_world

from custom_ros_tools.errors import ConfigError
from rpbi.bodies.robots.visual_robot import VisualRobot
from rpbi.control.joint_command import JointCommand
from rpbi.geometry import Pose
from rpbi.world import World

JOINT = "lbr_iiwa_joint_2"


def ghost(**more):
    robot = iiwa("ghost", is_visual_robot=True, **more)
    del robot["setJointMotorControlArray"]
    return robot


@pytest.fixture
def build(tmp_path):
    worlds = []

    def build_world(*robots, dynamic=()) -> World:
        path = write_world(tmp_path, robots=robots, dynamic=dynamic, timeStep=0.005, setGravity={"gravZ": -9.81})
        worlds.append(World.from_file(path))
        return worlds[-1]

    yield build_world
    for world in worlds:
        world.close()


def run(world: World, ticks: int) -> None:
    for _ in range(ticks):
        world.step()


def joint(world: World, name: str = "ghost") -> float:
    robot = world.bodies[name]
    return robot.joint_positions()[robot.model[JOINT].index]


@pytest.mark.parametrize("fixed", [True, False])
def test_it_neither_falls_nor_sags_nor_swings(build, fixed):
    load = {"fileName": "kuka_iiwa/model.urdf", "basePosition": [0.0, 0.0, 1.0], "useFixedBase": fixed}
    world = build(ghost(loadURDF=load, initial_joint_position={JOINT: 40.0}))
    assert isinstance(world.bodies["ghost"], VisualRobot)
    run(world, 1000)
    assert world.bodies["ghost"].base_pose().position == pytest.approx((0.0, 0.0, 1.0), abs=1e-9)
    assert joint(world) == pytest.approx(math.radians(40.0), abs=1e-12)


def test_things_fall_through_it_as_if_it_were_not_there(build):
    balls = tuple(ball(f"ball{i}", basePosition=[0.02 * i, 0.0, 2.0 + 0.3 * i]) for i in range(3))
    world = build(ghost(), dynamic=balls)
    run(world, 400)
    for i in range(3):
        fallen = 2.0 + 0.3 * i - world.bodies[f"ball{i}"].base_pose().position[2]
        assert fallen == pytest.approx(0.5 * 9.81 * 2.0**2, rel=0.01)


def test_a_robot_moves_through_it(build):
    world = build(iiwa("arm"), ghost())
    world.put("arm/target", JointCommand([JOINT], [1.0]))
    run(world, 500)
    assert joint(world, "arm") == pytest.approx(1.0, abs=0.01)
    assert joint(world) == 0.0


def test_all_joints_are_reset_in_one_call(build, monkeypatch):
    world = build(ghost())
    robot = world.bodies["ghost"]
    calls = []
    for name in ("resetJointState", "resetJointStateMultiDof", "resetJointStatesMultiDof"):
        original = getattr(world.pb, name)
        monkeypatch.setattr(world.pb, name, lambda *given, do=original: calls.append(do) or do(*given))
    values = {joint.name: 0.1 * (i + 1) for i, joint in enumerate(robot.model.driven)}
    world.put("ghost/target", JointCommand(list(values), list(values.values())))
    run(world, 1)
    assert list(robot.joint_positions().values()) == list(values.values())
    assert len(calls) == 1


def test_visual_robot_follows_targets_beyond_limits_and_names_the_joint(build, caplog):
    world = build(ghost())
    world.put("ghost/target", JointCommand([JOINT], [0.7]))
    run(world, 1)
    assert joint(world) == 0.7
    for _ in range(3):
        world.put("ghost/target", JointCommand([JOINT], [3.0]))
        run(world, 1)
    assert joint(world) == 3.0
    assert [message for message in caplog.messages if "must be within" in message] == [
        f"ghost: joint '{JOINT}' must be within -2.0944 to 2.0944 rad, got 3; it is shown there"
    ]


def test_a_joint_without_limits_is_never_beyond_them(build, tmp_path, caplog):
    urdf = tmp_path / "wheel.urdf"
    urdf.write_text(
        "<robot name='r'><link name='a'/><link name='b'/><joint name='spin' type='continuous'>"
        "<parent link='a'/><child link='b'/><axis xyz='0 0 1'/></joint></robot>"
    )
    world = build(ghost(loadURDF={"fileName": str(urdf)}))
    world.put("ghost/target", JointCommand(["spin"], [50.0]))
    run(world, 1)
    assert not [message for message in caplog.messages if "must be within" in message]


def test_its_base_follows_a_frame(build):
    world = build(ghost(object_tf={"tf_id": "elsewhere"}))
    pose = Pose((1.0, 2.0, 0.5), (0.0, 0.0, math.sin(0.4), math.cos(0.4)))
    world.put("ghost/pose", pose)
    run(world, 100)
    found = world.bodies["ghost"].base_pose()
    assert found.position == pytest.approx(pose.position, abs=1e-9)
    assert found.quat_xyzw == pytest.approx(pose.quat_xyzw, abs=1e-6)


def test_velocities_alone_are_refused(build):
    with pytest.raises(ValueError, match="a visual robot shows positions; got velocity"):
        build(ghost()).put("ghost/target", JointCommand([JOINT], velocity=[1.0]))


def test_a_robot_that_is_not_visual_needs_motors(build):
    robot = ghost()
    robot["is_visual_robot"] = False
    with pytest.raises(ConfigError, match="setJointMotorControlArray: missing; only a visual robot does without"):
        build(robot)


INERTIAL = '<inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>'
STONE = f'<robot name="r"><link name="a">{INERTIAL}</link></robot>'
SPHERICAL = STONE.replace(
    "</robot>",
    f'<link name="b">{INERTIAL}</link><joint name="ball" type="spherical"><parent link="a"/><child link="b"/>'
    '<origin xyz="0 0 0.2"/></joint></robot>',
)


def test_spherical_joints_stay_finite_and_no_motor_moves_them(build, tmp_path):
    urdf = tmp_path / "ball.urdf"
    urdf.write_text(SPHERICAL)
    world = build(ghost(loadURDF={"fileName": str(urdf)}, broadcast_link_states=True))
    run(world, 200)
    assert world.bodies["ghost"].base_pose().position == (0.0, 0.0, 0.0)
    with pytest.raises(ValueError, match=r"expected joints that can be driven, got 'ball' \(JOINT_SPHERICAL\)"):
        world.bodies["ghost"].set_joint_state(JointCommand(["ball"], [0.5]))


def test_gravity_compensation_of_a_spherical_joint_is_refused(build, tmp_path):
    urdf = tmp_path / "ball.urdf"
    urdf.write_text(SPHERICAL)
    with pytest.raises(ConfigError, match="gravity_compensation: works with revolute, prismatic and fixed joints only"):
        build(iiwa(loadURDF={"fileName": str(urdf)}, gravity_compensation=True))


def test_gravity_compensation_of_a_robot_without_joints_does_nothing(build, tmp_path):
    urdf = tmp_path / "stone.urdf"
    urdf.write_text(STONE)
    worlds = [
        build(
            iiwa(
                loadURDF={"fileName": str(urdf)},
                setJointMotorControlArray={"controlMode": "TORQUE_CONTROL"},
                gravity_compensation=compensates,
            )
        )
        for compensates in (True, False)
    ]
    for world in worlds:
        run(world, 10)
    fallen, also_fallen = (world.bodies["iiwa"].base_pose() for world in worlds)
    assert fallen == also_fallen
    assert fallen.position[2] < -0.01
