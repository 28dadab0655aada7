"""Exact shapes: meshes as they are, and boxes whose edges are sharp."""

from __future__ import annotations

import math
import sys
from itertools import product

import numpy as np
import pytest
from guarded_arm import guard_of

from custom_ros_tools.errors import MissingDependency
from robot_model.collision.shapes import Obstacle
from robot_model.geometry import Pose
from robot_model.model import RobotModel
from safe_robot.check import CheckContext
from safe_robot.checks.proximity_check import link_distances

PEG = """<robot name="peg"><link name="base"/>
  <joint name="x" type="prismatic"><parent link="base"/><child link="cart"/><axis xyz="1 0 0"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <link name="cart"/>
  <joint name="y" type="prismatic"><parent link="cart"/><child link="peg"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <link name="peg"><collision><geometry><box size="0.04 0.04 0.04"/></geometry></collision></link>
</robot>"""
MARGIN_M = 0.02
WALLS = ((-0.1, -0.12, -0.1), (0.1, -0.1, 0.1)), ((-0.1, 0.1, -0.1), (0.1, 0.12, 0.1))
TROUGH = (*WALLS, ((0.1, -0.12, -0.1), (0.12, 0.12, 0.1)))
"""Walls and a bottom from corners to corners: an U that is open towards -x, 20 cm wide inside."""
CASE = (((-0.2, -0.2, -0.2), (0.2, 0.2, 0.2)),)
FACES = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))


@pytest.fixture
def peg(tmp_path) -> RobotModel:
    path = tmp_path / "peg.urdf"
    path.write_text(PEG)
    return RobotModel(str(path))


def mesh_of(path, boxes) -> Obstacle:
    """Returns a mesh that is made of boxes, from corners to corners [m]."""
    lines = []
    for n, ends in enumerate(boxes):
        lines += [f"v {ends[x][0]} {ends[y][1]} {ends[z][2]}" for x, y, z in product((0, 1), repeat=3)]
        for face in FACES:
            a, b, c, d = (8 * n + 1 + i for i in face)
            lines += [f"f {a} {c} {b}", f"f {a} {d} {c}"]
    path.write_text("o mesh\n" + "\n".join(lines) + "\n")
    return Obstacle("mesh", "mesh", (1.0, 1.0, 1.0), Pose(), str(path))


def end_of(guard, start, target, around) -> list[float]:
    """Returns where a robot comes to rest that is sent from one place to another."""
    guard.halt()
    guard.start()
    guard.decide(start, around)
    command = start
    for _ in range(400):
        before, command = command, guard.decide(target, around).command
        if np.allclose(command, before, rtol=0.0, atol=1e-9):
            return list(command)
    raise AssertionError("it does not come to rest")


def distance(robot, obstacle, geometry, at) -> float:
    """Returns how far the peg is from an obstacle, as a check would have it, no more than the margin [m]."""
    distances = link_distances(robot, geometry)
    distances.place_obstacles([obstacle])
    distances.place(np.array(at))
    return min(distances.contact(("peg", 0), 10.0, MARGIN_M).distance, MARGIN_M)


def test_peg_enters_a_hollow_with_exact_geometry_but_not_hulls(peg, tmp_path):
    pytest.importorskip("hppfcl")
    pytest.importorskip("daqp")
    around = CheckContext(obstacles=(mesh_of(tmp_path / "trough.obj", TROUGH),))
    exact, hulls = (
        guard_of(peg, policy="limit", checks={"environment": {"margin_m": MARGIN_M, "geometry": geometry}})
        for geometry in ("exact", "hulls")
    )
    assert end_of(hulls, (-0.5, 0.0), (0.5, 0.0), around) == pytest.approx((-0.142, 0.0), abs=2e-3)
    inside = end_of(exact, (-0.5, 0.0), (0.5, 0.0), around)
    assert inside == pytest.approx((0.06, 0.0), abs=1e-3) and inside[0] <= 0.06
    beside = end_of(exact, tuple(inside), (0.0, 0.5), around)
    assert beside == pytest.approx((0.0, 0.06), abs=1e-3) and beside[1] <= 0.06
    refused = guard_of(peg, checks={"environment": {"margin_m": MARGIN_M, "geometry": "exact"}})
    refused.decide((0.0, 0.0599), around)
    found = refused.decide((0.0, 0.06005), around).violation
    assert found.subject == "link 'peg' and 'mesh'" and found.value == pytest.approx(0.01995, abs=1e-6), found


def test_body_inside_a_closed_mesh_is_in_collision(peg, tmp_path):
    pytest.importorskip("hppfcl")
    case, trough = mesh_of(tmp_path / "case.obj", CASE), mesh_of(tmp_path / "trough.obj", TROUGH)
    assert distance(peg, case, "exact", (0.0, 0.0)) < 0.0
    assert distance(peg, trough, "exact", (0.0, 0.0)) == MARGIN_M
    parts = mesh_of(tmp_path / "parts.obj", [((x, -0.02, -0.02), (x + 0.04, 0.02, 0.02)) for x in (-0.52, -0.02)])
    (tmp_path / "parts.urdf").write_text(
        PEG.replace('<box size="0.04 0.04 0.04"/>', f'<mesh filename="{parts.mesh_file}"/>')
    )
    dumb_bell = RobotModel(str(tmp_path / "parts.urdf"))
    assert distance(dumb_bell, case, "exact", (0.0, 0.0)) < 0.0, "its second part is inside"
    assert distance(dumb_bell, case, "exact", (0.25, 0.0)) == MARGIN_M, "the case is between its parts"


@pytest.mark.parametrize("geometry", ["hulls", "exact"])
def test_edges_of_boxes_count_as_sharp(peg, geometry):
    """PyBullet rounds them: corner to corner it measures 1.46 mm too much."""
    if geometry == "exact":
        pytest.importorskip("hppfcl")
    box = Obstacle("box", "box", (0.04, 0.04, 0.04), Pose((0.05, 0.05, 0.05)))
    far = math.sqrt(3.0) * 0.01
    found = distance(peg, box, geometry, (0.0, 0.0))
    assert found == pytest.approx(far, abs=1e-6) or geometry == "hulls" and far - 0.0015 < found <= far


def test_exact_geometry_without_its_library_names_the_install_command(peg, monkeypatch):
    monkeypatch.setitem(sys.modules, "hppfcl", None)
    monkeypatch.delitem(sys.modules, "robot_model.collision.exact", raising=False)
    with pytest.raises(MissingDependency, match="rpbi setup ik"):
        guard_of(peg, checks={"environment": {"geometry": "exact"}})
