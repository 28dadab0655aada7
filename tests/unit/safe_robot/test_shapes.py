"""Both libraries that measure distances between collision shapes have the same answers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from robot_model.collision.distances import LinkDistances
from robot_model.collision.shapes import Obstacle
from robot_model.conformance import MIMIC
from robot_model.geometry import Pose
from robot_model.model import RobotModel
from safe_robot.checks import proximity_check
from safe_robot.checks.proximity_check import link_distances

KUKA = str(Path(__file__).resolve().parents[3] / "src/rpbi_examples/robots/kuka_lwr.urdf")
RADII_M = {"root": 0.05, "thigh": 0.02, "rod": 0.03, "tip": 0.04}
OFF_M = (0.01, 0.02, 0.03)
"""Place of each sphere in its link."""
MARGINS_M = 3e-3
"""PyBullet adds 1 mm to each convex mesh, and its edges are round."""


@pytest.fixture(params=["bullet", "fcl"])
def library(request, monkeypatch) -> str:
    choose(request.param, monkeypatch)
    return request.param


def choose(name: str, monkeypatch) -> None:
    if name == "fcl":
        pytest.importorskip("hppfcl")
    monkeypatch.setattr(proximity_check, "find_spec", lambda _: True if name == "bullet" else None)


@pytest.fixture
def robot(tmp_path) -> RobotModel:
    """A robot with a sphere on some links; its last joint mimics its first one."""
    text = MIMIC
    for link, radius in RADII_M.items():
        place = "<origin xyz='{} {} {}'/>".format(*OFF_M)
        shape = f"<collision>{place}<geometry><sphere radius='{radius}'/></geometry></collision>"
        text = text.replace(f'<link name="{link}"/>', f'<link name="{link}">{shape}</link>')
    (tmp_path / "balls.urdf").write_text(text)
    return RobotModel(str(tmp_path / "balls.urdf"))


def configurations(robot: RobotModel, count: int) -> np.ndarray:
    generator = np.random.default_rng(3)
    return np.array([robot.limits.random(generator, robot.limits.middle) for _ in range(count)])


def centre(robot: RobotModel, q: np.ndarray, link: str) -> np.ndarray:
    frame, pose = robot.frames.place(link)
    return (robot.frames.at(q[None])[0, frame] @ pose @ (*OFF_M, 1.0))[:3]


def test_distance_of_spheres_is_centre_distance_minus_radii(library, robot):
    measured = link_distances(robot)
    assert measured.links == tuple(RADII_M)
    for q in configurations(robot, 5):
        measured.place(q)
        for first, second in (("root", "rod"), ("thigh", "tip"), ("root", "tip")):
            apart = np.linalg.norm(centre(robot, q, first) - centre(robot, q, second))
            expected = apart - RADII_M[first] - RADII_M[second]
            assert measured.distance((first, second), 10.0) == pytest.approx(expected, abs=2e-6)


def test_an_obstacle_is_where_it_was_put_and_goes(library, robot):
    measured, q = link_distances(robot), np.zeros(2)
    measured.place(q)
    at = centre(robot, q, "tip") + (0.0, 0.0, 0.5)
    ball = Obstacle("ball", "sphere", (0.2, 0.2, 0.2), Pose(tuple(at.tolist())))
    assert measured.place_obstacles([ball]) == [0]
    assert measured.distance(("tip", 0), 10.0) == pytest.approx(0.5 - 0.1 - 0.04, abs=2e-6)
    moved = ball._replace(pose=Pose(tuple((at + (0.0, 0.0, 0.1)).tolist())))
    assert measured.place_obstacles([moved]) == [0] and measured.place_obstacles([moved]) == []
    assert measured.distance(("tip", 0), 10.0) == pytest.approx(0.6 - 0.1 - 0.04, abs=2e-6)
    assert measured.place_obstacles([]) == []


def test_gradients_are_the_finite_differences_of_distances(library, robot):
    measured, pair, step = link_distances(robot), ("root", "tip"), 1e-3
    for q in configurations(robot, 5):
        measured.place(q)
        gradient = measured.gradient(pair, measured.contact(pair, 10.0), q)
        for i, each in enumerate(step * np.eye(len(q))):
            there, back = (_distance(measured, q + way, pair) for way in (each, -each))
            assert gradient[i] == pytest.approx((there - back) / (2.0 * step), abs=2e-3)


def _distance(measured: LinkDistances, q: np.ndarray, pair: tuple[str, str]) -> float:
    measured.place(q)
    return measured.distance(pair, 10.0)


def test_hulls_of_meshes_are_as_far_apart_in_both_libraries(monkeypatch):
    robot, both = RobotModel(KUKA), []
    for name in ("bullet", "fcl"):
        choose(name, monkeypatch)
        both.append(link_distances(robot))
    links = both[0].links
    assert links == both[1].links
    pairs = [(first, second) for i, first in enumerate(links) for second in links[i + 2 :]]
    for q in configurations(robot, 10):
        found = np.array([[_distance(each, q, pair) for pair in pairs] for each in both])
        assert (np.abs(found[0] - found[1])[found[0] > 0.0] < MARGINS_M).all()
