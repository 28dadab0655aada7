"""The solver `trajectory`: whole motions through waypoints."""

from __future__ import annotations

import gc
import math
import random
import re
from pathlib import Path
from typing import Any

import casadi
import numpy as np
import pybullet_data
import pytest
from scipy.spatial.transform import Rotation
from tree_robot import TREE

from custom_ros_tools.errors import ConfigError, UnknownNameError
from ik_ros.chain.symbolic import link_frames, rotation_vector
from ik_ros.chain.trajectory_program import Program, Spline
from ik_ros.lookup import make_solver
from ik_ros.problem import IKProblem, IKSolution, SampledTrajectory, Waypoint
from ik_ros.solvers.trajectory import KEPT_PROGRAMS, TrajectorySolver
from robot_model.geometry import Pose
from rpbi.kinematics import Kinematics

DATA = Path(pybullet_data.getDataPath())
IIWA = str(DATA / "kuka_iiwa/model.urdf")
TIP = "lbr_iiwa_link_7"
ENDS = {"urdf_filename": IIWA, "base_link": "lbr_iiwa_link_0", "tip_link": TIP}
JOINTS = [f"lbr_iiwa_joint_{i}" for i in range(1, 8)]
BENT = (0.0, 0.5, 0.0, -1.2, 0.0, 0.8, 0.0)
OBSTACLES = [
    {"name": "hand", "link": TIP, "sphere": 0.08},
    {"name": "elbow", "link": "lbr_iiwa_link_4", "sphere": 0.08},
    {"name": "pole", "capsule": [0.05, 0.6], "position": [0.6, 0.0, 0.4]},
    {"name": "table", "box": [2.0, 2.0, 0.1], "position": [0.0, 0.0, -0.1]},
]


def iiwa(**more: Any) -> TrajectorySolver:
    solver = make_solver("trajectory", {**ENDS, **more})
    assert isinstance(solver, TrajectorySolver)
    return solver


@pytest.fixture(scope="module")
def kinematics() -> Kinematics:
    return Kinematics(IIWA)


@pytest.fixture(scope="module")
def solver() -> TrajectorySolver:
    return iiwa()


def start(positions: Any = BENT) -> dict[str, float]:
    return dict(zip(JOINTS, positions))


def checked(solution: IKSolution) -> SampledTrajectory:
    assert solution.success, solution.message
    assert solution.trajectory is not None
    return solution.trajectory


def at(trajectory: SampledTrajectory, time_s: float) -> list[float]:
    """Returns the positions at one of a trajectory's times."""
    i = int(np.argmin(np.abs(np.array(trajectory.times_s) - time_s)))
    assert trajectory.times_s[i] == pytest.approx(time_s)
    return list(trajectory.positions[i])


def test_waypoints_are_passed_in_time_from_rest_to_rest(solver, kinematics):
    postures = [(0.3, 0.8, 0.1, -1.0, 0.2, 0.6, 0.3), (0.6, 0.4, 0.3, -1.3, 0.0, 0.9, -0.2)]
    targets = [kinematics.forward(q, TIP) for q in postures]
    problem = IKProblem(start=start(), waypoints=(Waypoint(1.5, targets[0]), Waypoint(3.0, targets[1])))
    solution = solver.solve(problem)
    trajectory = checked(solution)
    for time_s, target in zip((1.5, 3.0), targets):
        reached = kinematics.forward(at(trajectory, time_s), TIP)
        assert math.dist(reached.position, target.position) < 2e-5
        turn = Rotation.from_quat(reached.quat_xyzw).inv() * Rotation.from_quat(target.quat_xyzw)
        assert turn.magnitude() < 2e-4
    assert trajectory.times_s[0] == 0.0 and trajectory.times_s[-1] == pytest.approx(3.0)
    assert trajectory.positions[0] == pytest.approx(BENT)
    assert trajectory.positions[-1] == pytest.approx(solution.positions)
    assert np.abs([trajectory.velocities[0], trajectory.velocities[-1]]).max() < 1e-9


def test_velocities_are_the_slopes_of_the_positions(kinematics):
    solver = iiwa(sample_s=0.001)
    target = kinematics.forward((0.3, 0.8, 0.1, -1.0, 0.2, 0.6, 0.3), TIP)
    trajectory = checked(solver.solve(IKProblem(start=start(), waypoints=(Waypoint(2.0, target),))))
    slopes = np.gradient(np.array(trajectory.positions), np.array(trajectory.times_s), axis=0, edge_order=2)
    assert slopes == pytest.approx(np.array(trajectory.velocities), abs=1e-3)


def test_limits_on_speed_and_acceleration_hold_all_along(kinematics):
    target = kinematics.forward((0.9, 0.8, 0.1, -1.0, 0.2, 0.6, 0.3), TIP)
    limits = {"velocity_limits": dict.fromkeys(JOINTS, 0.65), "acceleration_limits": dict.fromkeys(JOINTS, 3.0)}
    solver = iiwa(sample_s=0.001, intervals=24, **limits)
    trajectory = checked(solver.solve(IKProblem(start=start(), waypoints=(Waypoint(2.0, target),))))
    velocities = np.array(trajectory.velocities)
    assert 0.6 < np.abs(velocities).max() <= 0.65
    assert np.abs(np.diff(velocities, axis=0)).max() / 0.001 <= 3.0 + 1e-6


def test_velocity_limits_come_from_the_urdf_unless_options_override_them(kinematics):
    target = kinematics.forward((0.9, 0.8, 0.1, -1.0, 0.2, 0.6, 0.3), TIP)
    for limits, most in (({}, 10.0), ({"velocity_limits": dict.fromkeys(JOINTS, 60.0)}, 60.0)):
        solution = iiwa(**limits, sample_s=0.001).solve(IKProblem(start=start(), waypoints=(Waypoint(0.04, target),)))
        assert solution.success == (most == 60.0), solution.message
    assert 10.0 < np.abs(checked(solution).velocities).max() <= 60.0


def test_too_little_time_fails_with_words(solver, kinematics):
    target = kinematics.forward((1.5, 0.8, 0.1, -1.0, 0.2, 0.6, 0.3), TIP)
    solution = solver.solve(IKProblem(start=start(), waypoints=(Waypoint(0.02, target),)))
    assert not solution.success and solution.trajectory is None
    assert "the waypoint at 0.02 s is missed by" in solution.message


def test_waypoints_out_of_reach_are_named(solver, kinematics):
    near = kinematics.forward(BENT, TIP)
    problem = IKProblem(start=start(), waypoints=(Waypoint(1.0, near), Waypoint(2.0, Pose((3.0, 0.0, 0.0)))))
    solution = solver.solve(problem)
    assert not solution.success and solution.trajectory is None
    assert solution.message.startswith(f"waypoint at 2 s: '{TIP}' misses its target by ")


def test_obstacles_are_gone_around(kinematics):
    ways = [(side * 0.7, 0.9, 0.0, -1.0, 0.0, 1.0, 0.0) for side in (-1.0, 1.0)]
    problem = IKProblem(start=start(ways[0]), waypoints=(Waypoint(4.0, kinematics.forward(ways[1], TIP)),))

    def nearest_to_pole(trajectory: SampledTrajectory) -> float:
        tips = [kinematics.forward(q, TIP).position for q in trajectory.positions]
        return min(math.hypot(x - 0.6, y, max(0.0, z - 0.7)) for x, y, z in tips) - 0.08 - 0.05

    assert nearest_to_pole(checked(iiwa().solve(problem))) < 0.0, "without the obstacle it goes straight through"
    solution = iiwa(shapes=OBSTACLES, clearance=0.02).solve(problem)
    assert nearest_to_pole(checked(solution)) >= 0.02 - 1e-6
    assert "mm at least from obstacles" in solution.message


def test_a_start_in_an_obstacle_fails_at_once():
    ball = {"name": "ball", "sphere": 0.2, "position": list(Kinematics(IIWA).forward(BENT, TIP).position)}
    solution = iiwa(shapes=[OBSTACLES[0], ball]).solve(IKProblem(start=start(), target=Pose((0.5, 0.0, 0.6))))
    assert not solution.success and "at the start, a sphere is as near as -" in solution.message


def test_tolerances_hold_for_each_waypoint(solver, kinematics):
    x, y, z = kinematics.forward(BENT, TIP).position
    far = Pose((x, y, z + 1.0))
    wide = {"position_tolerance": (0.0, 0.0, 1.05), "rotation_tolerance": (4.0, 4.0, 4.0)}
    solution = solver.solve(IKProblem(start=start(), waypoints=(Waypoint(2.0, far),), **wide))
    reached = kinematics.forward(checked(solution).positions[-1], TIP).position
    assert math.hypot(reached[0] - x, reached[1] - y) < 1e-3 and reached[2] >= z - 0.051


def test_equal_problems_have_equal_answers(solver, kinematics):
    target = kinematics.forward((0.9, 0.8, 0.1, -1.0, 0.2, 0.6, 0.3), TIP)
    problem = IKProblem(start=start(), waypoints=(Waypoint(1.0, target),), seed=3)
    assert solver.solve(problem) == iiwa().solve(problem) == solver.solve(problem)


def test_random_problems_reachable_or_not_stay_within_limits():
    solver = iiwa(velocity_limits=dict.fromkeys(JOINTS, 3.0))
    generator = random.Random(0)
    solved = 0
    for seed in range(30):
        near = solver.limits.random(generator, solver.limits.middle)
        waypoints, time_s = [], 0.0
        for _ in range(generator.randint(1, 3)):
            time_s += generator.uniform(0.6, 2.0)
            pose = solver.chain.pose(solver.limits.clip([q + generator.gauss(0.0, 0.4) for q in near]))
            away = generator.uniform(-1.5, 1.5) if generator.random() < 0.15 else pose.position[0]
            waypoints.append(Waypoint(time_s, Pose((away, *pose.position[1:]), pose.quat_xyzw)))
        solution = solver.solve(IKProblem(start=start(near), waypoints=tuple(waypoints), seed=seed))
        solved += solution.success
        positions = [solution.positions, *(solution.trajectory.positions if solution.trajectory else ())]
        assert np.isfinite(positions).all()
        assert (np.array(positions) >= solver.lower).all() and (np.array(positions) <= solver.upper).all()
        assert (solution.trajectory is not None) == solution.success
        if solution.trajectory:
            assert (np.abs(solution.trajectory.velocities) <= 3.0).all()
    assert solved >= 15


@pytest.mark.parametrize(
    ("problem", "words"),
    [
        (IKProblem(), "waypoints: missing, and there is no target instead"),
        (IKProblem(waypoints=(Waypoint(0.0, Pose()),)), r"waypoints\[0\].time_s: must be after 0 s, got 0"),
        (IKProblem(waypoints=(Waypoint(2.0, Pose()), Waypoint(1.0, Pose()))), r"waypoints\[1\].time_s: must be after"),
        (IKProblem(waypoints=(Waypoint(1e8, Pose()),)), "are too many"),
        (
            IKProblem(waypoints=tuple(Waypoint(1.0 + i, Pose()) for i in range(65))),
            "^waypoints: expected 64 at most, got 65",
        ),
    ],
)
def test_questions_that_make_no_sense_are_refused(solver, problem, words):
    with pytest.raises(ValueError, match=words):
        solver.solve(problem)


def test_speeds_of_joints_that_slide_are_in_metres(tmp_path):
    path = tmp_path / "tree.urdf"
    path.write_text(TREE)
    options = {"urdf_filename": str(path), "base_link": "body", "tip_link": "left_arm"}
    solver = make_solver("trajectory", options)
    assert isinstance(solver, TrajectorySolver)
    spline = Spline(4)
    ramp = np.linspace(0.0, 1.0, spline.count)
    for name, way, unit in (("slide", (1.0, 0.0), "m/s"), ("left_1", (0.0, 1.0), "rad/s")):
        (fault,) = solver._too_fast(spline, np.outer(ramp, way), duration_s=0.1)
        assert re.fullmatch(rf"'{name}' needs [\d.]+ {unit}, its limit is 2", fault)


def test_only_the_newest_programs_are_kept(kinematics):
    def programs() -> int:
        gc.collect()
        return sum(isinstance(one, Program) for one in gc.get_objects())

    before = programs()
    solver = iiwa(intervals=4)
    pose = kinematics.forward(BENT, TIP)
    for count in range(1, KEPT_PROGRAMS + 2):
        solver.solve(IKProblem(start=start(), waypoints=tuple(Waypoint(2.0 * (i + 1), pose) for i in range(count))))
    assert programs() - before == KEPT_PROGRAMS


def test_fine_splines_are_sparse_programs():
    """Otherwise those with many waypoints, or obstacles, take minutes to compile."""
    solver = iiwa(shapes=OBSTACLES)
    fine, finer = (solver._compiled(intervals, 4)._solve.get_function("nlp_hess_l").nnz_out(0) for intervals in (8, 16))
    assert finer < 2.2 * fine


def test_only_one_thread_at_a_time_judges(kinematics):
    """The chain has one working memory: two threads in it would mix up their positions."""

    class Watched(TrajectorySolver):
        def residual(self, goal, q):
            assert self._lock.locked()
            return super().residual(goal, q)

    solver = Watched(TrajectorySolver.Config.parse(ENDS, "~"))
    assert solver.solve(IKProblem(start=start(), target=kinematics.forward(BENT, TIP))).success


def test_unknown_joints_are_refused(solver):
    with pytest.raises(UnknownNameError, match="unknown joint 'elbow'"):
        solver.solve(IKProblem(start={"elbow": 0.0}, target=Pose((0.5, 0.0, 0.5))))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"velocity_limits": {"elbow": 1.0}}, "velocity_limits: unknown joint 'elbow'"),
        ({"shapes": [{"name": "a", "link": "nose", "sphere": 0.1}]}, r"shapes\[0\].link: unknown link of the chain"),
        ({"shapes": [{"name": "a", "link": TIP, "capsule": [0.1, 0.1]}]}, r"shapes\[0\]: shapes on links must be"),
        ({"intervals": 2}, "intervals: must be >= 4"),
    ],
)
def test_options_that_do_not_fit_are_refused_with_the_key(options, words):
    with pytest.raises(ConfigError, match=words):
        iiwa(**options)


@pytest.mark.parametrize("urdf", ["kuka_iiwa/model.urdf", "franka_panda/panda.urdf", "xarm/xarm6_robot.urdf"])
def test_kinematics_for_casadi_agree_with_pybullet(urdf):
    ends = {"kuka_iiwa": ("lbr_iiwa_link_0", TIP), "franka_panda": ("panda_link0", "panda_grasptarget")}
    base, tip = ends.get(urdf.split("/")[0], ("link_base", "link6"))
    solver = make_solver("kdl", {"urdf_filename": str(DATA / urdf), "base_link": base, "tip_link": tip})
    q = casadi.SX.sym("q", len(solver.joint_names))
    frames = link_frames(solver.description, q)
    forward = casadi.Function("forward", [q], list(frames[tip]))
    robot = Kinematics(str(DATA / urdf))
    generator = np.random.default_rng(0)
    for _ in range(20):
        positions = generator.uniform(-1.0, 1.0, len(solver.joint_names))
        named = dict(zip(solver.joint_names, positions))
        pose = robot.forward([named.get(name, 0.0) for name in robot.joint_names], tip)
        rotation, position = (np.array(value) for value in forward(positions))
        assert position.ravel() == pytest.approx(pose.position, abs=1e-6)
        x, y, z, w = pose.quat_xyzw
        assert rotation[2, 1] - rotation[1, 2] == pytest.approx(4.0 * w * x, abs=1e-5)
        assert np.trace(rotation) == pytest.approx(4.0 * w * w - 1.0, abs=1e-5)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.3, 2.0, 3.1])
def test_rotation_vectors_are_axis_times_angle(angle):
    axis = np.array((0.6, 0.0, 0.8))
    cross = np.array(((0.0, -axis[2], axis[1]), (axis[2], 0.0, -axis[0]), (-axis[1], axis[0], 0.0)))
    rotation = np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * cross @ cross
    assert np.array(rotation_vector(casadi.DM(rotation))).ravel() == pytest.approx(angle * axis, abs=1e-6)


def test_splines_and_their_derivatives_lie_within_their_control_points():
    spline = Spline(8)
    points = np.random.default_rng(0).normal(size=(spline.count, 2))
    times = np.linspace(0.0, 1.0, 501)
    positions, velocities = spline.basis(times) @ points, spline.basis(times, 1) @ points
    accelerations = spline.basis(times, 2) @ points
    assert np.gradient(positions, times, axis=0)[1:-1] == pytest.approx(velocities[1:-1], abs=0.5)
    for values, bounds in (
        (positions, points),
        (velocities, spline.to_velocity @ points),
        (accelerations, spline.to_acceleration @ points),
    ):
        assert (values <= bounds.max(axis=0) + 1e-9).all() and (values >= bounds.min(axis=0) - 1e-9).all()
        assert values.max() > 0.3 * bounds.max()
    middle = spline.basis((np.arange(4000) + 0.5) / 4000, 2) @ points
    assert points[:, 0] @ spline.roughness @ points[:, 0] == pytest.approx(np.mean(middle[:, 0] ** 2), rel=1e-3)
