"""Controllers that live in the tick, and IMPEDANCE_CONTROL."""

from __future__ import annotations

import logging
import math
import re
from pathlib import Path

import numpy as np
import pinocchio
import pytest
from worlds import FLOOR, iiwa, write_world

from custom_ros_tools.errors import ConfigError, UnknownNameError
from robot_model.geometry import rotation_between
from rpbi.control.controllers import Controller
from rpbi.control.controllers.cartesian_impedance import PoseTarget
from rpbi.control.controllers.controller import SetPoints
from rpbi.control.controllers.manager import ControllerSwitch, ControllerUpdate
from rpbi.control.joint_command import JointCommand
from rpbi.geometry import Pose, Twist
from rpbi.world import World
from rpbi.world.actions import TimedGoal
from rpbi.world.saved.command_log import RecordedCommand, apply_command
from rpbi.world.saved.values import to_text

ROOT = Path(__file__).resolve().parents[4]
LWR = ROOT / "src" / "rpbi_examples" / "robots" / "kuka_lwr.urdf"
BENT = {"lwr_arm_1_joint": 30.0, "lwr_arm_3_joint": -90.0, "lwr_arm_5_joint": 60.0}
JOINTS = [f"lwr_arm_{index}_joint" for index in range(7)]
TIP = "end_effector_ball"
STIFFEST = 2000.0
"""Of the joints of the real LWR [N m/rad], by its manual; its tip goes up to 5000 N/m and 300 N m/rad."""
SPONGE = {"contactStiffness": 3000.0, "contactDamping": 100.0}


def lwr(**more) -> dict:
    return {
        "name": "lwr",
        "loadURDF": {"fileName": str(LWR), "useFixedBase": True, **more.pop("loadURDF", {})},
        "setJointMotorControlArray": {"controlMode": "POSITION_CONTROL"},
        "initial_joint_position": BENT,
        **more,
    }


def wrong(name: str, **more) -> dict:
    return {"type": f"{__name__}:{name}", **more}


class Raises(Controller):
    def compute(self, state, targets, tick):
        if tick >= 5:
            raise RuntimeError("out of ideas")
        return self.arm.model.bias(state.base, state.position, state.velocity)


class NotFinite(Controller):
    def compute(self, state, targets, tick):
        return np.full(len(self.arm.chosen), math.nan)


class TooFew(Controller):
    def compute(self, state, targets, tick):
        return np.zeros(2)


class Slow(Controller):
    def compute(self, state, targets, tick):
        return np.array([float(sum(range(150_000)) * 0) for _ in self.arm.chosen])


class TellsNonsense(Controller):
    def compute(self, state, targets, tick):
        return self.arm.model.bias(state.base, state.position, state.velocity)

    def report(self):
        return {"error": math.inf}


class Follows(Controller):
    """Moves its joints by set points."""

    def start(self, state, tick):
        self._start = np.array(state.position)[self.arm.chosen]
        self._tick = tick

    def compute(self, state, targets, tick):
        return SetPoints(self._start + 0.2 * (tick + 1 - self._tick) * self.arm.dt_s)


class SeesItsBase(Controller):
    """Notes pose and twist of its base, and leaves its joints alone."""

    def start(self, state, tick):
        self.seen = []

    def compute(self, state, targets, tick):
        self.seen.append((state.base, state.base_twist))
        return np.zeros(len(self.arm.chosen))


@pytest.fixture
def build(tmp_path):
    worlds = []

    def build_world(*robots, dt_s=0.001, **more) -> World:
        path = write_world(tmp_path, robots=robots, timeStep=dt_s, setGravity={"gravZ": -9.81}, **more)
        worlds.append(World.from_file(path))
        return worlds[-1]

    yield build_world
    for world in worlds:
        world.close()


def run(world: World, ticks: int) -> None:
    for _ in range(ticks):
        world.step()


def positions(world: World, name: str = "lwr") -> np.ndarray:
    return np.array([position for position, _ in world.bodies[name].drive.measured().values()])


def velocities(world: World, name: str = "lwr") -> np.ndarray:
    return np.array([velocity for _, velocity in world.bodies[name].drive.measured().values()])


def push(world: World, link: str, force: tuple[float, float, float], ticks: int) -> None:
    """Pushes at the centre of mass of a link."""
    robot = world.bodies["lwr"]
    index = next(joint.index for joint in robot.joints if joint.link == link)
    for _ in range(ticks):
        centre = robot.pb.getLinkState(robot.body_id, index, computeForwardKinematics=True)[0]
        robot.pb.applyExternalForce(robot.body_id, index, force, centre, robot.pb.WORLD_FRAME)
        world.step()


def test_robot_model_equals_pinocchio_and_finite_differences(build):
    base = {"basePosition": [0.3, -0.2, 0.1], "baseOrientation": [0.1825742, 0.3651484, 0.5477226, 0.7302967]}
    robot = build(lwr(loadURDF=base)).bodies["lwr"]
    model, where = robot.robot_model, robot.base_pose()
    other = pinocchio.buildModelFromUrdf(str(LWR), pinocchio.JointModelFreeFlyer())
    data = other.createData()
    rng = np.random.default_rng(2)
    for _ in range(5):
        q, velocity = rng.uniform(-1.0, 1.0, (2, 7))
        whole_q = np.concatenate((where.position, where.quat_xyzw, q))
        whole_velocity = np.concatenate((np.zeros(6), velocity))
        mass = pinocchio.crba(other, data, whole_q)[6:, 6:]
        mass = np.triu(mass) + np.triu(mass, 1).T
        bias = pinocchio.nonLinearEffects(other, data, whole_q, whole_velocity)[6:]
        assert model.mass_matrix(q.tolist()) == pytest.approx(mass, abs=1e-9)
        assert model.bias(where, q.tolist(), velocity.tolist()) == pytest.approx(bias, abs=1e-5)
        point = (0.1, -0.05, 0.2)
        for link in (
            robot.model[JOINTS[3]].index,
            robot.model[JOINTS[6]].index,
        ):  # the former's inertial frame is turned

            def place(q, link=link, point=point):
                pose = model.pose(where, q, link) @ Pose(point, (0.0, 0.0, 0.0, 1.0))
                return np.array(pose.position)

            jacobian = model.jacobian(where, q.tolist(), link, point)
            for joint in range(7):
                step = np.zeros(7)
                step[joint] = 1e-3
                slope = (place(q + step) - place(q - step)) / 2e-3
                assert jacobian[:3, joint] == pytest.approx(slope, abs=3e-4), (
                    "PyBullet tells places in single precision"
                )


@pytest.mark.parametrize("ratio", [0.1, 0.7, 1.0])
@pytest.mark.parametrize("stiffness", [50.0, STIFFEST])
def test_impedance_control_has_the_requested_stiffness_at_all_values(build, stiffness, ratio):
    robot = lwr(
        setJointMotorControlArray={"controlMode": "IMPEDANCE_CONTROL"},
        impedance={"stiffness": stiffness, "damping_ratio": ratio},
    )
    world = build(robot)
    start = positions(world)
    run(world, 200)
    assert positions(world) == pytest.approx(start, abs=1e-6), "gravity is compensated"
    body = world.bodies["lwr"]
    world.put("lwr/target", JointCommand(JOINTS[:1], [start[0] + 0.05]))
    run(world, 1)
    assert np.isfinite(positions(world)).all()
    run(world, 20_000 if stiffness < 100.0 and ratio < 0.5 else 3000)
    assert positions(world)[0] == pytest.approx(start[0] + 0.05, abs=2e-4)
    assert np.abs(velocities(world)).max() < 1e-3
    if stiffness == STIFFEST:
        return
    force, link = (0.0, 3.0, 0.0), "lwr_arm_7_link"
    before = positions(world)
    push(world, link, force, 20_000 if ratio < 0.5 else 5000)
    index = next(joint.index for joint in body.joints if joint.link == link)
    centre = body.pb.getDynamicsInfo(body.body_id, index)[3]
    jacobian = body.robot_model.jacobian(body.base_pose(), positions(world).tolist(), index, centre)
    assert positions(world) - before == pytest.approx(jacobian[:3].T @ force / stiffness, rel=0.01, abs=2e-4)


def test_position_targets_and_motions_drive_the_springs(build):
    world = build(lwr(setJointMotorControlArray={"controlMode": "IMPEDANCE_CONTROL"}))
    for number in range(50):
        world.put("lwr/target", JointCommand(JOINTS[:1], [0.01 * number], stamp_ns=1 + number * 20_000_000))
        run(world, 20)
    run(world, 800)
    assert positions(world)[0] == pytest.approx(0.49, abs=1e-3)
    world.act("lwr", "switch_mode", world.bodies["lwr"].config.setJointMotorControlArray.controlMode)
    efforts = world.bodies["lwr"].efforts(tuple([0.0] * len(world.bodies["lwr"].joints)))
    assert any(abs(effort) > 1.0 for effort in efforts), "what is applied is told"


def test_cartesian_spring_yields_by_its_stiffness(build):
    world = build(lwr(controllers={"hold": {"type": "cartesian_impedance", "link": TIP, "stiffness": 500.0}}))
    controller = world.bodies["lwr"].controllers.of("hold")
    start = controller._pose().position
    run(world, 300)
    assert controller._pose().position == pytest.approx(start, abs=1e-5)
    push(world, TIP, (0.0, 5.0, 0.0), 3000)
    moved = np.subtract(controller._pose().position, start)
    assert moved == pytest.approx([0.0, 5.0 / 500.0, 0.0], abs=5e-5)


def test_cartesian_spring_reaches_its_target_at_the_largest_stiffness(build):
    keys = {"stiffness": 5000.0, "rotational_stiffness": 300.0}
    world = build(lwr(controllers={"hold": {"type": "cartesian_impedance", "link": TIP, **keys}}))
    controller = world.bodies["lwr"].controllers.of("hold")
    (x, y, z), quat = controller._pose()
    for number in range(1, 26):
        pose = Pose((x, y + 0.004 * number, z), tuple(-part for part in quat))  # the same orientation
        world.put("lwr/hold/target", PoseTarget(pose, round(1e9 + 2e7 * number)))
        run(world, 20)
    run(world, 1600)
    assert controller._pose().position == pytest.approx((x, y + 0.1, z), abs=1e-4)
    assert world.bodies["lwr"].controllers.sample("lwr", "hold").values["turn/x"] == pytest.approx(0.0, abs=1e-3)


def touch(world: World, ticks: int) -> np.ndarray:
    """Returns the force on the tip after each tick [N]."""
    robot = world.bodies["lwr"]
    index = next(joint.index for joint in robot.joints if joint.link == TIP)
    forces = []
    for _ in range(ticks):
        world.step()
        contacts = robot.pb.getContactPoints(robot.body_id, world.bodies["floor"].body_id, index)
        forces.append(sum(contact[9] for contact in contacts))
    return np.array(forces)


def over_a_floor(build, friction: float = 0.5, **keys) -> World:
    floor = {**FLOOR, "changeDynamics": {"lateralFriction": friction, **SPONGE}}
    controllers = {"press": {"type": "force", "link": TIP, "approach_speed": 0.05, **keys}}
    return build(lwr(loadURDF={"basePosition": [0.0, 0.0, -0.1]}, controllers=controllers), collision=(floor,))


def test_force_control_touches_softly_and_reaches_the_requested_force(build):
    force = touch(over_a_floor(build, force=5.0), 2500)
    begin = int(np.argmax(force > 0.0))
    assert 500 < begin < 1000, "it comes at 0.05 m/s"
    assert force.max() < 10.0
    pressed = force[begin + 500 :]
    assert pressed.mean() == pytest.approx(5.0, abs=0.05)
    assert pressed.std() < 0.2


def test_a_force_stays_while_it_wipes(build):
    world = over_a_floor(build, force=20.0, stiffness=2000.0)
    touch(world, 1200)
    controller = world.bodies["lwr"].controllers.of("press")
    (x, y, z), quat = controller._pose()
    forces = []
    for number in range(1, 126):
        way = 0.3 * (1.0 - math.cos(math.pi * number / 125.0)) / 2.0
        world.put("lwr/press/target", PoseTarget(Pose((x, y + way, z), quat), round(1e9 + 2e7 * number)))
        forces.append(touch(world, 20))
    error = np.concatenate(forces) - 20.0
    assert np.sqrt(np.mean(error**2)) < 0.5
    assert controller._pose().position[1] - y == pytest.approx(0.3, abs=0.02)


@pytest.mark.parametrize(
    "controller, told",
    [
        (wrong("Raises"), r"test_controllers:Raises.*out of ideas"),
        (wrong("NotFinite"), "not finite"),
        (wrong("TooFew"), r"expected one number for each of its 7 joints, got shape \(2,\)"),
        (wrong("TellsNonsense"), "reported numbers are not finite: error"),
        (wrong("Slow"), r"it needs .* ms for a tick of 1 ms"),
    ],
    ids=["raises", "not finite", "too few", "invalid state", "slow"],
)
def test_failing_controller_is_stopped_and_named_and_the_world_continues(build, caplog, controller, told):
    aside = {"fileName": "kuka_iiwa/model.urdf", "useFixedBase": True, "basePosition": [2.0, 0.0, 0.0]}
    world = build(lwr(controllers={"bad": controller}), iiwa(loadURDF=aside))
    world.put("iiwa/target", JointCommand(["lbr_iiwa_joint_1"], [0.5]))
    with caplog.at_level(logging.ERROR):
        run(world, 60)
    where = positions(world)
    run(world, 300)
    (message,) = caplog.messages
    assert message.startswith("lwr: controller 'bad' is stopped, its joints hold: ")
    sample = world.bodies["lwr"].controllers.sample("lwr", "bad")
    assert not sample.active
    assert re.search(told, sample.message), sample.message
    assert positions(world) == pytest.approx(where, abs=2e-2)
    assert np.abs(velocities(world)).max() < 1e-3
    assert positions(world, "iiwa")[0] == pytest.approx(0.5, abs=1e-3)


def test_set_points_move_their_joints_and_others_keep_targets(build):
    world = build(lwr(controllers={"turn": wrong("Follows", joints=JOINTS[:1])}))
    world.put("lwr/target", JointCommand(JOINTS[6:], [0.3]))
    start = positions(world)
    run(world, 1000)
    moved = positions(world) - start
    assert moved[0] == pytest.approx(0.2, abs=1e-3)
    assert moved[6] == pytest.approx(0.3, abs=1e-3)
    assert moved[1:6] == pytest.approx([0.0] * 5, abs=1e-3)


def test_one_joint_has_one_controller(build):
    springs = {"type": "joint_impedance"}
    with pytest.raises(ConfigError, match=r"controllers.second: 'first' drives 'lwr_arm_0_joint' already"):
        build(lwr(controllers={"first": springs, "second": springs}))
    world = build(lwr(controllers={"first": springs, "second": {**springs, "active": False}}))
    with pytest.raises(ValueError, match="'second' and 'first' both drive 'lwr_arm_0_joint': stop one of them"):
        world.act("lwr", "switch_controllers", ControllerSwitch(["second"], []))
    with pytest.raises(UnknownNameError, match="third"):
        world.act("lwr", "switch_controllers", ControllerSwitch(["third"], []))
    world.act("lwr", "switch_controllers", ControllerSwitch(["second"], ["first"]))
    controllers = world.bodies["lwr"].controllers
    assert [controllers.sample("lwr", name).active for name in ("first", "second")] == [False, True]
    with pytest.raises(ValueError, match="a controller drives lwr_arm_0_joint until it is stopped"):
        world.put("lwr/target", JointCommand(JOINTS[:1], [0.1]))
    with pytest.raises(ValueError, match="a controller drives lwr_arm_0_joint until it is stopped"):
        world.act("lwr", "move", TimedGoal({world.bodies["lwr"].model[JOINTS[0]].index: 0.1}, 1.0))


@pytest.mark.parametrize(
    "keys, told",
    [
        ({"type": "joint_impedance", "stiffness": -1.0}, "controllers.c.stiffness"),
        ({"type": "joint_impedance", "stiffness": math.nan}, "controllers.c.stiffness"),
        ({"type": "joint_impedance", "stiffness": {"elbow": 1.0}}, "'elbow' is none of its joints"),
        ({"type": "cartesian_impedance", "link": "nose"}, "there is no link 'nose'"),
        ({"type": "cartesian_impedance", "link": TIP, "damping_ratio": math.inf}, "damping_ratio"),
        ({"type": "force", "link": TIP, "axis": [0, 0, 0]}, "expected a direction"),
        ({"type": "force", "link": TIP, "approach_speed": 0.0}, "approach_speed"),
        ({"type": "spring"}, "controllers.c.type"),
        ({"type": "joint_impedance", "joints": ["elbow"]}, "unknown driven joint 'elbow'"),
        ({}, "joint_impedance, cartesian_impedance, force, or module:Class"),
    ],
)
def test_wrong_controller_options_are_reported_with_their_key(build, keys, told):
    with pytest.raises(ConfigError, match=told):
        build(lwr(controllers={"c": keys}))


def test_targets_that_are_wrong_are_refused_and_change_nothing(build):
    world = build(lwr(controllers={"springs": {"type": "joint_impedance"}}))
    start = positions(world)
    for target, told in (
        (JointCommand(["nose"], [0.1]), "'nose' is none of its joints"),
        (JointCommand(JOINTS[:1], [math.nan]), "must be within|finite"),
        (JointCommand(JOINTS[:1], [100.0]), "must be within"),
        (JointCommand(JOINTS[:1], [0.1], effort=[math.inf]), "finite"),
        (JointCommand(JOINTS[:2], [0.1]), ""),
    ):
        with pytest.raises(ValueError, match=told):
            world.put("lwr/springs/target", target)
    run(world, 50)
    assert positions(world) == pytest.approx(start, abs=1e-6)


def test_a_session_with_controllers_is_the_same_again(build):
    controllers = {
        "springs": {"type": "joint_impedance", "joints": JOINTS[:7], "stiffness": 300.0},
        "press": {"type": "force", "link": TIP, "force": 8.0, "active": False},
    }
    floor = {**FLOOR, "changeDynamics": SPONGE}
    robot = lwr(loadURDF={"basePosition": [0.0, 0.0, -0.11]}, controllers=controllers)
    first, second = (build(robot, collision=(floor,)) for _ in range(2))
    config = first.bodies["lwr"].controllers.config("springs")
    for tick in range(900):
        if tick % 20 == 0 and tick < 300:
            first.put("lwr/springs/target", JointCommand(JOINTS[:1], [0.0005 * tick], stamp_ns=1 + tick * 1_000_000))
        if tick == 150:
            softer = type(config).parse({**config.model_dump(exclude_unset=True), "stiffness": 100.0}, "test")
            first.act("lwr", "set_controller_gains", ControllerUpdate("springs", softer))
        if tick == 300:
            first.act("lwr", "switch_controllers", ControllerSwitch(["press"], ["springs"]))
        if tick == 800:
            first.act("lwr", "switch_mode", first.bodies["lwr"].config.setJointMotorControlArray.controlMode)
            first.act("lwr", "switch_controllers", ControllerSwitch([], ["press"]))
        first.step()
    _, commands = first.commands.since(0)
    waiting = [RecordedCommand(each.tick, each.name, each.what, to_text(each.value)) for each in commands]
    assert {each.what for each in waiting} >= {"input", "switch_controllers", "set_controller_gains"}
    for tick in range(900):
        while waiting and waiting[0].tick <= tick:
            apply_command(second, waiting.pop(0))
        second.step()
    assert second.state_hash() == first.state_hash()


def test_a_controller_sees_how_a_floating_base_moves(build):
    thrown = {"linearVelocity": [0.5, 0.0, 2.0], "angularVelocity": [0.0, 1.0, 0.5]}
    world = build(
        lwr(
            loadURDF={"useFixedBase": False, "basePosition": [0.0, 0.0, 3.0]},
            resetBaseVelocity=thrown,
            controllers={"look": wrong("SeesItsBase")},
        )
    )
    run(world, 200)
    seen = world.bodies["lwr"].controllers.of("look").seen
    (before, _), (base, twist), (after, _) = seen[-3:]
    way = (np.array(after.position) - before.position) / 0.002
    assert twist.linear == pytest.approx(way, abs=2e-3)  # between two steps of gravity and rounded positions
    spin = np.array(rotation_between(before.quat_xyzw, after.quat_xyzw)) / 0.002
    assert twist.angular == pytest.approx(spin, abs=2e-2)
    assert np.linalg.norm(twist.linear) > 0.3 and np.linalg.norm(twist.angular) > 0.3


def test_a_fixed_base_has_no_twist(build):
    world = build(lwr(controllers={"look": wrong("SeesItsBase")}))
    run(world, 3)
    assert {twist for _, twist in world.bodies["lwr"].controllers.of("look").seen} == {Twist()}


def test_the_controller_of_the_page_works(build, tmp_path, monkeypatch):
    page = (ROOT / "docs" / "controllers.md").read_text()
    (code,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    (tmp_path / "shaker_of_the_page.py").write_text(code)
    monkeypatch.syspath_prepend(str(tmp_path))
    world = build(lwr(controllers={"shake": {"type": "shaker_of_the_page:Shaker", "amplitude": 3.0}}))
    start = positions(world)
    run(world, 250)
    assert np.abs(positions(world) - start).max() > 0.01
    assert world.bodies["lwr"].controllers.sample("lwr", "shake").active
