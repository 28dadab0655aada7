"""A small robot whose inverse kinematics are known, for solvers of `ik_ros`."""

from __future__ import annotations

from pathlib import Path

from ik_ros.chain.solver import ChainSolver
from ik_ros.lookup import make_solver

PLANAR = """<robot name="planar">
  <link name="base"/><link name="upper"/><link name="lower"/><link name="hand"/>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/><axis xyz="0 0 1"/>
    <origin xyz="0.5 0 0"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="wrist" type="{wrist}"><parent link="lower"/><child link="hand"/><axis xyz="0 0 1"/>
    <origin xyz="0.5 0 0"/>{more}</joint>
</robot>"""
"""Two arms of 0.5 m in a plane, and a wrist."""
LIMITED = '<limit lower="-3" upper="3" effort="1" velocity="1"/>'


def planar_arm(
    folder: Path,
    wrist: str = "revolute",
    more: str = LIMITED,
    solver: str = "kdl",
    base: str = "base",
    **options: object,
) -> ChainSolver:
    """Returns a solver for the arm.

    Args:
        folder: Where its URDF may be written.
        wrist: Type of the wrist.
        more: Further elements of the wrist.
        solver: Name of the solver.
        base: Its base link.
        **options: Its further options.
    """
    path = folder / "planar.urdf"
    path.write_text(PLANAR.format(wrist=wrist, more=more))
    solver_options = {"urdf_filename": str(path), "base_link": base, "tip_link": "hand", **options}
    made = make_solver(solver, solver_options)
    assert isinstance(made, ChainSolver)
    return made
