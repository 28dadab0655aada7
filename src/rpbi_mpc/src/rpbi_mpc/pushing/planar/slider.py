"""The slider: its size, its friction, and the limit surface of its support."""

from __future__ import annotations

import math
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from custom_ros_tools.schema import ConfigModel, PositiveMetres

QUADRATURE = 64
"""Points along each side of the rectangle for the integral of the pressure; the relative error is 1e-4."""


class SliderConfig(ConfigModel):
    """A box on a table, pushed at its face at -x.

    The origin of its frame is in its middle; x is forwards, y to the left.

    Attributes:
        length: Size along x [m].
        width: Size along y [m].
        friction: Coefficient of friction between pusher and slider.
        support: Where the weight rests: `uniform` over the area, or on the `corners`, as in a simulator whose contacts
            of two boxes are four points.
        margin: Least distance of the pusher from the ends of the face [m].
    """

    length: PositiveMetres = Field(0.1, description="Size along x, the direction of pushing.")
    width: PositiveMetres = Field(0.1, description="Size along y.")
    friction: Annotated[float, Field(gt=0.0, le=2.0)] = Field(0.3, description="Friction between pusher and slider.")
    support: Literal["uniform", "corners"] = Field(
        "corners", description="Where the weight rests: over the area, or on the corners as in PyBullet."
    )
    margin: PositiveMetres = Field(0.01, description="Least distance of the pusher from the ends of the face.")

    @property
    def face(self) -> float:
        """Distance of the pushed face from the middle [m]."""
        return self.length / 2

    @property
    def reach(self) -> float:
        """Largest distance of the pusher from the middle of the face [m]."""
        return max(self.width / 2 - self.margin, 0.0)

    @property
    def characteristic_length(self) -> float:
        """Ratio of the largest moment of friction about the middle to the largest force [m].

        It is the mean distance of the supporting points from the middle, weighted by their pressure, and the ratio of
        the half axes of the ellipsoidal limit surface (S. Goyal, A. Ruina and J. Papadopoulos, "Planar sliding with
        dry friction", Wear 143, 1991; K. Lynch, H. Maekawa and K. Tanie, "Manipulation and active sensing by pushing
        using tactile feedback", IROS 1992).
        """
        if self.support == "corners":
            return math.hypot(self.length, self.width) / 2
        middles = (np.arange(QUADRATURE) + 0.5) / QUADRATURE - 0.5
        return float(np.hypot(*np.meshgrid(self.length * middles, self.width * middles)).mean())
