"""Private parameters of `ik_solver_node.py`."""

from __future__ import annotations

from pydantic import Field

from custom_ros_tools.node_parameters import StartParameters

from .continuity import ContinuityConfig


class SolverNodeParameters(StartParameters):
    """Private parameters of the node itself; all others are the solver's."""

    base_frame_id: str = Field("", description="TF frame of the solver's base; empty takes poses as they are.")
    continuity: ContinuityConfig | None = Field(None, description="Keeps targets within the velocities of the joints.")
