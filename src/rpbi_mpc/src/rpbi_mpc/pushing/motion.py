"""Motion of slider and round pusher in the plane, in contact or apart, by a velocity of the pusher."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .model import response
from .slider import SliderConfig

CONTACT_GAP = 1e-6
"""Distance below which pusher and slider touch [m]."""


class Scene(NamedTuple):
    """Slider and pusher in the plane.

    Attributes:
        slider: Pose x, y, yaw [m, m, rad] of the slider.
        pusher: Position x, y of the middle of the pusher [m].
    """

    slider: np.ndarray
    pusher: np.ndarray

    @classmethod
    def of(cls, values: np.ndarray) -> Scene:
        """Returns the scene of the numbers x, y, yaw, pusher_x, pusher_y."""
        return cls(np.array(values[:3], dtype=float), np.array(values[3:5], dtype=float))

    @property
    def values(self) -> np.ndarray:
        """The numbers x, y, yaw, pusher_x, pusher_y."""
        return np.concatenate([self.slider, self.pusher])


def rotation(yaw: float) -> np.ndarray:
    """Returns the 2 x 2 matrix from the axes of the slider to those of the table."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    return np.array([[cos, -sin], [sin, cos]])


def pusher_in_slider(scene: Scene) -> np.ndarray:
    """Returns the position of the pusher in the frame of the slider [m]."""
    offset: np.ndarray = rotation(scene.slider[2]).T @ (scene.pusher - scene.slider[:2])
    return offset


def gap_and_contact(scene: Scene, slider: SliderConfig, radius: float) -> tuple[float, float]:
    """Returns the distance between pusher and face, and the place of the pusher along the face [m, m].

    The distance is that of a face without ends, and negative if the pusher is in the slider.
    """
    x, y = pusher_in_slider(scene)
    return -x - slider.face - radius, y


def moved(
    scene: Scene, velocity: np.ndarray, duration_s: float, slider: SliderConfig, radius: float, steps: int = 4
) -> Scene:
    """Returns the scene after the pusher has moved at a velocity for a time, by the quasi-static model.

    Args:
        scene: Before.
        velocity: Velocity of the pusher in the axes of the table [m/s].
        duration_s: The time [s].
        slider: The slider.
        radius: Radius of the pusher [m].
        steps: Number of steps of integration.
    """
    pose, pusher = scene.slider.copy(), scene.pusher.copy()
    step_s = duration_s / steps
    for _ in range(steps):
        pusher = pusher + step_s * np.asarray(velocity)
        gap, contact = gap_and_contact(Scene(pose, pusher), slider, radius)
        if gap >= -CONTACT_GAP or abs(contact) > slider.width / 2 or gap < -slider.length:
            continue
        axes = rotation(pose[2])
        pushed = np.array([-gap / step_s, (axes.T @ np.asarray(velocity))[1]])
        twist, _, _ = response((*pose, contact), pushed, slider)
        pose = pose + step_s * np.array([*(axes @ twist[:2]), twist[2]])
    return Scene(pose, pusher)
