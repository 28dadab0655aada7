"""The service that puts a body somewhere."""

from __future__ import annotations

from custom_ros_tools.srv import SetTransformRequest, SetTransformResponse

from ..inputs import PoseInput, check_pose
from ..pose import Pose
from .body_context import BodyContext


def set_pose(context: BodyContext, request: SetTransformRequest) -> SetTransformResponse:
    """Puts the base link's frame at a pose in the world, at rest, whatever is in the way.

    Raises:
        ValueError: If the pose is not finite, or the body follows a TF frame, which would take it back.
    """
    position, quat = request.transform.translation, request.transform.rotation
    pose = check_pose(Pose((position.x, position.y, position.z), (quat.x, quat.y, quat.z, quat.w)))
    body = context.body
    for taken in body.inputs().values():
        if isinstance(taken, PoseInput):
            raise ValueError(f"'{body.name}' follows the TF frame '{taken.tf_id}': move that")
    context.act("teleport", pose)
    return SetTransformResponse(success=True, message=f"'{body.name}' was put there")
