"""Plans: found, proven by an independent dense check, timed within limits, and refused with one reason."""

from __future__ import annotations

import importlib
import math
import sys
import time
from pathlib import Path

import numpy as np
import pybullet
import pytest

from custom_ros_tools.errors import InterfaceError, MissingDependency, UnknownNameError
from robot_model.collision.shapes import Obstacle
from robot_model.geometry import Pose, rotated_back
from rpbi_planning import (
    JointGoal,
    NamedGoal,
    OnPlane,
    PlannedTrajectory,
    PlanningScene,
    PoseGoal,
    RegionGoal,
    Upright,
    plan,
)
from rpbi_planning.collision import CollisionModel
from rpbi_planning.constraints import BoundConstraint
from rpbi_planning.group import Group
from rpbi_planning.planning import PlanResult

LWR = Path(__file__).resolve().parents[3] / "src/rpbi_examples/robots/kuka_lwr.urdf"
POSTURE = (-0.7, 0.9, 0.0, -1.0, 0.0, 0.8, 0.0)
"""The arm to the right of the post."""
GOAL = (0.7, *POSTURE[1:])
"""The arm to the left of the post."""
QUICK = {"shorten_s": 0.05, "time_limit_s": 60.0, "certify": False}


@pytest.fixture
def scene() -> PlanningScene:
    """The arm to the right of a post, so that a rotation of the first joint hits the post."""
    made = PlanningScene()
    made.add_robot("arm", str(LWR), positions=POSTURE)
    made.add(Obstacle("post", "box", (0.08, 0.08, 1.2), Pose((-0.6, 0.0, 0.6))))
    return made


@pytest.fixture(scope="module")
def bullet():
    """Counts configurations in which the arm touches the post, by PyBullet alone."""
    client = pybullet.connect(pybullet.DIRECT)
    arm = pybullet.loadURDF(str(LWR), useFixedBase=True, physicsClientId=client)
    shape = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=(0.04, 0.04, 0.6), physicsClientId=client)
    post = pybullet.createMultiBody(0.0, shape, -1, (-0.6, 0.0, 0.6), physicsClientId=client)
    moving = [i for i in range(pybullet.getNumJoints(arm, client)) if pybullet.getJointInfo(arm, i, client)[2] == 0]

    def hits(curve: np.ndarray) -> int:
        count = 0
        for q in curve:
            for joint, position in zip(moving, q):
                pybullet.resetJointState(arm, joint, position, physicsClientId=client)
            count += bool(pybullet.getClosestPoints(arm, post, 0.0, physicsClientId=client))
        return count

    yield hits
    pybullet.disconnect(client)


def straight(count: int = 500) -> np.ndarray:
    return POSTURE + np.linspace(0.0, 1.0, count)[:, None] * np.subtract(GOAL, POSTURE)


def dense(trajectory: PlannedTrajectory) -> np.ndarray:
    return trajectory.at(np.linspace(0.0, trajectory.duration_s, 2000))


def check_limits(group: Group, trajectory: PlannedTrajectory) -> None:
    assert (np.abs(trajectory.velocities) <= group.velocity).all()
    assert (np.abs(trajectory.accelerations) <= group.acceleration).all()
    assert (np.abs(trajectory.jerks) <= group.jerk).all()


@pytest.mark.parametrize(
    "planner",
    [
        "rrt_connect",
        pytest.param("aorrtc", marks=pytest.mark.thorough),
        pytest.param("bit_star", marks=pytest.mark.thorough),
        "prm",
        "projected",
    ],
)
def test_planners_find_free_timed_motions(scene, bullet, planner):
    limit = {"time_limit_s": 6.0} if planner in ("aorrtc", "bit_star") else {}
    result = plan(scene, "arm", JointGoal(GOAL), planner=planner, seed=3, **(QUICK | limit))
    assert result.success, result.message
    trajectory = result.trajectory
    assert trajectory is not None and bullet(dense(trajectory)) == 0
    assert np.allclose(trajectory.at(0.0), POSTURE) and np.allclose(trajectory.at(trajectory.duration_s), GOAL)
    check_limits(Group(scene, ["arm"]), trajectory)


def test_oracle_finds_hits_of_the_straight_motion(scene, bullet):
    assert bullet(straight()) > 0
    model = CollisionModel(scene, Group(scene, ["arm"]))
    assert model.is_free(np.array(POSTURE)) and model.is_free(np.array(GOAL))
    assert not model.edge(np.array(POSTURE), np.array(GOAL))


def test_thin_obstacle_between_samples_is_found(scene):
    scene.add(Obstacle("post", "box", (0.001, 0.001, 1.2), Pose((-0.6, 0.0, 0.6))))
    scene.padding_m = 0.0
    model = CollisionModel(scene, Group(scene, ["arm"]))
    assert model.is_free(straight()[100]) and not model.edge(np.array(POSTURE), np.array(GOAL))


def test_free_motion_is_proven(scene):
    scene.remove("post")
    result = plan(scene, "arm", JointGoal(GOAL), **QUICK)
    assert result.success and result.planner == "straight" and len(result.path) == 2


def test_pose_goal_is_reached(scene):
    there = scene.link_pose("arm", "end_effector_ball", GOAL)
    result = plan(scene, "arm", PoseGoal("end_effector_ball", there), **QUICK)
    assert result.success, result.message
    pose = scene.link_pose("arm", "end_effector_ball", result.path[-1])
    assert math.dist(pose.position, there.position) < 2e-3


def test_region_goal_is_reached(scene):
    there = scene.link_pose("arm", "end_effector_ball", GOAL)
    goal = RegionGoal("end_effector_ball", Pose(there.position), (0.1, 0.1, 0.1))
    result = plan(scene, "arm", goal, **QUICK)
    assert result.success, result.message
    reached = scene.link_pose("arm", "end_effector_ball", result.path[-1]).position
    assert np.abs(np.subtract(reached, there.position)).max() < 0.052


def test_named_goal_and_group(scene):
    scene.set_positions("arm", {"lwr_arm_6_joint": 0.5})
    result = plan(scene, "arm", NamedGoal("start"), group=["lwr_arm_6_joint"], **QUICK)
    assert result.success and result.joint_names == ("lwr_arm_6_joint",)
    assert result.path[-1] == pytest.approx([0.0])


@pytest.mark.parametrize("constraint", [Upright, pytest.param(OnPlane, marks=pytest.mark.thorough)])
def test_constraint_is_kept_on_the_whole_curve(scene, constraint):
    scene.remove("post")
    scene.add(Obstacle("post", "box", (0.08, 0.08, 0.5), Pose((-0.6, 0.0, 0.25))))
    link, pose = "end_effector_ball", scene.link_pose("arm", "end_effector_ball")
    if constraint is Upright:
        kept = Upright(link, axis=rotated_back(pose.quat_xyzw, (0.0, 0.0, 1.0)), tolerance=0.3)
    else:
        kept = OnPlane(link, origin=pose.position, tolerance=0.05)
    group = Group(scene, ["arm"])
    bound = BoundConstraint(kept, group)
    result = plan(scene, "arm", JointGoal(GOAL), constraints=[kept], **QUICK)
    assert result.success, result.message
    assert result.trajectory is not None
    assert bound.margins(dense(result.trajectory)).min() >= -1e-9
    free = plan(scene, "arm", JointGoal(GOAL), seed=2, **QUICK).trajectory
    assert free is not None and (result.planner == "straight" or bound.margins(dense(free)).min() < 0.0)


def test_constraint_reach_bounds_the_change():
    scene = PlanningScene()
    scene.add_robot("arm", str(LWR), positions=POSTURE)
    group, random = Group(scene, ["arm"]), np.random.default_rng(5)
    for constraint in (Upright("end_effector_ball"), OnPlane("end_effector_ball", point=(0.1, 0.0, 0.2))):
        bound = BoundConstraint(constraint, group)
        q = random.uniform(group.lower, group.upper, (300, 7))
        step = random.uniform(-0.1, 0.1, (300, 7))
        change = np.abs(bound.margins(q + step) - bound.margins(q))
        assert (change <= np.abs(step) @ bound.reach + 1e-9).all()


def test_held_body_is_kept_off_obstacles(scene):
    pose = scene.link_pose("arm", "end_effector_ball")
    scene.add(Obstacle("rod", "box", (0.03, 0.03, 0.3), Pose(pose.position, pose.quat_xyzw)))
    with_rod = scene.bodies["rod"]
    scene.attach("rod", "arm", "end_effector_ball", ["end_effector_ball", "lwr_arm_7_link", "lwr_arm_6_link"])
    result = plan(scene, "arm", JointGoal(GOAL), **QUICK)
    assert result.success, result.message
    assert result.trajectory is not None and with_rod
    free = PlanningScene(0.0, 0.0)
    free.add_robot("arm", str(LWR), positions=POSTURE)
    free.add(scene.bodies["post"], "post", scene.poses["post"])
    free.add(with_rod, "rod", pose)
    model = CollisionModel(scene, Group(scene, ["arm"]))
    assert all(model.is_free(q) for q in dense(result.trajectory)[::20])


def test_certified_plan_passes_the_guard(scene):
    from rpbi_planning.certify import PERIOD_S, guard_of
    from safe_robot.check import CheckContext

    result = plan(scene, "arm", JointGoal(GOAL), shorten_s=0.1, time_limit_s=60.0)
    assert result.success, result.message
    guard, context = guard_of(scene, scene.robots["arm"]), CheckContext(obstacles=scene.obstacles_for("arm"))
    guard.start()
    assert result.trajectory is not None
    assert not [q for q in result.trajectory.sampled(PERIOD_S) if guard.decide(tuple(q), context).violation]
    guard = guard_of(scene, scene.robots["arm"])
    guard.start()
    assert [q for q in straight(100) if guard.decide(tuple(q), context).violation]  # the straight motion is refused


def refused(scene: PlanningScene, goal, **options) -> PlanResult:
    result = plan(scene, "arm", goal, **(QUICK | options))
    assert not result.success and result.trajectory is None and len(result.path) == 0
    assert "\n" not in result.message
    return result


def test_start_in_collision_names_pair_depth_and_way_out(scene):
    scene.set_positions("arm", straight()[250])
    message = refused(scene, JointGoal(GOAL)).message
    assert "the start is in collision" in message and "'post'" in message and " mm" in message
    assert "leads out" in message or "no motion" in message


def test_goal_in_collision_is_named(scene):
    assert "'post'" in refused(scene, JointGoal(straight()[250])).message


def test_goal_out_of_reach_is_named(scene):
    assert "beyond the reach" in refused(scene, PoseGoal("end_effector_ball", Pose((3.0, 0.0, 0.0)))).message


def test_goal_outside_limits_is_named(scene):
    assert "outside its limits" in refused(scene, JointGoal({"lwr_arm_1_joint": 5.0})).message


def test_violated_constraint_at_the_start_is_named(scene):
    constraints = [Upright("end_effector_ball", direction=(1.0, 0.0, 0.0), tolerance=0.01)]
    assert "constraint" in refused(scene, JointGoal(GOAL), constraints=constraints).message


def test_cancelled_plan_ends_at_once(scene):
    assert refused(scene, JointGoal(GOAL), is_cancelled=lambda: True).message == "cancelled"


def test_enclosed_goal_ends_at_the_time_limit(scene):
    scene.add(Obstacle("wall", "box", (0.05, 4.0, 4.0), Pose((0.0, 0.9, 0.0))))
    goal = JointGoal((2.2, 0.3, 0.0, -0.3, 0.0, 0.0, 0.0))
    begin = time.monotonic()
    result = plan(scene, "arm", goal, **(QUICK | {"time_limit_s": 0.5}))
    assert time.monotonic() - begin < 60.0
    assert result.success or "time limit" in result.message or "collision" in result.message


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"time_limit_s": 0.0}, "time_limit_s"),
        ({"time_limit_s": math.nan}, "time_limit_s"),
        ({"shorten_s": -1.0}, "shorten_s"),
        ({"speed": 2.0}, "speed"),
        ({"start": [0.0]}, "start: expected 7"),
        ({"start": {"lwr_arm_1_joint": math.inf}}, "finite"),
        ({"group": []}, "at least one joint"),
    ],
)
def test_invalid_request_is_an_error(scene, options, words):
    with pytest.raises(ValueError, match=words):
        plan(scene, "arm", JointGoal(GOAL), **options)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("leg", JointGoal(GOAL)), "leg"),
        (("arm", JointGoal({"knee": 0.0})), "knee"),
        (("arm", NamedGoal("home")), "home"),
        (("arm", PoseGoal("foot", Pose())), "foot"),
    ],
)
def test_unknown_name_is_an_error(scene, arguments, words):
    with pytest.raises(UnknownNameError, match=words):
        plan(scene, *arguments)


def test_scene_without_robot_is_an_error():
    with pytest.raises(InterfaceError, match="scene without robots"):
        plan(PlanningScene(), "arm", JointGoal(GOAL))


def test_robot_of_sixty_joints_needs_a_group(tmp_path):
    links = "".join(f'<link name="l{i}"/>' for i in range(61))
    joint = (
        '<joint name="j{0}" type="revolute"><parent link="l{0}"/><child link="l{1}"/>'
        '<origin xyz="0 0 0.02"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint>'
    )
    path = tmp_path / "snake.urdf"
    path.write_text(f'<robot name="snake">{links}{"".join(joint.format(i, i + 1) for i in range(60))}</robot>')
    scene = PlanningScene()
    scene.add_robot("snake", str(path))
    with pytest.raises(ValueError, match="group: expected at most 40 joints, got 60"):
        plan(scene, "snake", JointGoal({"j0": 0.5}))
    assert plan(scene, "snake", JointGoal({"j0": 0.5}), group=["j0", "j1"], **QUICK).success


def test_large_mesh_is_refused(tmp_path, scene):
    path = tmp_path / "large.stl"
    with path.open("wb") as file:
        file.truncate(84 + 50 * 1_000_000)
    with pytest.raises(ValueError, match="reduce its triangles"):
        scene.add(Obstacle("statue", "mesh", (1.0, 1.0, 1.0), mesh_file=str(path)))


def test_equal_seeds_give_equal_paths(scene):
    first, second = (
        plan(scene, "arm", JointGoal(GOAL), planner="projected", seed=4, **(QUICK | {"shorten_s": 60.0})).path
        for _ in range(2)
    )
    assert len(first) > 2 and (first == second).all()


def test_missing_library_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "ompl", None)
    monkeypatch.delitem(sys.modules, "rpbi_planning.planners.ompl_planner", raising=False)
    with pytest.raises(MissingDependency, match=r"\./rpbi setup planning"):
        importlib.import_module("rpbi_planning.planners.ompl_planner")
