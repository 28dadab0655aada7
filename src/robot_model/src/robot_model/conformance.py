"""Pytest tests that every kinematics library must pass; derive a class from `BackendConformance` to test a library."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

from .geometry import Pose, rotation_between
from .joint_map import Array
from .limits import Limits
from .model import RobotModel

CONFIGURATIONS = 10
"""Number of random configurations of each robot."""
SKEW = """<robot name="skew">
  <link name="root"/><link name="foot"/><link name="thigh"/><link name="plate"/><link name="rod"/><link name="tip"/>
  <joint name="stand" type="fixed">
    <parent link="root"/><child link="foot"/><origin xyz="0 0.2 0.1" rpy="0.3 0 1"/></joint>
  <joint name="hip" type="revolute">
    <parent link="foot"/><child link="thigh"/><origin xyz="0.1 0 0.2" rpy="0.5 -0.4 0.2"/>
    <axis xyz="1 2 -2"/><limit lower="-1.5" upper="2" effort="1" velocity="3"/></joint>
  <joint name="bolt" type="fixed">
    <parent link="thigh"/><child link="plate"/><origin xyz="0.3 0 0" rpy="0 1 0"/></joint>
  <joint name="push" type="prismatic">
    <parent link="plate"/><child link="rod"/><origin xyz="0 0 0.1" rpy="0 0 0.7"/>
    <axis xyz="0 0.6 0.8"/><limit lower="-0.1" upper="0.4" effort="1" velocity="0.5"/></joint>
  <joint name="roll" type="continuous">
    <parent link="rod"/><child link="tip"/><origin xyz="0 0.05 0.1"/><axis xyz="0 -1 0"/></joint>
</robot>"""
"""A robot with skew axes, a prismatic joint, a joint without limits, and fixed links."""
MIMIC = SKEW.replace('<axis xyz="0 -1 0"/>', '<axis xyz="0 -1 0"/><mimic joint="hip" multiplier="-0.5" offset="0.2"/>')
"""The robot `SKEW`, whose last joint mimics its first moving joint."""


class Backend(ABC):
    """A robot, loaded by the kinematics library that is tested.

    Attributes:
        joint_names: Names of the n joints, in any order.
        limits: Limits of the n joints, in the order of `joint_names`.
    """

    joint_names: Sequence[str]
    limits: Limits

    @abstractmethod
    def pose(self, q: Sequence[float], link: str) -> Pose:
        """Returns the pose of a link in the root frame, at n joint positions [rad or m]."""

    @abstractmethod
    def jacobian(self, q: Sequence[float], link: str) -> Array:
        """Returns the Jacobian of a link's origin in the root's axes, 6 x n: linear rows, then angular rows."""


class BackendConformance(ABC):
    """Tests that compare a kinematics library with `RobotModel`.

    Attributes:
        robots: Paths of URDFs to test, in addition to the robots of this module.
        follows_mimics: Whether the library moves mimic joints.
        tolerance: Largest difference between poses [m and rad].
        step: Step of the finite differences [rad or m]. Jacobians may differ by `step**2 + tolerance / step`.
    """

    robots: ClassVar[Sequence[str]] = ()
    follows_mimics: ClassVar[bool] = True
    tolerance: ClassVar[float] = 1e-9
    step: ClassVar[float] = 1e-5

    @abstractmethod
    def make(self, urdf_path: str) -> Backend:
        """Loads a URDF with the library."""

    @pytest.fixture
    def pairs(self, tmp_path: Path) -> list[tuple[RobotModel, Backend, list[int]]]:
        """Returns a tuple for each robot: the `RobotModel`, the library's robot, and a list of indices.

        For each joint of the library's robot, the list has the joint's index in `RobotModel.joint_names`.
        """
        paths = list(self.robots)
        for name, text in (("skew", SKEW), *((("mimic", MIMIC),) if self.follows_mimics else ())):
            path = tmp_path / f"{name}.urdf"
            path.write_text(text)
            paths.append(str(path))
        robots = [(RobotModel(path), self.make(path)) for path in paths]
        return [
            (robot, backend, [robot.joint_names.index(name) for name in backend.joint_names])
            for robot, backend in robots
        ]

    def configurations(self, robot: RobotModel) -> list[list[float]]:
        """Returns random configurations within the limits; joints are in the order of `RobotModel.joint_names`."""
        generator = np.random.default_rng(1)
        return [robot.limits.random(generator, robot.limits.middle) for _ in range(CONFIGURATIONS)]

    def test_joints_and_their_limits_are_those_of_the_urdf(
        self, pairs: list[tuple[RobotModel, Backend, list[int]]]
    ) -> None:
        """Joints and limits equal those of `RobotModel`: without mimic joints; continuous joints are unlimited."""
        for robot, backend, order in pairs:
            assert sorted(backend.joint_names) == sorted(robot.joint_names)
            expected = robot.limits.of(order)
            assert backend.limits.lower == pytest.approx(expected.lower)
            assert backend.limits.upper == pytest.approx(expected.upper)
            assert backend.limits.is_revolute == expected.is_revolute

    def test_links_are_where_the_urdf_says(self, pairs: list[tuple[RobotModel, Backend, list[int]]]) -> None:
        """For each link that a joint moves, the tested library and `RobotModel` compute the same pose."""
        for robot, backend, order in pairs:
            for q in self.configurations(robot):
                for link in _moved_links(robot):
                    expected, found = robot.pose(q, link), backend.pose([q[i] for i in order], link)
                    assert found.position == pytest.approx(expected.position, abs=self.tolerance), link
                    off = rotation_between(expected.quat_xyzw, found.quat_xyzw)
                    assert off == pytest.approx((0.0, 0.0, 0.0), abs=self.tolerance), link

    def test_jacobians_are_the_finite_differences_of_poses(
        self, pairs: list[tuple[RobotModel, Backend, list[int]]]
    ) -> None:
        """Each Jacobian column is the finite difference of poses, which includes the motion of mimic joints."""
        for robot, backend, order in pairs:
            q = np.array(self.configurations(robot)[0])[order]
            for link in _moved_links(robot):
                found = backend.jacobian(q.tolist(), link)
                for column, step in zip(found.T, self.step * np.eye(len(q))):
                    before, after = (backend.pose((q + each).tolist(), link) for each in (-step, step))
                    expected = _difference(before, after) / (2.0 * self.step)
                    np.testing.assert_allclose(column, expected, atol=self.step**2 + self.tolerance / self.step)


def _moved_links(robot: RobotModel) -> list[str]:
    return [link for link in robot.links if any(joint.is_moving for joint in robot.chain(link))]


def _difference(before: Pose, after: Pose) -> Array:
    moved = np.subtract(after.position, before.position)
    return np.concatenate((moved, rotation_between(before.quat_xyzw, after.quat_xyzw)))
