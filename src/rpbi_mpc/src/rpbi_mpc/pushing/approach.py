"""The way of the pusher to the face that it pushes."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field

from custom_ros_tools.schema import ConfigModel, Positive, PositiveMetres, Unit

from .motion import Scene, gap_and_contact, rotation
from .slider import SliderConfig


class ApproachConfig(ConfigModel):
    """Motion of a pusher that does not touch.

    Attributes:
        speed: Its speed [m/s].
        clearance: Distance from the face at which the pusher passes along it [m].
        gap: Distance from the face below which the pusher counts as touching [m]; while pushing, three times as much.
        rate: Rate at which it approaches points, which slows it down before them [1/s].
    """

    speed: Annotated[Positive, Unit("m/s")] = Field(0.1, description="Speed of the pusher.")
    clearance: PositiveMetres = Field(0.02, description="Distance from the face at which it passes along it.")
    gap: PositiveMetres = Field(0.004, description="Distance below which it counts as touching.")
    rate: Annotated[Positive, Unit("1/s")] = Field(5.0, description="Rate at which it approaches points.")


def is_pushable(gap: float, contact: float, slider: SliderConfig, config: ApproachConfig, pushes: bool) -> bool:
    """Returns whether the pusher is where it can push.

    Args:
        gap: Distance from the face [m], negative inside.
        contact: Place along the face [m].
        slider: The slider.
        config: Distances.
        pushes: Whether it did so before; then a larger distance is accepted.
    """
    slack = 3.0 if pushes else 1.0
    beside = slider.width / 2 if pushes else slider.reach
    return -slider.face < gap <= slack * config.gap and abs(contact) <= beside


def approach_velocity(scene: Scene, slider: SliderConfig, radius: float, config: ApproachConfig) -> np.ndarray:
    """Returns the velocity of a pusher on its way to the face, in the axes of the table [m/s].

    A pusher beside the slider moves back first, then along the face at some distance, and then on to the face.
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
