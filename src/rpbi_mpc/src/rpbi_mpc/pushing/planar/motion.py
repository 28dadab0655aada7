"""Predicts the motion of slider and round pusher in the plane, and computes the pusher's approach to the slider."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import Field

from custom_ros_tools.schema import ConfigModel, Positive, PositiveMetres, Unit

from .model import SliderConfig, response

CONTACT_GAP = 1e-6
"""Depth of penetration above which the pusher moves the slider [m]."""


class PlanarScene(NamedTuple):
    """Slider and pusher in the plane.

    Attributes:
        slider: Pose x, y, yaw [m, m, rad] of the slider.
        pusher: Position x, y of the middle of the pusher [m].
    """

    slider: np.ndarray
    pusher: np.ndarray

    @classmethod
    def of(cls, values: np.ndarray) -> PlanarScene:
        """Returns the scene with the numbers x, y, yaw, pusher_x, pusher_y [m, rad]."""
        return cls(np.array(values[:3], dtype=float), np.array(values[3:5], dtype=float))

    @property
    def values(self) -> np.ndarray:
        """The numbers x, y, yaw, pusher_x, pusher_y as an array of shape (5,) [m, rad]."""
        return np.concatenate([self.slider, self.pusher])


def rotation(yaw: float) -> np.ndarray:
    """Returns the matrix that rotates vectors from the slider's axes to the table's axes, shape (2, 2)."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    return np.array([[cos, -sin], [sin, cos]])


def pusher_in_slider(scene: PlanarScene) -> np.ndarray:
    """Returns the position x, y of the pusher in the slider's frame [m]."""
    offset: np.ndarray = rotation(scene.slider[2]).T @ (scene.pusher - scene.slider[:2])
    return offset


def gap_and_contact(scene: PlanarScene, slider: SliderConfig, radius: float) -> tuple[float, float]:
    """Returns the distance between pusher and face, and the pusher's position on the face, positive to the left [m, m].

    The distance is measured to the infinite line through the face, and is negative on the slider's side of this line.
    """
    x, y = pusher_in_slider(scene)
    return -x - slider.face - radius, y


def moved(
    scene: PlanarScene, velocity: np.ndarray, duration_s: float, slider: SliderConfig, radius: float, steps: int = 4
) -> PlanarScene:
    """Predicts the scene after the pusher has moved at constant velocity, with the quasi-static model.

    Args:
        scene: Scene before the motion.
        velocity: Velocity of the pusher in the axes of the table [m/s].
        duration_s: Duration of the motion [s].
        slider: The slider.
        radius: Radius of the pusher [m].
        steps: Number of integration steps.
    """
    pose, pusher = scene.slider.copy(), scene.pusher.copy()
    step_s = duration_s / steps
    for _ in range(steps):
        pusher = pusher + step_s * np.asarray(velocity)
        gap, contact = gap_and_contact(PlanarScene(pose, pusher), slider, radius)
        if gap >= -CONTACT_GAP or abs(contact) > slider.width / 2 or gap < -slider.length:
            continue
        axes = rotation(pose[2])
        pushed = np.array([-gap / step_s, (axes.T @ np.asarray(velocity))[1]])
        twist, _, _ = response((*pose, contact), pushed, slider)
        pose = pose + step_s * np.array([*(axes @ twist[:2]), twist[2]])
    return PlanarScene(pose, pusher)


class ApproachConfig(ConfigModel):
    """Motion of the pusher to the slider.

    Attributes:
        speed: Largest speed of the pusher [m/s].
        clearance: Distance from the face at which the pusher moves along the face [m].
        gap: Largest distance from the face at which a push starts [m]. A push ends at three times this distance.
        rate: Ratio of the pusher's velocity to the distance still to be covered [1/s]. The velocity towards the face
            additionally has a constant part, a quarter of `speed`. The total velocity is limited to `speed`.
    """

    speed: Annotated[Positive, Unit("m/s")] = Field(0.1, description="Largest speed of the pusher.")
    clearance: PositiveMetres = Field(
        0.02, description="Distance from the face at which the pusher moves parallel to the face."
    )
    gap: PositiveMetres = Field(
        0.004,
        description="Largest distance from the face at which a push starts. A push ends at three times this distance.",
    )
    rate: Annotated[Positive, Unit("1/s")] = Field(
        5.0, description="Ratio of the pusher's velocity to the distance still to be covered."
    )


def is_pushable(gap: float, contact: float, slider: SliderConfig, config: ApproachConfig, pushes: bool) -> bool:
    """Returns whether the pusher's position is suitable for pushing the slider.

    Args:
        gap: Distance of the pusher from the face [m], negative inside the slider.
        contact: Position of the pusher along the face [m].
        slider: The slider.
        config: Limit of the gap.
        pushes: Whether the pusher was already pushing. If so, larger distances from face and middle are accepted.
    """
    slack = 3.0 if pushes else 1.0
    beside = slider.width / 2 if pushes else slider.reach
    return -slider.face < gap <= slack * config.gap and abs(contact) <= beside


def approach_velocity(scene: PlanarScene, slider: SliderConfig, radius: float, config: ApproachConfig) -> np.ndarray:
    """Returns the velocity with which the pusher approaches the face, in the table's axes, shape (2,) [m/s].

    A pusher beside the slider first moves back, then parallel to the face at the distance `clearance`, and finally
    towards the face.
    """
    gap, contact = gap_and_contact(scene, slider, radius)
    beyond = contact - np.clip(contact, -slider.reach / 2, slider.reach / 2)
    if abs(contact) <= slider.reach:
        wanted = np.array([max(gap, 0.0) * config.rate + 0.25 * config.speed, -config.rate * beyond])
    elif gap < config.clearance / 2:
        wanted = np.array([-config.speed, 0.0])
    else:
        wanted = np.array([config.rate * (gap - config.clearance), -config.rate * beyond])
    speed = float(np.hypot(*wanted))
    velocity: np.ndarray = rotation(scene.slider[2]) @ (wanted * min(1.0, config.speed / max(speed, 1e-9)))
    return velocity
