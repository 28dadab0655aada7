"""Soft bodies in the renderer's copy of the world."""

from collections.abc import Sequence

from robot_model.geometry import Vector
from rpbi.bodies import Body
from rpbi.engine.client import Client

SHORTEST_STEP_S = 1e-9
"""Length of a step with negligible motion [s]."""


class SoftShapes:
    """Sets the shapes of soft bodies in a client without physics.

    PyBullet draws a soft body as it was after the last step, so there must be a step now and then.

    Args:
        pb: The client, whose world has just been set up.
    """

    def __init__(self, pb: Client) -> None:
        self._pb = pb
        if pb.is_deformable:
            pb.setGravity(0.0, 0.0, 0.0)
            pb.setTimeStep(SHORTEST_STEP_S)

    def still(self, body: Body) -> None:
        """Disables collisions and forces of a new body."""
        if self._pb.is_deformable:
            body.detach()
            for link in (-1, *body.joint_indices):
                self._pb.setCollisionFilterGroupMask(body.body_id, link, 0, 0)

    def show(self, nodes: Sequence[tuple[Body, Sequence[Vector]]]) -> None:
        """Sets corners of soft bodies; rigid bodies must be placed afterwards.

        Args:
            nodes: Soft bodies and the places of all of their simulated corners [m].
        """
        for body, places in nodes:
            self._pb.resetMeshData(body.body_id, places)
        self._pb.stepSimulation()
