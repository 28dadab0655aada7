"""External forces and torques on the links of a body, for a time or until they are replaced."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import pybullet

from custom_ros_tools.errors import UnknownNameError
from robot_model.geometry import Vector, plus
from robot_model.limits import MAX_MAGNITUDE
from rpbi.geometry import LinkWrench, Pose, rotated
from rpbi.plain_values import as_tuple

TIMEOUT_S = 0.5
"""Duration of a wrench received by topic [s] of the world's time; it ends then unless renewed."""


class ExternalWrench(NamedTuple):
    """A force and a torque on a link.

    Attributes:
        force: Force [N].
        torque: Torque [N m].
        link: Name of the link, perhaps with `NAME/` of the body before it; empty or NAME for the root link.
        point: Where the force acts, in the link's URDF frame [m].
        in_link_axes: Whether force and torque have the link's axes and turn with it, else those of the world.
        duration_s: For how long [s] of the world's time; None until another one replaces it.
    """

    force: Vector
    torque: Vector = (0.0, 0.0, 0.0)
    link: str = ""
    point: Vector = (0.0, 0.0, 0.0)
    in_link_axes: bool = False
    duration_s: float | None = None


class ExternalWrenches:
    """External wrenches on one body; a link has one, and a newer one replaces it.

    Args:
        body: The body; it is not kept.

    Attributes:
        can_act: Whether one of its links can move.
        loads: Wrenches that acted in the last step.
    """

    def __init__(self, body: Any) -> None:
        self._pb, self._body_id, self._name, self._root_link = body.pb, body.body_id, body.name, body.root_link
        self._dt_s: float = self._pb.getPhysicsEngineParameters()["fixedTimeStep"]
        self._acting: dict[int, tuple[ExternalWrench, float]] = {}
        """By PyBullet's index of the link: the wrench, and for how many more ticks."""
        self.loads: list[LinkWrench] = []
        static = self._pb.getDynamicsInfo(body.body_id, -1)[0] == 0.0
        links = [body.root_link, *map(body.link_name, body.link_indices)]
        indices = {body.link_name(index): index for index in (-1, *body.joint_indices)}
        self._indices = {link: indices[link] for link in links}
        self._movable = {link for link, index in self._indices.items() if index >= 0 or not static}
        self.can_act = bool(self._movable)

    @property
    def acts(self) -> bool:
        """Whether a wrench acts in the next tick."""
        return bool(self._acting)

    def check(self, given: ExternalWrench | Mapping[str, Any]) -> ExternalWrench:
        """Returns a wrench with the name of its link, from one or a mapping of its fields; any thread may call it.

        Raises:
            UnknownNameError: If the body has no such link.
            ValueError: If the link is static, or a number is not finite or too large.
        """
        name, wrench = self._name, as_tuple(ExternalWrench, given)
        link = wrench.link.removeprefix(f"{name}/") if wrench.link != name else ""
        link = link or self._root_link
        if link not in self._indices:
            raise UnknownNameError(f"link of {name}", link, list(self._indices))
        if link not in self._movable:
            raise ValueError(f"'{name}/{link}' is static, no force moves it")
        for name, values in (("force", wrench.force), ("torque", wrench.torque), ("point", wrench.point)):
            if not all(map(math.isfinite, values)):
                raise ValueError(f"{name} must be finite, got {tuple(values)}")
            if max(map(abs, values)) > MAX_MAGNITUDE:
                raise ValueError(f"{name} must be within +-{MAX_MAGNITUDE:g}, got {tuple(values)}")
        duration_s = wrench.duration_s
        if duration_s is not None and not (math.isfinite(duration_s) and duration_s > 0.0):
            raise ValueError(f"duration must be > 0 [s], got {duration_s:g}")
        return wrench._replace(link=link)

    def set(self, wrench: ExternalWrench) -> None:
        """Applies a checked wrench from the next tick on; one without force and torque ends the previous one.

        Sleeping bodies are woken.
        """
        index = self._indices[wrench.link]
        if not any(wrench.force) and not any(wrench.torque):
            self._acting.pop(index, None)
            return
        ticks = math.inf if wrench.duration_s is None else max(1, round(wrench.duration_s / self._dt_s))
        self._acting[index] = wrench, ticks
        self._pb.changeDynamics(self._body_id, -1, activationState=pybullet.ACTIVATION_STATE_WAKE_UP)

    def apply(self, link_pose: Callable[[int], Pose]) -> None:
        """Applies the wrenches for a tick: PyBullet clears forces after each step.

        Args:
            link_pose: Returns the pose of a link's URDF frame in the world by PyBullet's index.
        """
        self.loads = [_load(index, wrench, link_pose(index)) for index, (wrench, _) in self._acting.items()]
        for link, force, torque, point in self.loads:
            self._pb.applyExternalForce(self._body_id, link, force, point, pybullet.WORLD_FRAME)
            self._pb.applyExternalTorque(self._body_id, link, torque, pybullet.WORLD_FRAME)
        self._acting = {index: (wrench, left - 1) for index, (wrench, left) in self._acting.items() if left > 1}


def _load(index: int, wrench: ExternalWrench, pose: Pose) -> LinkWrench:
    force, torque = wrench.force, wrench.torque
    if wrench.in_link_axes:
        force, torque = rotated(pose.quat_xyzw, force), rotated(pose.quat_xyzw, torque)
    return LinkWrench(index, force, torque, plus(pose.position, rotated(pose.quat_xyzw, wrench.point)))
