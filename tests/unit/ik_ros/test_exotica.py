"""The solver `exotica`: problems in EXOTica's XML, and their expression by tasks."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from exotica_files import ARM, POSE_MAP, VELOCITY_MAP, write_problem
from scipy.spatial.transform import Rotation

from custom_ros_tools.errors import ConfigError, InterfaceError
from ik_ros.lookup import make_solver
from ik_ros.problem import AttachedFrame, IKProblem
from robot_model.geometry import Pose, angle_between
from robot_model.model import RobotModel

JOINTS = tuple(f"lwr_arm_{i}_joint" for i in range(7))
DOWN = (1.0, 0.0, 0.0, 0.0)
GOAL = Pose((-0.5, 0.1, 0.4), DOWN)
HOME = dict(zip(JOINTS, (0.0, 0.5236, 0.0, -1.57, 0.0, 1.0472, 0.0)))


def make(path: str, **options: Any) -> Any:
    return make_solver("exotica", {"xml_filename": path, **options})


def link_at(solution: Any, link: str = "end_effector_ball") -> Pose:
    robot = RobotModel(str(ARM))
    at = dict(zip(solution.joint_names, solution.positions))
    return robot.pose([at.get(name, 0.0) for name in robot.joint_names], link)


def attached(pose: Pose = GOAL, parent: str = "") -> dict[str, AttachedFrame]:
    return {"Target": AttachedFrame(parent, pose)}


def off(pose: Pose, other: Pose) -> tuple[float, float]:
    return math.dist(pose.position, other.position), angle_between(pose.quat_xyzw, other.quat_xyzw)


def map_of(kind: str, name: str, more: str = "", **frame: str) -> str:
    attributes = " ".join(f'{key}="{value}"' for key, value in frame.items())
    return f'<{kind} Name="{name}" {more}><EndEffector><Frame {attributes}/></EndEffector></{kind}>'


def test_frame_follows_the_pose_that_a_problem_attaches(tmp_path):
    solver = make(
        write_problem(tmp_path, POSE_MAP + VELOCITY_MAP, '<Task Task="Pose"/><Task Task="JointVel" Rho="5e-4"/>')
    )
    assert solver.joint_names == JOINTS and solver.base_frame == "base"
    solution = solver.solve(IKProblem(start=HOME, previous=(HOME,), frames=attached()))
    assert solution.success, solution.message
    distance, angle = off(link_at(solution), GOAL)
    assert distance < 1e-3 and angle < 0.01
    again = solver.solve(IKProblem(start=HOME, previous=(HOME,), frames=attached(parent="lwr_arm_0_link")))
    assert again.positions == pytest.approx(solution.positions, abs=1e-9)


def test_scene_frame_stays_where_the_xml_has_it(tmp_path):
    links = '<Link Name="Table" Transform="-0.5 0 0.3"/>'
    links += '<Link Name="Target" Parent="Table" Transform="0 0.1 0.1 3.14159 0 0"/>'
    solution = make(write_problem(tmp_path, links=links)).solve(IKProblem(start=HOME))
    assert solution.success and off(link_at(solution), Pose((-0.5, 0.1, 0.4), DOWN))[0] < 1e-3


@pytest.mark.parametrize(
    ("notation", "numbers"),
    [
        ("RPY", (0.1, 0.2, 0.3)),
        ("Quaternion", Rotation.from_euler("xyz", (0.1, 0.2, 0.3)).as_quat()),
        ("ZYX", (0.3, 0.2, 0.1)),
        ("ZYZ", Rotation.from_euler("xyz", (0.1, 0.2, 0.3)).as_euler("ZYZ")),
        ("AngleAxis", Rotation.from_euler("xyz", (0.1, 0.2, 0.3)).as_rotvec()),
        ("Matrix", Rotation.from_euler("xyz", (0.1, 0.2, 0.3)).as_matrix().ravel()),
    ],
)
def test_goals_in_each_notation_of_rotations(tmp_path, notation, numbers):
    maps = map_of("EffFrame", "Pose", f'Type="{notation}"', Link="end_effector_ball", Base="Target")
    solver = make(write_problem(tmp_path, maps))
    assert solver.map_size("Pose") == 3 + len(numbers)
    goal = (0.01, 0.02, 0.03, *numbers)
    solution = solver.solve(IKProblem(start=HOME, frames=attached(), goals={"Pose": goal}))
    turn = tuple(Rotation.from_euler("xyz", (0.1, 0.2, 0.3)).as_quat().tolist())
    assert solution.success, solution.message
    distance, angle = off(link_at(solution), GOAL @ Pose((0.01, 0.02, 0.03), turn))
    assert distance < 1e-3 and angle < 0.01


def test_position_and_orientation_of_offset_frames(tmp_path):
    position = map_of("EffPosition", "Position", Link="lwr_arm_7_link", LinkOffset="0 0 0.1", Base="Target")
    maps = position + map_of("EffOrientation", "Turn", Link="lwr_arm_7_link", BaseOffset="0 0 0 1 0 0 0")
    solver = make(write_problem(tmp_path, maps, '<Task Task="Position" Goal="0 0 0.05"/><Task Task="Turn"/>'))
    solution = solver.solve(IKProblem(start=HOME, frames=attached()))
    assert solution.success, solution.message
    tip = link_at(solution, "lwr_arm_7_link") @ Pose((0.0, 0.0, 0.1))
    distance, angle = off(tip, Pose((GOAL @ Pose((0.0, 0.0, 0.05))).position, DOWN))
    assert distance < 1e-3 and angle < 0.01


def test_weights_by_axis_leave_axes_of_the_base_free(tmp_path):
    path = write_problem(tmp_path, costs='<Task Task="Pose" Rho="1 0 1 0 0 0"/>')
    base = Pose((-0.5, 0.0, 0.4), tuple(Rotation.from_euler("z", 0.5).as_quat().tolist()))
    solution = make(path).solve(IKProblem(start={**HOME, "lwr_arm_0_joint": 0.3}, frames=attached(base)))
    assert solution.success, solution.message
    x, _, z = (base.inverse() @ link_at(solution)).position
    assert abs(x) < 1e-3 and abs(z) < 1e-3
    assert abs((base.inverse() @ link_at(solution)).position[1]) > 0.01


def test_look_at_points_the_z_axis_at_a_frame(tmp_path):
    maps = map_of("LookAt", "Look", Link="Target", Base="lwr_arm_7_link")
    solution = make(write_problem(tmp_path, maps, '<Task Task="Look"/>')).solve(
        IKProblem(start=HOME, frames=attached())
    )
    assert solution.success, solution.message
    x, y, z = (link_at(solution, "lwr_arm_7_link").inverse() @ GOAL).position
    assert math.hypot(x, y) < 0.02 * z


def test_joint_maps(tmp_path):
    maps = (
        '<JointPose Name="Elbow" JointMap="3" JointRef="-1.2"/>'
        '<JointLimit Name="Limit" SafePercentage="0.5"/>'
        '<JointVelocityBackwardDifference Name="Vel"/>'
    )
    costs = '<Task Task="Elbow" Rho="10"/><Task Task="Limit" Rho="1"/><Task Task="Vel" Rho="0.01"/>'
    solver = make(write_problem(tmp_path, maps, costs))
    assert [solver.map_size(name) for name in ("Elbow", "Limit", "Vel")] == [1, 7, 7]
    before = {**HOME, "lwr_arm_0_joint": 2.5}
    at = dict(zip(JOINTS, solver.solve(IKProblem(start=HOME, previous=(before,), goals={"Elbow": (0.1,)})).positions))
    assert at["lwr_arm_3_joint"] == pytest.approx(-1.1, abs=2e-3)
    upper = RobotModel(str(ARM)).limits.upper[0]
    assert 0.5 < at["lwr_arm_0_joint"] < 0.5 * upper + 0.01, "beyond the share that counts as safe"
    assert at["lwr_arm_2_joint"] == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize(
    ("name", "expected"),
    [("Velocity", 0.3), ("Acceleration", 2 * 0.3 - 0.1), ("Jerk", 3 * 0.3 - 3 * 0.1 - 0.2)],
)
def test_backward_differences_extrapolate_previous_solutions(tmp_path, name, expected):
    maps = f'<Joint{name}BackwardDifference Name="Diff"/>'
    solver = make(write_problem(tmp_path, maps, '<Task Task="Diff"/>'))
    previous = [dict.fromkeys(JOINTS, position) for position in (-0.2, 0.1, 0.3)]
    solution = solver.solve(IKProblem(start=HOME, previous=tuple(previous)))
    assert solution.positions[0] == pytest.approx(expected, abs=1e-3)


def test_centre_of_mass(tmp_path):
    path = write_problem(tmp_path, '<CenterOfMass Name="CoM" EnableZ="false"/>', '<Task Task="CoM" Goal="-0.1 0.05"/>')
    assert make(path).solve(IKProblem(start=HOME)).success


def test_bounds_hold(tmp_path):
    bounds = "<LowerBound>-3 -3 -3 -3 -3 -3 -3</LowerBound><UpperBound>3 0.2 3 3 3 3 3</UpperBound>"
    free = make(write_problem(tmp_path)).solve(IKProblem(start=HOME, frames=attached()))
    assert free.positions[1] > 0.2
    kind = "BoundedEndPoseProblem"
    solver = make(write_problem(tmp_path, kind=kind, more=bounds, solver=""), use_scipy_solver=True)
    solution = solver.solve(IKProblem(start=HOME, frames=attached()))
    assert solution.positions[1] <= 0.2 + 1e-9


def test_groups_of_the_srdf_choose_the_joints(tmp_path):
    maps, costs = '<JointPose Name="Q"/>', '<Task Task="Q"/>'
    assert make(write_problem(tmp_path, maps, costs, group="wrist")).joint_names == JOINTS[5:]
    assert make(write_problem(tmp_path, maps, costs, group="both")).joint_names == (JOINTS[0], *JOINTS[5:])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"maps": '<CollisionDistance Name="C"/>'}, r"Maps\.C.*'CollisionDistance'.*EffFrame"),
        ({"maps": POSE_MAP.replace("EffFrame", "EfFrame")}, "did you mean 'EffFrame'"),
        ({"maps": POSE_MAP.replace("Target", "Nowhere")}, r"Pose\.EndEffector\[0\]\.Base.*'Nowhere'"),
        ({"maps": POSE_MAP.replace("Target", "lwr_arm_5_link")}, "Base: expected a frame that no joint moves"),
        ({"maps": POSE_MAP.replace("end_effector_ball", "Target")}, "Link: expected a frame that joints move"),
        ({"maps": POSE_MAP.replace("/>", ' LinkOffset="1 2"/>')}, "LinkOffset.*expected 3, 6 or 7 finite numbers"),
        ({"maps": POSE_MAP.replace("/>", ' LinkOffset="nan 0 0"/>')}, "LinkOffset.*expected 3, 6 or 7 finite numbers"),
        ({"maps": POSE_MAP.replace('Name="Pose"', 'Name="Pose" Typ="RPY"')}, r"Pose\.Typ.*'Type'"),
        ({"costs": '<Task Task="Pos"/>'}, "'Pos'.*did you mean 'Pose'"),
        ({"costs": '<Task Task="Pose" Rho="1 2"/>'}, "Rho.*expected 1 or 6 weights"),
        ({"costs": '<Task Task="Pose" Rho="much"/>'}, "Rho.*expected numbers"),
        ({"costs": '<Task Task="Pose" Rho="0"/>'}, "expected a cost whose Rho is not 0"),
        ({"costs": '<Task Task="Pose" Goal="1"/>'}, "Goal.*expected 6 numbers, got 1"),
        ({"maps": POSE_MAP.replace("<Frame ", '<Frame Link="lwr_arm_7_link"/>' * 200 + "<Frame ")}, "at most 200"),
        ({"costs": '<Task Task="Pose" Rho="inf"/>'}, "Rho"),
        ({"more": "<StartState>0 0</StartState>"}, "StartState.*expected 7 positions"),
        ({"kind": "SamplingProblem"}, "'SamplingProblem'.*UnconstrainedEndPoseProblem"),
        ({"solver": '<OMPLSolver Name="S"/>'}, "'OMPLSolver'.*IKSolver"),
        ({"solver": ""}, "expected an IKSolver"),
        ({"group": "leg"}, "JointGroup.*'leg'.*arm"),
        ({"urdf": "/no/such.urdf"}, "URDF.*no such file"),
        ({"links": '<Link Name="A" Parent="B"/><Link Name="B" Parent="A"/>'}, "attached to itself"),
        ({"links": '<Link Name="lwr_arm_1_link"/>'}, "another frame 'lwr_arm_1_link'"),
        ({"links": "<Link>" * 200 + "</Link>" * 200}, "at most 100 levels"),
    ],
)
def test_unsupported_problems_are_rejected_by_name(tmp_path, changes, message):
    path = write_problem(tmp_path, **changes)
    with pytest.raises(ConfigError, match=f"(?s){message}") as error:
        make(path)
    assert path in str(error.value)


BOMB = '<!DOCTYPE a [<!ENTITY b "ha"><!ENTITY c "&b;&b;&b;">]>'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (BOMB + "<a><IKSolver Name='&c;'/></a>", "expected no DOCTYPE"),
        ('<!DOCTYPE a SYSTEM "file:///etc/passwd"><a/>', "expected no DOCTYPE"),
        ("<a><b></a>", "is not XML"),
        ("", "is not XML"),
        ("<a>&undefined;</a>", "is not XML"),
        ("<a/>", "expected a problem"),
        ("<a>" + "<b/>" * 20_000 + "</a>", "10000 elements"),
        ("<a>" + " " * 2_000_000 + "</a>", "expected at most 1000000"),
        ("<a><IKSolver Name='a'><Name>b</Name></IKSolver></a>", "'Name' is given twice"),
    ],
)
def test_hostile_files_are_rejected(tmp_path, text, message):
    path = tmp_path / "hostile.xml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=message):
        make(str(path))


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"goals": {"Pos": (0.0,)}}, "task map 'Pos'.*did you mean 'Pose'"),
        ({"goals": {"Pose": (0.0,)}}, "goals: Pose: expected 6 numbers, got 1"),
        ({"frames": {"Tagret": AttachedFrame("", GOAL)}}, "did you mean 'Target'"),
        ({"frames": attached(parent="lwr_arm_3_link")}, "'Target' cannot be attached at run time to what joints move"),
        ({"frames": attached(parent="Target")}, "attached to itself"),
        ({"previous": ({"lwr_arm_0_joint": 0.0},)}, "a previous solution lacks lwr_arm_1_joint"),
    ],
)
def test_problems_that_do_not_fit_are_rejected(tmp_path, fields, message):
    costs = '<Task Task="Pose"/><Task Task="JointVel" Rho="5e-4"/>'
    solver = make(write_problem(tmp_path, POSE_MAP + VELOCITY_MAP, costs))
    with pytest.raises((InterfaceError, ValueError), match=message):
        solver.solve(IKProblem(start=HOME, **fields))


def test_frame_out_of_reach_is_no_success(tmp_path):
    solution = make(write_problem(tmp_path)).solve(IKProblem(start=HOME, frames=attached(Pose((5.0, 0.0, 0.0)))))
    assert not solution.success and "'Pose' is off by" in solution.message
    assert np.isfinite(solution.positions).all()


def test_yielding_maps_need_not_be_met(tmp_path):
    maps = POSE_MAP + map_of("EffPosition", "Elbow", Link="lwr_arm_3_link")
    costs = '<Task Task="Pose" Rho="1"/><Task Task="Elbow" Rho="0.001" Goal="0 0 2"/>'
    assert make(write_problem(tmp_path, maps, costs)).solve(IKProblem(start=HOME, frames=attached())).success
