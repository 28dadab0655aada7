"""Every check, held to the conformance suite; and what is its own."""

from __future__ import annotations

import numpy as np
import pytest
from guarded_arm import HOME, KUKA, LIMITS, folding, slider

from custom_ros_tools.errors import ConfigError
from robot_model.collision.shapes import Obstacle
from robot_model.geometry import Pose
from robot_model.model import RobotModel
from rpbi.kinematics import Kinematics
from safe_robot.braking import Brake
from safe_robot.check import CheckContext
from safe_robot.checks import CHECKS, make_checks
from safe_robot.conformance import CheckConformance
from safe_robot.limits import LimitsConfig, MotionLimits
from safe_robot.motion import CommandedMotion, State

FOLDED = (1.8, 1.72, 0.97, -2.05, -0.24, 2.09, 0.1)
"""The ball of the arm's tool is in its shoulder."""


class Arm(CheckConformance):
    """From rest at home; `step` is how far the command goes."""

    urdf = KUKA
    limits = LIMITS
    safe_step = 1e-6
    unsafe_step = 0.02

    def by(self, step: float, q=HOME):
        return self.motion(State.at_rest(np.array(q)), np.array(q) + step), CheckContext()

    def safe(self):
        return self.by(self.safe_step)

    def unsafe(self):
        return self.by(self.unsafe_step)


class TestJointPosition(Arm):
    check_name = "joint_position"

    def unsafe(self):
        return self.by(0.01, (0.0, 0.5, 0.0, -1.2, 0.0, 2.09, 0.0))


class TestJointVelocity(Arm):
    check_name = "joint_velocity"


class TestJointAcceleration(Arm):
    check_name = "joint_acceleration"


class TestJointJerk(Arm):
    check_name = "joint_jerk"


class TestLinkBox(Arm):
    check_name = "link_box"
    options = {"boxes": {"lwr_arm_7_link": {"x": [-0.7, None], "z": [0.1, None]}}}

    def unsafe(self):
        return self.motion(State.at_rest(np.array(HOME)), (0.0, 1.5, 0.0, 0.0, 0.0, 0.0, 0.0)), CheckContext()


class TestLinkVelocity(Arm):
    check_name = "link_velocity"
    options = {"links": {"lwr_arm_7_link": 0.25}}


class TestSelfCollision(Arm):
    check_name = "self_collision"

    def unsafe(self):
        return self.motion(State.at_rest(np.array(HOME)), FOLDED), CheckContext()


TABLE = Obstacle("table", "box", (1.0, 1.0, 0.1), Pose((0.7, 0.0, 0.0)))


class TestEnvironment(Arm):
    check_name = "environment"

    def by(self, step: float, q=HOME):
        motion, context = super().by(step, q)
        return motion, context._replace(obstacles=(TABLE,))

    def unsafe(self):
        motion = self.motion(State.at_rest(np.array(HOME)), (0.0, -2.0, 0.0, 0.0, 0.0, 0.0, 0.0))
        return motion, CheckContext(obstacles=(TABLE,))


class TestStaleness(Arm):
    check_name = "staleness"
    is_about_motion = False

    def unsafe(self):
        motion, _ = self.safe()
        return motion, CheckContext(age_s=0.2)


class TestTracking(Arm):
    check_name = "tracking"
    is_about_motion = False

    def measured(self, error: float):
        motion, _ = self.by(0.0)
        names = RobotModel(KUKA).joint_names
        return motion, CheckContext(measured={name: q + error for name, q in zip(names, HOME)})

    def safe(self):
        return self.measured(0.01)

    def unsafe(self):
        return self.measured(-0.2)


class TestForce(Arm):
    check_name = "force"
    is_about_motion = False

    def feels(self, *wrench: float):
        return self.by(0.0)[0], CheckContext(wrench=wrench, wrench_age_s=0.0)

    def safe(self):
        return self.feels(30.0, 30.0, 0.0, 0.0, 5.0, 5.0)

    def unsafe(self):
        return self.feels(40.0, 40.0, 0.0, 0.0, 0.0, 0.0)


def test_every_check_is_held_to_the_conformance_suite():
    held = {each.check_name for each in Arm.__subclasses__()}
    missing = set(CHECKS) - held
    assert held == set(CHECKS), f"add a class to this file that derives from Arm, for: {sorted(missing)}"


def check_of(name: str, guarded: RobotModel, limits: dict | None = None, /, **options):
    joint_limits = MotionLimits.of(guarded, LimitsConfig(**(limits or {})), "guard.yaml")
    return next(c for c in make_checks({name: options}, guarded, joint_limits, "guard.yaml") if c.name == name)


@pytest.mark.parametrize("bad", ["nan", "inf", "-inf"])
def test_non_finite_measured_force_is_too_large(bad):
    check = check_of("force", RobotModel(KUKA))
    motion = CommandedMotion(check.robot, State.at_rest(np.array(HOME)), np.array(HOME), 0.01)
    assert check.check(motion, CheckContext(wrench=(float(bad), 0.0, 0.0, 0.0, 0.0, 0.0), wrench_age_s=0.0)) is not None


def test_tracking_accepts_the_expected_lag_and_rejects_a_stalled_robot(tmp_path):
    robot = slider(tmp_path)
    check = check_of("tracking", robot, tolerance=0.05, lag_s=0.1)
    start = State(np.array((0.5, 0.0)), np.array((0.8, 0.0)), np.zeros(2))
    motion = CommandedMotion(robot, start, start.position + 0.01 * start.velocity, 0.01)
    assert check.check(motion, CheckContext(measured={"slide": 0.42, "turn": 0.0})) is None
    violation = check.check(motion, CheckContext(measured={"slide": 0.36, "turn": 0.0}))
    assert str(violation) == "tracking: joint 'slide': error is 0.06 m, limit 0.05 m"
    assert check.check(motion, CheckContext(measured={"slide": 0.5, "turn": 0.0})) is not None


@pytest.mark.quick
@pytest.mark.parametrize("name", ["force", "tracking"])
def test_without_a_measurement_nothing_is_safe(name):
    check = check_of(name, RobotModel(KUKA))
    motion = CommandedMotion(check.robot, State.at_rest(np.array(HOME)), np.array(HOME), 0.01)
    violation = check.check(motion, CheckContext())
    assert violation is not None and "age" in violation.subject


def test_origins_of_links_are_those_of_pybullet(tmp_path):
    generator = np.random.default_rng(3)
    for robot, link in ((RobotModel(KUKA), "lwr_arm_7_link"), (slider(tmp_path), "hand")):
        q = generator.uniform(-1.0, 1.0, (20, len(robot.joint_names)))
        kinematics = Kinematics(robot.urdf_path)
        assert kinematics.joint_names == robot.joint_names
        expected = [kinematics.forward(row.tolist(), link).position for row in q]
        np.testing.assert_allclose(robot.frames.positions(q, link), expected, atol=1e-6)


def test_a_link_box_reaches_where_the_link_is(tmp_path):
    robot = slider(tmp_path)
    check = check_of("link_box", robot, boxes={"hand": {"x": [-0.5, 0.5]}})
    start = State.at_rest(np.array((0.499, 0.0)))
    assert check.check(CommandedMotion(robot, start, np.array((0.4999, 0.0)), 0.01), CheckContext()) is None
    violation = check.check(CommandedMotion(robot, start, np.array((0.5001, 0.0)), 0.01), CheckContext())
    assert (violation.subject, violation.limit) == ("x of link 'hand'", 0.5)
    assert violation.value == pytest.approx(0.5001)


def test_link_speed_is_that_of_its_origin(tmp_path):
    robot = slider(tmp_path)
    check = check_of("link_velocity", robot, links={"hand": 0.25})
    for speed, is_safe in ((0.249, True), (0.251, False)):
        motion = CommandedMotion(robot, State.at_rest(np.zeros(2)), np.array((0.01 * speed, 0.0)), 0.01)
        violation = check.check(motion, CheckContext())
        assert (violation is None) == is_safe
    assert violation.value == pytest.approx(0.251) and violation.limit == 0.25


@pytest.mark.parametrize("name", ["link_box", "link_velocity"])
def test_bound_by_reach_skips_computation_without_changing_the_result(name):
    robot, link, generator, safe = RobotModel(KUKA), "lwr_arm_7_link", np.random.default_rng(5), 0
    low, high, most = np.array((-0.66, -0.04, 0.52)), np.array((-0.59, 0.04, 0.58)), 0.3
    boxes = {link: dict(zip("xyz", np.stack((low, high), axis=1).tolist()))}
    check = check_of(name, robot, **({"boxes": boxes} if name == "link_box" else {"links": {link: most}}))
    q = np.array(HOME)
    for _ in range(400):
        command = HOME + 0.9 * (q - HOME) + generator.uniform(-1.0, 1.0, 7) * generator.choice((0.002, 0.05))
        before, place = robot.frames.positions(np.stack((q, command)), link)
        is_inside = bool(((place >= np.minimum(low, before)) & (place <= np.maximum(high, before))).all())
        is_safe = is_inside if name == "link_box" else bool(np.linalg.norm(place - before) <= most * 0.05)
        motion = CommandedMotion(robot, State.at_rest(q), command, 0.05)
        assert (check.check(motion, CheckContext()) is None) == is_safe
        safe, q = safe + is_safe, command
    assert 100 < safe < 300


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_link_outside_its_box_may_only_move_inwards(tmp_path, side):
    robot = slider(tmp_path)
    check = check_of("link_box", robot, boxes={"hand": {"x": [-0.5, 0.5]}})
    start = State.at_rest(np.array((side * 0.7, 0.0)))
    for after, is_safe in ((0.69, True), (0.71, False)):
        violation = check.check(CommandedMotion(robot, start, np.array((side * after, 0.0)), 0.01), CheckContext())
        assert (violation is None) == is_safe


@pytest.mark.quick
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_joint_stays_within_limits_and_moves_only_inwards_outside(tmp_path, side):
    robot = slider(tmp_path)
    check = check_of("joint_position", robot)
    for before, after, is_safe in ((0.99, 1.0, True), (0.99, 1.01, False), (1.2, 1.19, True), (1.2, 1.21, False)):
        start = State.at_rest(np.array((side * before, 0.0)))
        violation = check.check(CommandedMotion(robot, start, np.array((side * after, 0.0)), 0.01), CheckContext())
        assert (violation is None) == is_safe, (before, after)
        assert is_safe or (violation.value, violation.limit) == (side * after, side)


@pytest.mark.parametrize("name", ["joint_velocity", "joint_acceleration", "joint_jerk"])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_both_directions_have_limits(tmp_path, name, side):
    robot = slider(tmp_path)
    check = check_of(name, robot, LIMITS)
    start = State.at_rest(np.zeros(2))
    for step, is_safe in ((1e-5, True), (0.02, False)):
        violation = check.check(CommandedMotion(robot, start, np.array((0.0, side * step)), 0.01), CheckContext())
        assert (violation is None) == is_safe
    assert violation.subject == "joint 'turn'" and violation.value > violation.limit


def test_the_middle_of_a_braking_is_tried_too(tmp_path):
    """Command and end are free, and the way between them goes through the base."""
    robot = folding(tmp_path)
    check = check_of("self_collision", robot)
    there_and_back = np.sin(np.linspace(0.0, np.pi, 100))[:, None] * (0.0, 1.0)
    brake = Brake(there_and_back, *(np.zeros((100, 2)),) * 3)
    q = np.array((0.0, 2.0))
    assert check.check(CommandedMotion(robot, State.at_rest(q), q, 0.01), CheckContext()) is None
    violation = check.check(CommandedMotion(robot, State.at_rest(q), q, 0.01, brake), CheckContext())
    assert violation is not None and violation.is_while_braking


@pytest.mark.quick
def test_links_that_are_too_near_may_only_move_apart():
    check = check_of("self_collision", RobotModel(KUKA))
    generator = np.random.default_rng(4)
    q = np.array(FOLDED)
    pair = check.check(CommandedMotion(check.robot, State.at_rest(np.array(HOME)), q, 0.01), CheckContext()).subject
    tried = [q + generator.normal(0.0, 0.02, 7) for _ in range(40)]
    motions = [CommandedMotion(check.robot, State.at_rest(q), each, 0.01) for each in tried]
    answers = [check.check(each, CheckContext()) for each in motions]
    check.distances.place(q)
    before = {each: check.distances.distance(each, 0.01) for each in check.pairs}
    for each, answer in zip(tried, answers):
        check.distances.place(each)
        nearer = [p for p in check.pairs if check.distances.distance(p, 0.01) < min(before[p], 0.01) - 1e-8]
        assert bool(nearer) == (answer is not None)
    assert None in answers and pair and any(answers)


def test_distances_that_are_remembered_change_no_answer():
    robot = RobotModel(KUKA)
    check = check_of("self_collision", robot)
    generator = np.random.default_rng(5)
    q = np.array(HOME)
    for _ in range(300):
        step = np.clip(q + generator.normal(0.0, 0.05, 7), -2.0, 2.0)
        motion = CommandedMotion(robot, State.at_rest(q), step, 0.01)
        remembered = check.check(motion, CheckContext())
        check.proximity.forget(range(len(check.pairs)))
        assert check.check(motion, CheckContext()) == remembered
        q = q if remembered else step


BALL = Obstacle("ball", "sphere", (0.2, 0.2, 0.2), Pose((0.0, 0.0, 1.0)))
FURTHER = np.array((0.0, 1e-4))


def stretched(tmp_path, q=(0.0, 0.0), step=FURTHER):
    """Two boxes along x, from the middle of the base to x = 0.85."""
    robot = folding(tmp_path)
    return check_of("environment", robot), CommandedMotion(robot, State.at_rest(np.array(q)), np.array(q) + step, 0.01)


@pytest.mark.quick
@pytest.mark.parametrize(
    "obstacle",
    [
        Obstacle("it", "box", (0.2, 0.2, 0.2)),
        Obstacle("it", "sphere", (0.2, 0.2, 0.2)),
        Obstacle("it", "cylinder", (0.2, 0.2, 0.2)),
        Obstacle("it", "capsule", (0.2, 0.2, 0.2)),
        Obstacle("it", "points", (1.0, 1.0, 1.0), corners=((-0.1, 0.0, 0.0), (0.1, 0.1, 0.0), (0.0, -0.1, 0.1))),
    ],
    ids=lambda obstacle: obstacle.kind,
)
def test_any_shape_is_kept_away_from(tmp_path, obstacle):
    for x, is_safe in ((0.965, False), (0.972, True)):  # 0.85 of the arm, 0.1 of the obstacle, 0.02 between them
        check, motion = stretched(tmp_path, step=np.array((0.0, 0.0)))
        away = CommandedMotion(check.robot, State.at_rest(np.array((1.0, 0.0))), np.zeros(2), 0.01)
        there = obstacle._replace(pose=Pose((x, 0.0, 0.0)))
        violation = check.check(away, CheckContext(obstacles=(there,)))
        assert (violation is None) == is_safe
        assert check.check(motion, CheckContext(obstacles=(there,))) is None, "what stands comes no nearer"
    assert check.check(away, CheckContext(obstacles=(there,))) is None
    assert check.check(away, CheckContext(obstacles=())) is None


def test_obstacles_may_appear_disappear_and_move(tmp_path):
    check, motion = stretched(tmp_path)
    near, far = (BALL._replace(pose=Pose((0.6, y, 0.0))) for y in (0.14, 0.3))
    for obstacles, is_safe in (((), True), ((near,), False), ((far,), True), ((far, near), False), ((far, BALL), True)):
        assert (check.check(motion, CheckContext(obstacles=obstacles)) is None) == is_safe, obstacles
    back = CommandedMotion(check.robot, motion.start, motion.start.position - FURTHER, 0.01)
    assert check.check(back, CheckContext(obstacles=(near,))) is None, "away from what came near it may go"
    nowhere = BALL._replace(pose=Pose((np.nan, 0.0, 0.0)))
    with pytest.raises(ValueError, match="obstacle 'ball': expected finite numbers"):
        check.check(motion, CheckContext(obstacles=(nowhere,)))


RAIL = """<robot name="rail"><link name="base"/>
  <link name="cart"><collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision></link>
  <joint name="slide" type="prismatic"><parent link="base"/><child link="cart"/><axis xyz="1 0 0"/>
    <limit lower="-1" upper="1" effort="1" velocity="2"/></joint>
</robot>"""


def test_joint_motion_since_the_last_distance_query_counts(tmp_path):
    path = tmp_path / "rail.urdf"
    path.write_text(RAIL)
    check = check_of("environment", RobotModel(str(path)))
    around = CheckContext(obstacles=(BALL._replace(pose=Pose((0.6, 0.0, 0.0))),))  # 0.4 m away
    still, there, too_far = (np.linspace(0.0, brake_m, 40) for brake_m in (0.0, 0.32, 0.36))
    too_far_and_back = np.concatenate((np.linspace(0.0, 0.41, 40), np.linspace(0.41, 0.0, 40)))
    motions = ((0.0, still, True), (0.0, too_far_and_back, False), (0.05, there, True), (0.05, too_far, False))
    for x, way, is_safe in motions:
        check.check(
            CommandedMotion(check.robot, State.at_rest(np.zeros(1)), np.zeros(1), 0.01), around
        )  # distances are known
        start = State.at_rest(np.array((x,)))
        brake = Brake(way[:, None], *(np.zeros((len(way), 1)),) * 3)
        violation = check.check(CommandedMotion(check.robot, start, start.position, 0.01, brake), around)
        assert (violation is None) == is_safe, way.max()


def test_position_factor_shrinks_the_range_equally_from_both_ends(tmp_path):
    limits = MotionLimits.of(slider(tmp_path), LimitsConfig(position_factor=0.5), "guard.yaml")
    assert limits.lower.tolist() == [-0.5, -1.0] and limits.upper.tolist() == [0.5, 1.0]


def test_environment_check_without_a_source_of_obstacles_is_unsafe(tmp_path):
    check, motion = stretched(tmp_path)
    assert "no source of bodies around" in str(check.check(motion, CheckContext()))


BOX = """
name: box
createVisualShape: {shapeType: GEOM_BOX, halfExtents: [0.1, 0.1, 0.1]}
createCollisionShape: {shapeType: GEOM_BOX, halfExtents: [0.1, 0.1, 0.1]}
basePosition: [2.4, 0.5, 0.0]
"""
WALL = """
name: wall
createVisualShape: {shapeType: GEOM_PLANE}
createCollisionShape: {shapeType: GEOM_PLANE, planeNormal: [1, 0, 0]}
"""
ROBOT = """
name: arm
loadURDF: {fileName: folding.urdf, basePosition: [2.0, 0.0, 0.0], useFixedBase: true}
setJointMotorControlArray: {controlMode: POSITION_CONTROL}
"""


def world_of(folder) -> str:
    """Returns the file of a world with the folding robot, a box beside it and a wall behind it."""
    for name, text in (("box", BOX), ("wall", WALL), ("arm", ROBOT)):
        (folder / f"{name}.yaml").write_text(text)
    path = folder / "world.yaml"
    path.write_text(
        "{connect: {connection_mode: DIRECT}, collision_objects: [box.yaml, wall.yaml], robots: [arm.yaml]}"
    )
    return str(path)


def test_world_file_gives_obstacles_in_the_robots_root_frame(tmp_path):
    robot = folding(tmp_path)
    check = check_of("environment", robot, world=world_of(tmp_path))
    box, wall = check._obstacles
    assert (box.name, box.kind, box.size) == ("box", "box", (0.2, 0.2, 0.2))
    assert box.pose.position == pytest.approx((0.4, 0.5, 0.0)) and wall.kind == "plane"
    turned = CommandedMotion(robot, State.at_rest(np.array((0.0, 0.0))), np.array((0.0, 1.5)), 0.01)
    assert check.check(turned, CheckContext()).subject == "link 'lower' and 'box'"
    live = CheckContext(obstacles=(BALL._replace(pose=Pose((0.6, 0.12, 0.0))),))
    assert check.check(turned, live).subject == "link 'lower' and 'box'"
    assert check.check(CommandedMotion(robot, turned.start, FURTHER, 0.01), live).subject == "link 'lower' and 'ball'"
    check.distances.place(np.zeros(2))
    assert check.distances.distance(("lower", 1), 5.0) == pytest.approx(2.45, abs=1e-3)


@pytest.mark.parametrize(
    "options, message",
    [
        ({"robot": "amr"}, "world.yaml: unknown robot 'amr'.*did you mean 'arm'"),
        ({"world": "none.yaml"}, "none.yaml"),
    ],
)
def test_a_world_that_cannot_be_taken_is_named(tmp_path, options, message):
    robot, world = folding(tmp_path), world_of(tmp_path)
    with pytest.raises(ConfigError, match=message):
        check_of("environment", robot, **{"world": world, **options})


def test_pairs_can_be_read_changed_and_read_again(tmp_path):
    path = tmp_path / "pairs.yaml"
    first = check_of("self_collision", RobotModel(KUKA), pairs_file=str(path))
    assert "[lwr_arm_0_link, lwr_arm_7_link]" in path.read_text()
    path.write_text("pairs:\n- [lwr_arm_0_link, lwr_arm_7_link]\n")
    assert check_of("self_collision", RobotModel(KUKA), pairs_file=str(path)).pairs == [
        ("lwr_arm_0_link", "lwr_arm_7_link")
    ]
    assert ("lwr_arm_0_link", "lwr_arm_7_link") in first.pairs
    assert ("lwr_arm_0_link", "lwr_arm_1_link") not in first.pairs
    path.write_text("pairs:\n- [lwr_arm_0_link, lwr_arm_0_link]\n")
    with pytest.raises(ConfigError, match=r"pairs.yaml: pairs: expected two links, got 'lwr_arm_0_link' twice"):
        check_of("self_collision", RobotModel(KUKA), pairs_file=str(path))
    with pytest.raises(ConfigError, match="checks.self_collision.pairs_file: expected a file that can be written"):
        check_of("self_collision", RobotModel(KUKA), pairs_file=str(tmp_path / "nowhere" / "pairs.yaml"))


def test_srdf_disables_pairs_and_that_of_another_robot_is_refused(tmp_path):
    path = tmp_path / "arm.srdf"
    path.write_text('<robot name="a"><disable_collisions link1="lwr_arm_7_link" link2="lwr_arm_0_link"/></robot>')
    pairs = check_of("self_collision", RobotModel(KUKA), srdf=str(path)).pairs
    assert ("lwr_arm_0_link", "lwr_arm_7_link") not in pairs and ("lwr_arm_0_link", "lwr_arm_6_link") in pairs
    path.write_text('<robot name="b"><disable_collisions link1="panda_link7" link2="panda_link0"/></robot>')
    with pytest.raises(ConfigError, match=r"arm.srdf: panda_link0: expected a link of .*kuka_lwr.urdf"):
        check_of("self_collision", RobotModel(KUKA), srdf=str(path))
    path.write_text('<robot name="b"><group name="arm"/></robot>')
    with pytest.raises(ConfigError, match=r"arm.srdf: expected pairs of links .* as disable_collisions, got none"):
        check_of("self_collision", RobotModel(KUKA), srdf=str(path))


UNKNOWN = [("link_box", {"boxes": {"hnd": {}}}), ("link_velocity", {"links": {"hnd": 1.0}})]


@pytest.mark.parametrize("name, options", UNKNOWN)
def test_an_unknown_link_is_named_with_the_key(tmp_path, name, options):
    key = next(iter(options))
    expected = f"guard.yaml: checks.{name}.{key}.hnd: unknown link 'hnd'.*did you mean 'hand'"
    with pytest.raises(ConfigError, match=expected):
        check_of(name, slider(tmp_path), **options)


def test_reversed_box_is_refused(tmp_path):
    with pytest.raises(ConfigError, match=r"checks.link_box.boxes.hand.x: expected the least value first"):
        check_of("link_box", slider(tmp_path), boxes={"hand": {"x": [1.0, -1.0]}})


def test_stamps_must_not_decrease_and_moving_robot_needs_targets():
    check = check_of("staleness", RobotModel(KUKA))
    still = CommandedMotion(check.robot, State.at_rest(np.array(HOME)), np.array(HOME), 0.01)
    moving = State(np.array(HOME), np.full(7, 0.1), np.zeros(7))
    assert check.check(still, CheckContext(stamp_step_s=0.01, since_command_s=60.0)) is None
    assert check.check(still, CheckContext(stamp_step_s=0.0)) is None
    for step_s in (-0.01, float("nan")):
        assert check.check(still, CheckContext(stamp_step_s=step_s)) is not None
    goes_on = CommandedMotion(check.robot, moving, np.array(HOME), 0.01)
    assert check.check(goes_on, CheckContext(since_command_s=0.05)) is None
    assert check.check(goes_on, CheckContext(since_command_s=0.15)) is not None
    assert check.check(still, CheckContext(age_s=-0.2)) is not None
