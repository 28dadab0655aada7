"""External forces and torques on the links of a body."""

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
"""Duration [s], in the world's time, for which a wrench received on a topic acts, unless a newer wrench replaces it."""


class ExternalWrench(NamedTuple):
    """A force and a torque on a link.

    Attributes:
        force: Force [N].
        torque: Torque [N m].
        link: `LINK` or `BODY/LINK`; empty or `BODY` for the root link.
        point: Point of application, in the link's URDF frame [m].
        in_link_axes: Whether force and torque are given in the link's axes, and so rotate with the link. If not, they
            are given in the world's axes.
        duration_s: Duration in the world's time [s]; None to act until another wrench replaces this one.
    """

    force: Vector
    torque: Vector = (0.0, 0.0, 0.0)
    link: str = ""
    point: Vector = (0.0, 0.0, 0.0)
    in_link_axes: bool = False
    duration_s: float | None = None


class ExternalWrenches:
    """Applies external wrenches to one body. A new wrench on a link replaces the link's previous wrench.

    Args:
        body: The body. The constructor reads properties of this object, but keeps no reference to the object.

    Attributes:
        can_act: Whether at least one link of the body can move.
        loads: Wrenches that were applied for the last step.
    """

    def __init__(self, body: Any) -> None:
        self._pb, self._body_id, self._name, self._root_link = body.pb, body.body_id, body.name, body.root_link
        self._dt_s: float = self._pb.getPhysicsEngineParameters()["fixedTimeStep"]
        self._acting: dict[int, tuple[ExternalWrench, float]] = {}
        """Wrench and number of remaining ticks, keyed by PyBullet's link index."""
        self.loads: list[LinkWrench] = []
        static = self._pb.getDynamicsInfo(body.body_id, -1)[0] == 0.0
        links = [body.root_link, *map(body.link_name, body.link_indices)]
        indices = {body.link_name(index): index for index in (-1, *body.joint_indices)}
        self._indices = {link: indices[link] for link in links}
        self._movable = {link for link, index in self._indices.items() if index >= 0 or not static}
        self.can_act = bool(self._movable)

    @property
    def acts(self) -> bool:
        """Whether at least one wrench acts in the next tick."""
        return bool(self._acting)

    def check(self, given: ExternalWrench | Mapping[str, Any]) -> ExternalWrench:
        """Checks a wrench, and returns the wrench with `link` as a plain link name. Any thread may call this method.

        Args:
            given: A wrench, or a mapping of the fields of `ExternalWrench`.

        Raises:
            UnknownNameError: If the body has no such link.
            ValueError: If the link cannot move, a number is not finite or too large, or the duration is not positive.
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
        """Applies a wrench returned by `check`, from the next tick on, and wakes the body if it sleeps.

        A wrench with zero force and zero torque ends the previous wrench on the link.
        """
        index = self._indices[wrench.link]
        if not any(wrench.force) and not any(wrench.torque):
            self._acting.pop(index, None)
            return
        ticks = math.inf if wrench.duration_s is None else max(1, round(wrench.duration_s / self._dt_s))
        self._acting[index] = wrench, ticks
        self._pb.changeDynamics(self._body_id, -1, activationState=pybullet.ACTIVATION_STATE_WAKE_UP)

    def apply(self, link_pose: Callable[[int], Pose]) -> None:
        """Applies the wrenches for one tick. PyBullet clears external forces after each step.

        Args:
            link_pose: Function from PyBullet's link index to the pose of the link's URDF frame in the world frame.
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
