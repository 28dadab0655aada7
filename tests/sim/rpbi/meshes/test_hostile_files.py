"""Broken and hostile files: whoever reads them takes them or says what is wrong, and does nothing else.

`dev/robustness/hostile_files/try_files.py` reads a thousand; here is a share of each kind.
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from ros_system import support_on_path
from worlds import ball, write_world

from custom_ros_tools.errors import ConfigError
from ik_ros.tasks.robot import PinocchioRobot
from robot_model.model import RobotModel
from robot_model.urdf.document import UrdfDocument
from rpbi.bodies.urdf_object import UrdfObject
from rpbi.kinematics import Kinematics
from rpbi.meshes import trial
from rpbi.meshes.trial import Mesh, Use
from rpbi.urdf.loading import urdf_problems
from rpbi.world import World
from rpbi.world.loading import load_world

ROOT = Path(__file__).resolve().parents[4]
sys.path.append(str(ROOT / "dev"))

from robustness.hostile_files.files import KINDS  # noqa: E402

FIRST_SEED, EACH = 1000, 8


def _verdicts(folder, *kinds):
    program = str(ROOT / "dev/robustness/hostile_files/verdicts.py")
    command = [sys.executable, program, "alone", str(folder), str(FIRST_SEED), str(EACH), *kinds]
    done = subprocess.run(command, capture_output=True, text=True, env={**os.environ, **support_on_path()}, check=True)
    return [json.loads(line) for line in done.stdout.splitlines() if line.startswith("[")]


@pytest.mark.quick
@pytest.mark.parametrize("kind", KINDS)
def test_a_hostile_file_is_taken_or_refused_in_words(tmp_path, kind):
    found = _verdicts(tmp_path, kind)
    assert len(found) == EACH
    assert {verdict for *_, verdict, _ in found} <= {"taken", "refused"}, found
    assert any(verdict == "refused" for *_, verdict, _ in found)


def test_without_care_such_files_crash_and_run_code(tmp_path):
    assert {(kind, verdict) for kind, *_, verdict, _ in _verdicts(tmp_path, "controls")} == {
        ("urdf", "signal 11"),
        ("bag", "code"),
    }


LINK, MASSES = '<link name="{}"/>', '<link name="{}"><inertial><mass value="{}"/></inertial></link>'
JOINT = '<joint name="{}" type="{}"><parent link="{}"/><child link="{}"/></joint>'


def _urdf(*parts):
    return f'<robot name="r">{"".join(parts)}</robot>'


def _links(*names):
    return "".join(map(LINK.format, names))


def _chain(joints, kind):
    ties = "".join(JOINT.format(f"j{index}", kind, index, index + 1) for index in range(joints))
    return _urdf(_links(*range(joints + 1)), ties)


FAULTS = {
    "two roots": (_urdf(_links("a", "b")), "expected one link that is no joint's child, got a, b: is a joint missing?"),
    "two parents": (
        _urdf(_links("a", "b", "c"), JOINT.format("j", "fixed", "a", "b"), JOINT.format("k", "fixed", "c", "b")),
        "link 'b' is the child of two joints; the second is 'k'",
    ),
    "joints of one name": (
        _urdf(_links("a", "b", "c"), JOINT.format("j", "fixed", "a", "b"), JOINT.format("j", "fixed", "b", "c")),
        "2 joints are called 'j'; names are unique",
    ),
    "its own parent": (_urdf(_links("a", "b"), JOINT.format("j", "fixed", "b", "b")), "connects link 'b' to itself"),
    "a circle": (
        _urdf(_links("a", "b", "c"), JOINT.format("j", "fixed", "b", "c"), JOINT.format("k", "fixed", "c", "b")),
        "link 'b' is its own ancestor",
    ),
    "no such link": (
        _urdf(_links("a"), JOINT.format("j", "fixed", "a", "x")),
        "connects link 'x', which does not exist",
    ),
    "a long name": (_urdf(_links("a" * 5000)), "link.name: expected at most 250 bytes, got 5000: 'aaa"),
    "a robot's long name": (
        _urdf(_links("a")).replace('"r"', f'"{"r" * 1100}"'),
        "robot.name: expected at most 250 bytes, got 1100",
    ),
    "a long text": (
        _urdf(_links("a"), f'<material name="{"m" * 2000}"/>'),
        "material.name: expected at most 250 bytes",
    ),
    "a format": (_urdf(_links("%p %p")), "link.name: expected a text without % and control characters, got '%p %p'"),
    "a format as a type": (
        _urdf(_links("a", "b"), JOINT.format("j", "%n", "a", "b")),
        "joint.type: expected a text without % and control characters, got '%n'",
    ),
    "a format as an axis": (
        _urdf(_links("a", "b"), JOINT.format("j", "revolute", "a", "b").replace("><", '><axis xyz="%s%n"/><', 1)),
        "axis.xyz: expected a text without % and control characters, got '%s%n'",
    ),
    "a format as a material": (_urdf(_links("a"), '<material name="%n"/>'), "material '%n': material.name: expected"),
    "a terminal's sequence": (_urdf(_links("a&#27;[2J&#10;").replace("&#27;", "\x7f")), r"got 'a\x7f[2J\n'"),
    "no type": (
        _urdf(_links("a", "b"), JOINT.format("j", "fixed", "a", "b").replace("type", "kind")),
        "joint 'j': type: expected one of revolute, continuous, prismatic, fixed, floating, planar, spherical, got ''",
    ),
    "a text for a number": (_urdf(MASSES.format("a", "heavy")), "mass.value: expected numbers, got 'heavy'"),
    "nothing for a number": (_urdf(MASSES.format("a", "")), "mass.value: expected numbers, got ''"),
    "two numbers for three": (
        _urdf(_links("a", "b"), JOINT.format("j", "revolute", "a", "b").replace("><", '><axis xyz="0 1"/><', 1)),
        "axis.xyz: expected three numbers, got '0 1'",
    ),
    "too many joints": (_chain(128, "revolute"), "expected at most 127 joints that are not fixed, got 128"),
    "too many links": (_chain(2000, "fixed"), "expected at most 2000 links and as many joints, got 2001 links"),
    "no name": (_urdf(_links("")), "a link has no name"),
    "xacro": (_urdf(MASSES.format("a", "${mass}")), "'${mass}' is unexpanded xacro"),
    "mass nan": (_urdf(MASSES.format("a", "nan")), "link 'a': mass.value: expected finite numbers, got 'nan'"),
    "a huge mass": (_urdf(MASSES.format("a", "1e300")), "mass.value: must be within +-1e+09, got '1e300'"),
    "less than no mass": (_urdf(MASSES.format("a", "-1")), "mass.value: must be >= 0 [kg], got '-1'"),
    "far away": (
        _urdf(
            _links("a", "b"),
            '<joint name="j" type="fixed"><origin xyz="1e300 0 0"/><parent link="a"/><child link="b"/></joint>',
        ),
        "joint 'j': origin.xyz: must be within +-1e+06",
    ),
    "no mesh": (
        _urdf('<link name="a"><collision><geometry><mesh filename="no.obj"/></geometry></collision></link>'),
        "no such mesh: no.obj (searched the folder of the URDF and all folders above)",
    ),
    "deep": ("<robot>" + "<a>" * 100_000, "is not XML: "),
    "deep, and closed": ("<robot>" + "<a>" * 20_000 + "</a>" * 20_000 + "</robot>", "in at most 100 others"),
    "too long": ("<robot>" + " " * 2_000_000 + "</robot>", "expected at most 2000000"),
    "comments that never end": ("<!-- " * 390_000, "is not XML"),
    "robots that never begin": ("<robot" * 300_000, "is not XML"),
    "robots that never end": ("<robot>" + "</robot " * 200_000, "is not XML"),
    "meshes that never end": (_urdf(_links("a")) + "<mesh " * 300_000 + "</robot>", "is not XML"),
}
"""Some of them took a time that grows with the square of their length."""


@pytest.mark.parametrize("case", FAULTS)
def test_faults_of_a_urdf_are_named(tmp_path, case):
    text, told = FAULTS[case]
    path = tmp_path / "robot.urdf"
    path.write_text(text)
    problems = urdf_problems(str(path))
    assert any(told in problem for problem in problems), problems
    assert all(problem.startswith(str(path)) and len(problem) < 1000 for problem in problems)


def test_valid_urdf_has_no_problems(tmp_path):
    path = tmp_path / "robot.urdf"
    weighed = MASSES.format("a", "1e0 ").replace("</inertial>", '<inertia ixx="1" iyy="1" izz="1"/></inertial>')
    path.write_text(_urdf(weighed, LINK.format("b"), JOINT.format("a", "fixed", "a", "b")))
    assert urdf_problems(str(path)) == [] and UrdfDocument(str(path)).root_link() == "a"


@pytest.mark.parametrize("reader", [RobotModel, PinocchioRobot, Kinematics])
def test_no_reader_takes_joints_by_the_hundred(tmp_path, reader):
    links = "".join(f"<link name='l{number}'/>" for number in range(502))
    ends = (f"<parent link='l{number}'/><child link='l{number + 1}'/>" for number in range(501))
    joints = "".join(f"<joint name='j{number}' type='continuous'>{each}</joint>" for number, each in enumerate(ends))
    (tmp_path / "robot.urdf").write_text(f"<robot name='r'>{links}{joints}</robot>")
    with pytest.raises(ConfigError, match="joints that are not fixed, got 501"):
        reader(str(tmp_path / "robot.urdf"))


class LoadsByItself(UrdfObject):
    """A type of another package that has PyBullet load its file."""

    def __init__(self, pb, config):
        pb.loadURDF(config.loadURDF.fileName)


@pytest.mark.parametrize("kind", ["urdf", f"{__name__}:LoadsByItself"])
def test_urdf_of_every_kind_of_body_is_checked_before_loading(tmp_path, kind):
    path = tmp_path / "robot.urdf"
    path.write_text(FAULTS["two parents"][0])
    with (
        contextlib.closing(World(load_world(write_world(tmp_path)))) as world,
        pytest.raises(ConfigError, match="is the child of two joints"),
    ):
        world.add(kind, {"name": "it", "loadURDF": {"fileName": str(path)}})


VISUAL, COLLISION = "createVisualShape", "createCollisionShape"
BROKEN = {
    "visual, no scene": (VISUAL, "no.dae", "<COLLADA/>", r"PyBullet crashes when it loads it \(SIG\w+\)"),
    "collision, no scene": (COLLISION, "no.dae", "<COLLADA/>", "PyBullet cannot load it"),
    "visual, nothing": (VISUAL, "empty.obj", "# nothing", "PyBullet cannot load it: it reads nothing from it"),
    "collision, nothing": (COLLISION, "empty.obj", "# nothing", "PyBullet cannot load it"),
    "corners that there are not": (
        COLLISION,
        "few.obj",
        "v 0 0 0\nf 1 1 9",
        "PyBullet cannot load it: a face names 'v' 9",
    ),
}


@pytest.mark.parametrize("case", BROKEN)
def test_mesh_that_would_crash_pybullet_is_refused_and_named(tmp_path, case):
    key, name, text, told = BROKEN[case]
    (tmp_path / name).write_text(text)
    thing = {**ball(), key: {"shapeType": "GEOM_MESH", "fileName": name}}
    with pytest.raises(ConfigError, match=rf"{key}.fileName: {told}.*: .*{name}"):
        World(load_world(write_world(tmp_path, dynamic=(thing,))))


def test_a_mesh_that_went_well_is_not_tried_again(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    mesh = Mesh(Use.URDF_COLLISION, str(tmp_path / "some.obj"))
    Path(mesh.file).write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 3 4\nf 1 2 4\nf 2 3 4\n")
    monkeypatch.setattr(trial, "_tried", set())
    assert trial.faults_in([mesh]) == {}
    assert len(list((tmp_path / "cache/rpbi/meshes").iterdir())) == 1
    monkeypatch.setattr(trial, "_tried", set())
    monkeypatch.setattr(sys, "executable", "/bin/false")
    assert trial.faults_in([mesh]) == {}, "no process was started"
    Path(mesh.file).write_text("v 0 0 0\n")
    assert list(trial.faults_in([mesh])) == [mesh], "another content is another mesh"
