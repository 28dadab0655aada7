"""Objects made of one visual and perhaps one collision shape."""

from collections.abc import Mapping
from typing import Any

from custom_ros_tools.errors import ConfigError, Problem
from rpbi.config.pybullet_models import CreateCollisionShape, CreateVisualShape, ObjectTf
from rpbi.engine.client import Client
from rpbi.engine.inputs import Input, PoseInput
from rpbi.geometry import Pose

from .body import Body
from .mesh_checks import mesh_problems


class ShapeObject(Body):
    """An object whose shape comes from `createVisualShape` and `createCollisionShape`.

    Args:
        pb: The client to create it in.
        name: Unique name.
        visual: Visual shape.
        collision: Collision shape, None for an object that nothing can touch.
        mass_kg: Mass [kg]; 0 keeps it in place whatever pushes it.
        pose: Pose in the world.
        object_tf: TF frame that it follows, if any.

    Raises:
        ConfigError: If a mesh is broken.
        PhysicsError: If PyBullet refuses.
    """

    def __init__(
        self,
        pb: Client,
        name: str,
        visual: CreateVisualShape,
        collision: CreateCollisionShape | None = None,
        mass_kg: float = 0.0,
        pose: Pose = Pose(),
        object_tf: ObjectTf | None = None,
    ) -> None:
        _check_meshes(name, createVisualShape=visual, createCollisionShape=collision)
        shapes: dict[str, Any] = {"baseVisualShapeIndex": pb.createVisualShape(**visual.kwargs())}
        if collision is not None:
            shapes["baseCollisionShapeIndex"] = pb.createCollisionShape(**collision.kwargs())
        body_id = pb.createMultiBody(
            baseMass=mass_kg, basePosition=pose.position, baseOrientation=pose.quat_xyzw, **shapes
        )
        super().__init__(pb, name, body_id)
        self.visual = visual
        self._object_tf = object_tf

    def inputs(self) -> Mapping[str, Input]:
        """Takes `pose`, the pose of the TF frame that it follows, if it follows one."""
        return {} if self._object_tf is None else {"pose": PoseInput.following(self._object_tf, self.set_base_pose)}


def _check_meshes(name: str, **shapes: CreateVisualShape | CreateCollisionShape | None) -> None:
    problems = [
        Problem(name, f"{function}.{key}", message)
        for function, shape in shapes.items()
        if shape is not None
        for key, message in mesh_problems(shape)
    ]
    if problems:
        raise ConfigError(problems)
