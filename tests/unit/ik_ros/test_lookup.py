"""Solvers are found by name, options are checked, and what is wrong is named."""

import subprocess
import sys
from pathlib import Path

import pytest

from custom_ros_tools.errors import ConfigError, UnknownNameError
from ik_ros.lookup import make_solver
from ik_ros.solvers import SOLVERS

LWR = Path(__file__).resolve().parents[3] / "src/rpbi_examples/robots/kuka_lwr.urdf"
OPTIONS = {"urdf_filename": str(LWR), "base_link": "lwr_arm_0_link", "tip_link": "end_effector_ball"}


def test_unknown_solver_is_reported_with_known_names_and_a_suggestion():
    with pytest.raises(UnknownNameError, match=r"unknown solver 'tracik': known are kdl, .*did you mean 'trac_ik'"):
        make_solver("tracik", OPTIONS)


def test_a_class_of_another_package_serves_where_a_name_does():
    solver = make_solver("ik_ros.solvers.kdl:KdlSolver", OPTIONS)
    assert solver.joint_names == tuple(f"lwr_arm_{index}_joint" for index in range(7))


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("no_such_package.module:Class", "solver 'no_such_package.module:Class': no module 'no_such_package'"),
        ("ik_ros.solvers.kld:KdlSolver", "'ik_ros.solvers' has no module 'kld'; did you mean 'kdl'"),
        ("ik_ros.solvers.kdl:KdlSolvr", "'ik_ros.solvers.kdl' has no 'KdlSolvr'; did you mean 'KdlSolver'"),
        ("ik_ros.problem:IKProblem", "expected a subclass of ik_ros.solver:Solver, got 'ik_ros.problem:IKProblem'"),
        (":KdlSolver", "solver ':KdlSolver': expected a name like 'my_package.my_module:MyClass'"),
    ],
)
def test_missing_class_or_class_that_is_no_solver_is_named(name, message):
    with pytest.raises(ConfigError, match=message):
        SOLVERS.configured(name)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"tip_link": "end_effector"}, None),
        ({"tip_link": "end_efector"}, r"arm.yaml: tip_link: unknown link 'end_efector'.*did you mean 'end_effector'"),
        ({"base_link": "lwr_base"}, "arm.yaml: base_link: unknown link 'lwr_base': known are base, lwr_arm_0_link"),
        ({"base_link": "end_effector_ball", "tip_link": "base"}, "tip_link: .*'base' is not below 'end_effector_b"),
        ({"tip_link": "lwr_arm_0_link"}, "tip_link: .*no joint moves 'lwr_arm_0_link' in 'lwr_arm_0_link'"),
        ({"urdf_filename": "nowhere.urdf"}, "arm.yaml: urdf_filename: no such file: nowhere.urdf"),
        ({"urdf_filename": "{no_such_package}/a.urdf"}, "urdf_filename: unknown ROS package 'no_such_package'"),
        ({"restart": 3}, "arm.yaml: restart: .*did you mean 'restarts'"),
        ({"restarts": -1}, "arm.yaml: restarts: must be >= 0, got -1"),
    ],
)
def test_wrong_options_are_named_by_file_and_key(wrong, message):
    if message is None:
        make_solver("kdl", OPTIONS | wrong, "arm.yaml")
        return
    with pytest.raises(ConfigError, match=message):
        make_solver("kdl", OPTIONS | wrong, "arm.yaml")


def test_a_robot_that_is_no_urdf_is_named(tmp_path):
    path = tmp_path / "broken.urdf"
    path.write_text("<robot><link name='a'>")
    with pytest.raises(ConfigError, match="broken.urdf: expected well-formed XML"):
        make_solver("kdl", OPTIONS | {"urdf_filename": str(path)})


def test_packages_in_the_file_name_are_resolved(monkeypatch):
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(LWR.parents[2]))
    for name in ("{rpbi_examples}/robots/kuka_lwr.urdf", "package://rpbi_examples/robots/kuka_lwr.urdf"):
        assert len(make_solver("kdl", OPTIONS | {"urdf_filename": name}).joint_names) == 7


def test_missing_library_matters_only_when_its_solver_is_requested():
    program = f"""
import sys
sys.modules["pytracik"] = None
from ik_ros.lookup import make_solver
make_solver("kdl", {OPTIONS})
try:
    make_solver("trac_ik", {OPTIONS})
except Exception as error:
    print(type(error).__name__, error)
"""
    environment = {"PYTHONPATH": ":".join(sys.path)}
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, env=environment)
    assert "MissingDependency 'pytracik' is not installed: ./rpbi setup" in done.stdout, done.stderr
