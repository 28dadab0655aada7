"""The solver `tasks`: users' own formulations."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from tree_robot import TREE

from custom_ros_tools.config import load_config
from custom_ros_tools.errors import ConfigError, MissingDependency, UnknownNameError
from ik_ros.lookup import make_solver
from ik_ros.problem import IKProblem
from ik_ros.solvers.tasks import TasksSolver
from robot_model.geometry import Pose

TALOS = Path(__file__).resolve().parents[3] / "src/rpbi_examples/configs/ik_talos/ik.yaml"
IIWA_TIP = "lbr_iiwa_link_7"
IIWA_FAR = (0.0, 0.5, 0.0, -1.2, 0.0, 0.8, 0.0)


@pytest.fixture
def urdf(tmp_path: Path) -> str:
    path = tmp_path / "tree.urdf"
    path.write_text(TREE)
    return str(path)


def make(file: str, text: str) -> TasksSolver:
    solver = make_solver("tasks", {"urdf_filename": file, **yaml.safe_load(text)})
    assert isinstance(solver, TasksSolver)
    return solver


def iiwa(key: str = "costs", **more: Any) -> TasksSolver:
    task = {"name": "reach", "type": "frame_pose", "frame": IIWA_TIP}
    solver = make_solver("tasks", {"urdf_filename": "kuka_iiwa/model.urdf", key: [task], **more})
    assert isinstance(solver, TasksSolver)
    return solver


def pose_of(solver: TasksSolver, link: str, positions: Any) -> Pose:
    robot = solver.tasks.robot
    robot.update(robot.configuration(dict(zip(solver.joint_names, positions))))
    frame = robot.frame(robot.link_id(link))
    x, y, z = frame.translation.tolist()
    from pinocchio import Quaternion

    qx, qy, qz, qw = Quaternion(frame.rotation).coeffs().tolist()
    return Pose((x, y, z), (qx, qy, qz, qw))


def close(found: Pose, expected: Pose) -> bool:
    off = found.inverse() @ expected
    return max(map(abs, (*off.position, *off.quat_xyzw[:3]))) < 1e-6


def distance(pose: Pose, position: Any) -> float:
    return float(np.linalg.norm(np.array(pose.position) - position))


@pytest.mark.parametrize("key", ["costs", "constraints"])
def test_poses_of_an_arm_of_seven_joints_are_found(key):
    solver = iiwa(key)
    generator = np.random.default_rng(0)
    start = dict(zip(solver.joint_names, IIWA_FAR))
    solved = 0
    for seed in range(200):
        target = pose_of(solver, IIWA_TIP, generator.uniform(solver.lower, solver.upper))
        solution = solver.solve(IKProblem(target=target, start=start, seed=seed))
        assert np.all(np.array(solution.positions) >= solver.lower) and np.all(solution.positions <= solver.upper)
        if solution.success:
            solved += 1
            assert distance(pose_of(solver, IIWA_TIP, solution.positions), target.position) < 1e-3
    assert solved >= 198


def test_frames_on_links_reach_as_links_do():
    tip = Pose((0.0, 0.1, 0.2), (1.0, 0.0, 0.0, 0.0))
    tool = {"name": "tool", "link": IIWA_TIP, "position": tip.position, "orientation": tip.quat_xyzw}
    reach = {"name": "reach", "type": "frame_pose", "frame": "tool"}
    solver = make_solver("tasks", {"urdf_filename": "kuka_iiwa/model.urdf", "frames": [tool], "costs": [reach]})
    target = Pose((0.4, 0.2, 0.4), (0.0, 1.0, 0.0, 0.0))
    solution = solver.solve(IKProblem(target=target))
    assert solution.success, solution.message
    off = (pose_of(solver, IIWA_TIP, solution.positions) @ tip).inverse() @ target
    assert max(map(abs, (*off.position, *off.quat_xyzw[:3]))) < 1e-3


def test_unreachable_target_fails_with_message_and_best_pose_within_limits():
    solution = iiwa(restarts=3).solve(IKProblem(target=Pose((3.0, 0.0, 0.0))))
    assert not solution.success
    assert solution.message.startswith("'reach' is off by ")
    assert solution.position_error_m > 1.5
    assert np.isfinite(solution.positions).all()


def test_equal_problems_have_equal_answers():
    first, second = iiwa(), iiwa()
    target = pose_of(first, IIWA_TIP, np.linspace(-1.0, 1.0, 7))
    problems = [IKProblem(target=target, seed=seed) for seed in (0, 1)]
    answers = [[solver.solve(problem) for problem in problems] for solver in (first, second)]
    first.solve(IKProblem(target=Pose((0.4, 0.2, 0.5))))
    assert answers[0] == answers[1] == [first.solve(problem) for problem in problems]


def test_problem_tolerances_are_in_the_axes_of_the_target():
    solver = iiwa()
    target = pose_of(solver, IIWA_TIP, (0.3, 0.6, 0.2, -1.0, 0.4, 0.5, 0.1))
    far = Pose((target.position[0], target.position[1], target.position[2] + 2.0), (0.0, 0.0, 0.0, 1.0))
    assert not solver.solve(IKProblem(target=far)).success
    wide = IKProblem(target=far, position_tolerance=(0.0, 0.0, 2.0), rotation_tolerance=(4.0, 4.0, 4.0))
    solution = solver.solve(wide)
    assert solution.success, solution.message
    reached = pose_of(solver, IIWA_TIP, solution.positions)
    assert np.hypot(reached.position[0] - far.position[0], reached.position[1] - far.position[1]) < 1.1e-3


def test_constraints_outrank_costs_and_optional_costs_may_fail(urdf):
    text = """
      constraints: [{name: hand, type: frame_position, frame: left_hand, goal: [0.0, 0.3, 0.7]}]
      costs: [{name: wish, type: frame_position, frame: left_hand, goal: [0.0, 0.3, 5.0], weight: 10.0}]
      main_task: hand
    """
    solver = make(urdf, text)
    solution = solver.solve(IKProblem())
    assert solution.success, solution.message
    assert distance(pose_of(solver, "left_hand", solution.positions), (0.0, 0.3, 0.7)) < 1e-3
    solver = make(urdf, text.replace("weight", "required: true, weight"))
    assert "'wish' is off by" in solver.solve(IKProblem()).message


def test_weights_decide_between_costs(urdf):
    for weight, height in ((100.0, 0.8), (0.01, 0.6)):
        solver = make(
            urdf,
            f"""
            costs:
              - {{name: high, type: frame_position, frame: left_arm, goal: [0, 0, 0.8], weight: {weight}, axes: [z]}}
              - {{name: low, type: frame_position, frame: right_arm, goal: [0.0, 0.0, 0.6], axes: [z]}}
            """,
        )
        solution = solver.solve(IKProblem())
        assert solution.success and "none of them is required" in solution.message
        assert pose_of(solver, "left_arm", solution.positions).position[2] == pytest.approx(height, abs=0.01)


def test_goals_of_a_problem_replace_formulation_goals_once(urdf):
    solver = make(urdf, "constraints: [{name: bend, type: posture, goal: {left_1: 0.5}}]")
    index = solver.joint_names.index("left_1")
    for goals, expected in (({}, 0.5), ({"bend": [0.9]}, 0.9), ({}, 0.5)):
        solution = solver.solve(IKProblem(goals=goals))
        assert solution.success and solution.positions[index] == pytest.approx(expected, abs=1e-3)


def test_only_chosen_joints_move_and_others_keep_the_start(urdf):
    solver = make(
        urdf,
        "{joints: [right_2, left_1], costs: [{name: reach, type: frame_position, frame: left_hand, axes: [z]}]}",
    )
    assert solver.joint_names == ("right_2", "left_1")
    for slide in (0.0, 0.4):
        solution = solver.solve(IKProblem(start={"slide": slide}, target=Pose((0.0, 0.0, 0.6 + slide))))
        assert solution.success, solution.message


def test_speed_limits_hold_between_solutions_until_the_target_is_reached(urdf):
    solver = make(
        urdf,
        """
        costs: [{name: reach, type: frame_position, frame: left_hand, axes: [y, z]}]
        constraints: [{name: slow, type: velocity_limits, dt_s: 0.1, factor: 0.5}]
        """,
    )
    solver.tasks.robot.max_velocity[:] = 2.0
    target = pose_of(solver, "left_hand", (0.4, 0.5, 0.5, 0.0, 0.0))
    q = dict(zip(solver.joint_names, (0.0,) * 5))
    for count in range(20):  # noqa: B007
        solution = solver.solve(IKProblem(target=target, start=q, previous=(q,)))
        way = np.abs(np.array(solution.positions) - list(q.values()))
        limited = [solver.joint_names.index(name) for name in solver.joint_names if name != "left_2"]
        assert way[limited].max() <= 0.1 + 1e-6
        q = dict(zip(solver.joint_names, solution.positions))
        if solution.success:
            break
    assert solution.success and count >= 3


def test_obstacles_are_kept_away_from(urdf):
    text = """
      shapes:
        - {name: hand, link: left_hand, sphere: 0.05}
        - {name: wall, box: [2.0, 0.1, 2.0], position: [0.0, 0.55, 0.6]}
      costs: [{name: reach, type: frame_position, frame: left_hand, required: true, goal: [0.0, 0.45, 0.6]}]
      constraints: [{name: apart, type: distance, pairs: [[hand, wall]], at_least: 0.04}]
    """
    solver = make(urdf, text)
    solution = solver.solve(IKProblem())
    assert not solution.success and "'reach' is off by" in solution.message and "'apart'" not in solution.message
    assert pose_of(solver, "left_hand", solution.positions).position[1] <= 0.5 - 0.04 - 0.05 + 1e-3
    free = make(urdf, text.replace("0.55, 0.6", "0.65, 0.6"))
    assert free.solve(IKProblem()).success


def test_links_of_a_floating_robot_stay_where_constraints_want_them(urdf):
    fixed = make(urdf, "costs: [{name: stay, type: closeness}]")
    left, right = (pose_of(fixed, f"{side}_hand", (0.3, 0.4, -0.3, -0.2, 0.5)) for side in ("left", "right"))
    solver = make(
        urdf,
        f"""
        floating_base: true
        base_position: [0.1, 0.1, 0.1]
        constraints:
          - {{name: left, type: frame_pose, frame: left_hand, goal: {[*left.position, *left.quat_xyzw]}}}
          - {{name: right, type: frame_position, frame: right_hand, goal: {list(right.position)}}}
        costs: [{{name: reach, type: frame_position, frame: body, goal: [0.0, 0.0, 0.0], axes: [z]}}]
        main_task: reach
        """,
    )
    assert solver.base_frame == "world"
    solution = solver.solve(IKProblem())
    assert solution.success, solution.message
    assert solution.base_pose is not None and solution.base_pose.position[2] == pytest.approx(0.0, abs=1e-3)
    on_body = pose_of(fixed, "left_hand", solution.positions)
    assert distance(solution.base_pose @ on_body, left.position) < 1e-3


def test_starts_outside_limits_are_brought_in_with_one_warning(urdf, caplog):
    solver = make(urdf, "costs: [{name: bend, type: posture, goal: {left_1: 0.5}}]")
    for position in (2.5, 0.0, 2.5):
        solver.solve(IKProblem(start={"left_1": position}))
    messages = [record.getMessage() for record in caplog.records]
    assert messages == ["the start is outside limits and is moved within them: 'left_1' 2.5"]


@pytest.mark.parametrize(
    ("problem", "error", "words"),
    [
        (IKProblem(), ValueError, "target: missing, neither the problem nor the formulation has one"),
        (IKProblem(goals={"raech": [0.0] * 7}), UnknownNameError, "unknown task 'raech': known are reach; did"),
        (IKProblem(goals={"reach": [0.0]}), ValueError, r"target: expected a pose .*, got \[0.0\]"),
        (IKProblem(start={"elbow": 0.0}, target=Pose()), UnknownNameError, "unknown joint 'elbow': known are lbr_iiwa"),
        (IKProblem(previous=({"elbow": 0.0},), target=Pose()), UnknownNameError, "unknown joint 'elbow': known are lb"),
    ],
)
def test_questions_that_make_no_sense_are_refused(problem, error, words):
    with pytest.raises(error, match=words):
        iiwa().solve(problem)


@pytest.mark.parametrize(
    "task",
    [
        "type: velocity_limits, dt_s: 0.01, limits: {left_1: 1.0}",
        "type: acceleration_limits, dt_s: 0.01, limits: {left_1: 1.0}",
        "type: closeness",
    ],
)
def test_previous_solutions_that_lack_a_joint_are_refused(urdf, task):
    solver = make(urdf, f"constraints: [{{name: slow, {task}}}]")
    whole = dict.fromkeys(solver.joint_names, 0.1)
    part = {name: position for name, position in whole.items() if name != "left_1"}
    assert solver.solve(IKProblem(previous=(whole,))).success
    assert solver.solve(IKProblem(previous=(part, whole, whole))).success, "the newest are those that count"
    with pytest.raises(ValueError, match=r"^previous\[2\]: lacks 'left_1', which the task 'slow' needs"):
        solver.solve(IKProblem(previous=(part, whole, part)))


def test_targets_need_a_task_that_they_are_for(urdf):
    solver = make(urdf, "costs: [{name: bend, type: posture, goal: {left_1: 0.5}}]")
    with pytest.raises(ValueError, match="target: the formulation has no main task"):
        solver.solve(IKProblem(target=Pose()))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("costs: [{name: a, type: frame_pose, frame: left_hnd}]", r"costs\[0\].frame: unknown link 'left_hnd'.*did"),
        ("costs: [{name: a, type: frame_poze}]", r"costs\[0\].type: unknown task 'frame_poze'.*did you mean"),
        ("costs: [{name: a}]", r"costs\[0\].type: missing"),
        ("costs: [3]", r"costs\[0\].*expected a mapping"),
        ("costs: [{name: a, type: posture, goal: {left_9: 0.0}}]", r"costs\[0\].goal: unknown joint 'left_9'"),
        ("costs: [{name: a, type: closeness, wieght: 1.0}]", r"costs\[0\].wieght: unknown key 'wieght'; did you mean"),
        ("constraints: [{name: a, type: closeness, weight: 1.0}]", r"constraints\[0\].weight: is for costs"),
        ("costs: [{name: a, type: closeness}, {name: a, type: closeness}]", r"costs\[1\].name: there is another"),
        ("{}", "costs: expected a task"),
        ("{costs: [{name: a, type: closeness}], joints: [left_9]}", "joints: unknown joint 'left_9'"),
        ("{costs: [{name: a, type: closeness}], base_frame: left_hnd}", "base_frame: unknown link 'left_hnd'.*did"),
        ("{costs: [{name: a, type: closeness}], start: {left_9: 0.0}}", "start: unknown joint 'left_9'"),
        ("{costs: [{name: a, type: closeness}], main_task: a}", "main_task: unknown task about a link 'a'"),
        ("{shapes: [{name: s, link: arm, sphere: 1}], costs: [{name: a, type: closeness}]}", r"shapes\[0\].link: unk"),
        ("{frames: [{name: f, link: arm}], costs: [{name: a, type: closeness}]}", r"frames\[0\].link: unknown link"),
        ("{frames: [{name: body, link: body}], costs: [{name: a, type: closeness}]}", r"frames\[0\].name: there is a"),
        ("{costs: [{name: a, type: closeness}], shapes: [{name: s}]}", r"shapes\[0\]: expected one of sphere, box"),
        ("costs: [{name: a, type: distance, pairs: [[b, c]]}]", r"costs\[0\].pairs\[0\]: unknown shape 'b'"),
        ("costs: [{name: a, type: 'nobody.knows:It'}]", r"costs\[0\].type: no module 'nobody'"),
        ("costs: [{name: a, type: 'math:pi'}]", "expected a subclass of ik_ros.tasks.task:Task, got 'math:pi'"),
        ("costs: [{name: a, type: frame_position, frame: body, axes: [rx]}]", r"costs\[0\].axes: expected some of"),
        ("costs: [{name: a, type: joint_limits, limits: {left_1: [2.0, 3.0]}}]", r"limits.left_1: leaves 'left_1' no"),
    ],
)
def test_formulations_that_do_not_fit_are_refused_with_the_key(urdf, text, words):
    with pytest.raises(ConfigError, match=words):
        make(urdf, text)


@pytest.mark.parametrize("base", ["mount", "trunk", "left_arm", "left_hand"])
def test_poses_may_be_expressed_in_any_link(urdf, base):
    task = "costs: [{name: reach, type: frame_pose, frame: right_hand}]"
    from_root, from_base = make(urdf, task), make(urdf, f"{task}\nbase_frame: {base}")
    assert from_base.base_frame == base
    assert set(from_base.tasks.robot.links) == set(from_root.tasks.robot.links)
    generator = np.random.default_rng(0)
    for _ in range(20):
        positions = dict(zip(from_root.joint_names, generator.uniform(-1.0, 1.0, 5)))
        q = [positions[name] for name in from_base.joint_names]
        to_base = pose_of(from_root, base, positions.values()).inverse()
        for link in from_root.tasks.robot.links:
            expected = to_base @ pose_of(from_root, link, positions.values())
            assert close(pose_of(from_base, link, q), expected)
        robots = [solver.tasks.robot for solver in (from_root, from_base)]
        com, com_from_base = (robot.com(robot.configuration(positions))[0] for robot in robots)
        assert com_from_base == pytest.approx((to_base @ Pose(tuple(com))).position, abs=1e-6)


def test_hand_reaches_a_pose_relative_to_the_other_hand(urdf):
    task = "{costs: [{name: reach, type: frame_pose, frame: right_hand}], base_frame: left_hand}"
    solver, from_root = make(urdf, task), make(urdf, "costs: [{name: stay, type: closeness}]")
    target = pose_of(solver, "right_hand", [0.3, -0.4, 0.5, 0.2, 0.6])
    solution = solver.solve(IKProblem(target=target))
    assert solution.success, solution.message
    found = dict(zip(solution.joint_names, solution.positions))
    left, right = (
        pose_of(from_root, f"{side}_hand", [found[name] for name in from_root.joint_names])
        for side in ("left", "right")
    )
    assert distance(left.inverse() @ right, target.position) < 1e-3


def test_descriptions_that_are_none_are_refused(tmp_path):
    path = tmp_path / "broken.urdf"
    for text in ("<robot", "<robot name='a'><link name='b'/><joint name='c'/></robot>"):
        path.write_text(text)
        with pytest.raises(ConfigError, match="urdf_filename: .*broken.urdf: "):
            make(str(path), "costs: [{name: a, type: closeness}]")


def test_tasks_of_users_are_named_by_module_and_class(urdf):
    text = """
      costs:
        - {name: reach, type: frame_position, frame: left_arm, axes: [z], goal: [0.0, 0.0, 0.7]}
        - {name: upright, type: 'level_task:Level', frame: left_hand, required: true}
    """
    solution = make(urdf, text).solve(IKProblem(start={"left_1": 0.7, "left_2": 0.4}))
    assert solution.success and "'upright' within" in solution.message
    positions = dict(zip(solution.joint_names, solution.positions))
    assert (positions["left_1"], positions["left_2"]) == pytest.approx((-0.1, -0.2), abs=2e-3)


def test_errors_of_user_tasks_are_reported_with_their_place(urdf):
    task = "{name: upright, type: 'level_task:Level', frame: left_hnd}"
    with pytest.raises(ConfigError, match=r"costs\[0\]: unknown link 'left_hnd'.*; did you mean 'left_hand'"):
        make(urdf, f"costs: [{task}]")


@pytest.mark.parametrize(
    ("module", "library", "extra"),
    [("tasks", "pinocchio", "ik"), ("tasks", "daqp", "ik"), ("trajectory", "casadi", "mpc")],
)
def test_missing_extra_is_reported_with_its_install_command(monkeypatch, module, library, extra):
    monkeypatch.setitem(sys.modules, library, None)
    monkeypatch.delitem(sys.modules, f"ik_ros.solvers.{module}", raising=False)
    with pytest.raises(MissingDependency, match=f"'{library}' is not installed: ./rpbi setup {extra}"):
        importlib.import_module(f"ik_ros.solvers.{module}")


@pytest.mark.parametrize(
    "target", [(0.5, 0.2, 1.0), (0.6, 0.1, 0.7), (0.5, 0.3, 0.4), (0.0, 0.6, 1.2), (0.3, 0.3, 1.7), (0.9, 0.2, 1.0)]
)
def test_talos_reaches_with_fixed_feet_and_centre_of_mass_above(target):
    solver = make_solver("tasks", load_config(str(TALOS)), str(TALOS))
    assert isinstance(solver, TasksSolver)
    solution = solver.solve(IKProblem(target=Pose(target), goals={"look": target}))
    assert solution.success, solution.message
    robot = solver.tasks.robot
    import pinocchio as pin

    q = robot.configuration(dict(zip(solution.joint_names, solution.positions)))
    assert solution.base_pose is not None
    q[:7] = [*solution.base_pose.position, *solution.base_pose.quat_xyzw]
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    for foot, y in (("left_sole_link", 0.085), ("right_sole_link", -0.085)):
        placement = data.oMf[robot.model.getFrameId(foot)]
        assert placement.translation == pytest.approx([0.0, y, 0.0], abs=1e-3)
        assert np.linalg.norm(pin.log3(placement.rotation)) < 0.01
    x, y, _ = pin.centerOfMass(robot.model, data, q)
    assert abs(x) <= 0.08 + 1e-3 and abs(y) <= 0.085 + 0.06 - 0.02 + 1e-3
    assert data.oMf[robot.model.getFrameId("gripper_left_base_link")].translation == pytest.approx(target, abs=1e-3)


def test_talos_stays_balanced_when_the_target_is_unreachable():
    solver = make_solver("tasks", load_config(str(TALOS)), str(TALOS))
    solution = solver.solve(IKProblem(target=Pose((1.5, 0.0, 1.0))))
    assert not solution.success
    assert "'reach' is off by" in solution.message and "foot" not in solution.message
    assert "balance" not in solution.message


def test_fixed_joints_of_joint_states_are_ignored():
    solver = make("{rpbi_examples}/robots/kuka_lwr.urdf", "costs: [{name: stay, type: closeness}]")
    assert "base_joint" not in solver.joint_names
    start = {"lwr_arm_1_joint": 0.3, "base_joint": 0.0}
    assert solver.solve(IKProblem(start=start, previous=(start | dict.fromkeys(solver.joint_names, 0.1),))).success
    with pytest.raises(UnknownNameError, match="base_jont"):
        solver.solve(IKProblem(start={"base_jont": 0.0}))
