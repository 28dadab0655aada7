"""Quasi-static model of a slider that a pusher moves through one contact, with an ellipsoidal limit surface.

Friction with the table and the force of the pusher are in balance. The limit surface is the set of all loads under
which a body slides. The ellipsoid (fx/f)^2 + (fy/f)^2 + (m/(f c))^2 = 1 approximates the limit surface, with the
largest friction force f and the characteristic length c. The twist is normal to the ellipsoid (K. Lynch, H. Maekawa
and K. Tanie, IROS 1992). A force is expressed as the speed that this force causes [m/s]. A load (fx, fy, m) then causes
the twist (fx, fy, m / c^2) in the slider's frame.

The contact sticks, or slides to one side of the face while the force is at the edge of the friction cone (F. Hogan and
A. Rodriguez, "Feedback control of the pusher-slider system", WAFR 2016, and "Reactive planar non-prehensile
manipulation with hybrid model predictive control", IJRR 39, 2020).

All functions take numbers, NumPy arrays or symbols of CasADi. The state is (x, y, yaw, contact). x, y and yaw are the
pose of the slider in the plane [m, m, rad]. `contact` is the position of the pusher along the face at -x, from the
middle of the face to the left [m]. The input is (normal, tangential, left, right). The first two numbers are the
components of the force [m/s]. `left` and `right` are the speeds at which the pusher slides to either side [m/s].
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from custom_ros_tools.schema import ConfigModel, PositiveMetres

QUADRATURE = 64
"""Number of points along each side of the rectangle for the integral of the pressure. The relative error is 1e-4."""
STATE = ("x", "y", "yaw", "contact")
INPUT = ("normal", "tangential", "left", "right")
Vector = Any
"""A sequence, an array or a CasADi vector of numbers or symbols."""


class SliderConfig(ConfigModel):
    """A box on a table. The pusher pushes against the face on the box's -x side.

    The origin of the box's frame is the middle of the box; x points forwards, y to the left.

    Attributes:
        length: Size along x [m].
        width: Size along y [m].
        friction: Coefficient of friction between pusher and slider.
        support: Distribution of the supporting pressure: `uniform` over the area, or at the four `corners`. Simulators
            that represent the contact between two boxes with four points correspond to `corners`.
        margin: Least distance of the pusher from the ends of the face [m].
    """

    length: PositiveMetres = Field(0.1, description="Size of the slider along x, the direction of pushing.")
    width: PositiveMetres = Field(0.1, description="Size of the slider along y.")
    friction: Annotated[float, Field(gt=0.0, le=2.0)] = Field(
        0.3, description="Coefficient of friction between pusher and slider."
    )
    support: Literal["uniform", "corners"] = Field(
        "corners",
        description="Distribution of the pressure under the slider: `uniform` over the area, or at the four "
        "`corners` as in PyBullet.",
    )
    margin: PositiveMetres = Field(0.01, description="Least distance of the pusher from the ends of the pushed face.")

    @property
    def face(self) -> float:
        """Distance of the pushed face from the middle of the box [m]."""
        return self.length / 2

    @property
    def reach(self) -> float:
        """Largest distance of the pusher from the middle of the face [m]."""
        return max(self.width / 2 - self.margin, 0.0)

    @property
    def characteristic_length(self) -> float:
        """Ratio of the largest friction moment about the middle to the largest friction force [m].

        This length is the mean distance of the supporting points from the middle, weighted with the pressure. The
        length is also the ratio of the half axes of the ellipsoidal limit surface. Sources: S. Goyal, A. Ruina and J.
        Papadopoulos, "Planar sliding with dry friction", Wear 143, 1991; K. Lynch, H. Maekawa and K. Tanie,
        "Manipulation and active sensing by pushing using tactile feedback", IROS 1992.
        """
        if self.support == "corners":
            return math.hypot(self.length, self.width) / 2
        middles = (np.arange(QUADRATURE) + 0.5) / QUADRATURE - 0.5
        return float(np.hypot(*np.meshgrid(self.length * middles, self.width * middles)).mean())


def load_of(contact: Any, normal: Any, tangential: Any, slider: SliderConfig) -> tuple[Any, Any, Any]:
    """Returns the load that a contact force exerts, in the slider's frame: force x, y [m/s], and moment [m^2/s].

    As in the whole module, a force is expressed as the speed that it causes. The moment about the slider's middle is
    such a force times a lever arm.
    """
    return normal, tangential, -slider.face * tangential - contact * normal


def twist_of(load: Vector, slider: SliderConfig) -> tuple[Any, Any, Any]:
    """Returns the slider's twist under a load, in the slider's frame [m/s, m/s, rad/s].

    The twist is the normal of the limit surface at the load.
    """
    return load[0], load[1], load[2] / slider.characteristic_length**2


def load_for(twist: Vector, slider: SliderConfig) -> tuple[Any, Any, Any]:
    """Returns the load under which the slider moves with a given twist. Inverse of `twist_of`. Units: see `load_of`."""
    return twist[0], twist[1], twist[2] * slider.characteristic_length**2


def rates(state: Vector, control: Vector, slider: SliderConfig) -> tuple[Any, Any, Any, Any]:
    """Returns the time derivative of the state (x, y, yaw, contact) under an input."""
    yaw, contact = state[2], state[3]
    along, across, turning = twist_of(load_of(contact, control[0], control[1], slider), slider)
    cos, sin = _cos_sin(yaw)
    return cos * along - sin * across, sin * along + cos * across, turning, control[2] - control[3]


def advanced(state: Vector, control: Vector, duration_s: Any, slider: SliderConfig) -> list[Any]:
    """Returns the state after an input has acted for `duration_s` [s], computed with the midpoint rule."""
    middle = [value + duration_s / 2 * rate for value, rate in zip(_items(state), rates(state, control, slider))]
    return [value + duration_s * rate for value, rate in zip(_items(state), rates(middle, control, slider))]


def pusher_velocity(state: Vector, control: Vector, slider: SliderConfig) -> tuple[Any, Any]:
    """Returns the pusher's velocity in the slider's axes [m/s]: the contact point's velocity plus the sliding speed."""
    contact = state[3]
    along, across, turning = twist_of(load_of(contact, control[0], control[1], slider), slider)
    return along - turning * contact, across - turning * slider.face + control[2] - control[3]


def complementarity(control: Vector, slider: SliderConfig) -> Any:
    """Returns how much an input violates the contact's rule [m^2/s^2]; 0 if the input obeys the rule.

    The rule: the contact slides to the left only if the force is at the left edge of the friction cone, and to the
    right only if the force is at the right edge. For forces within the cone, the returned violation is never negative.
    `PushingProgram` penalises the violation instead of requiring 0, similar to the relaxed complementarity of J. Moura,
    T. Stouraitis and S. Vijayakumar, "Non-prehensile planar manipulation via trajectory optimization with
    complementarity constraints", ICRA 2022.
    """
    normal, tangential, left, right = _items(control)
    return (slider.friction * normal - tangential) * left + (slider.friction * normal + tangential) * right


def response(
    state: Vector, velocity: Vector, slider: SliderConfig
) -> tuple[tuple[float, float, float], tuple[float, float], float]:
    """Returns the motion of the slider that a velocity of the touching pusher causes.

    The contact sticks if the required force is in the friction cone, that is, if the velocity is in the motion cone (M.
    Mason, "Mechanics and planning of manipulator pushing operations", IJRR 5, 1986). Otherwise, the contact slides, and
    the force is at the edge of the cone. A pusher that moves away does not move the slider.

    Args:
        state: (x, y, yaw, contact).
        velocity: Velocity of the pusher in the slider's axes [m/s].
        slider: The slider.

    Returns:
        The slider's twist in its own frame [m/s, m/s, rad/s], the force (normal, tangential) [m/s], and the speed at
        which the pusher slides to the left along the face [m/s].
    """
    contact, square = float(state[3]), slider.characteristic_length**2
    mobility = np.array(  # maps the force at the contact to the contact's velocity
        [
            [1.0 + contact**2 / square, contact * slider.face / square],
            [contact * slider.face / square, 1.0 + slider.face**2 / square],
        ]
    )
    wanted = np.asarray(velocity, dtype=float)
    force = np.linalg.solve(mobility, wanted)
    if abs(force[1]) > slider.friction * force[0]:
        edge = np.array([1.0, np.copysign(slider.friction, force[1])])
        force = max(wanted[0], 0.0) / (mobility[0] @ edge) * edge
    sliding = float(wanted[1] - mobility[1] @ force) if wanted[0] > 0.0 else float(wanted[1])
    twist = twist_of(load_of(contact, force[0], force[1], slider), slider)
    return (float(twist[0]), float(twist[1]), float(twist[2])), (float(force[0]), float(force[1])), sliding


def _cos_sin(angle: Any) -> tuple[Any, Any]:
    """Returns cosine and sine of an angle.

    For a CasADi symbol, calls the symbol's methods, since NumPy's functions would cause warnings.
    """
    return (angle.cos(), angle.sin()) if hasattr(angle, "cos") else (np.cos(angle), np.sin(angle))


def _items(vector: Vector) -> list[Any]:
    """Returns the four entries of a vector as a list, since CasADi vectors cannot be iterated over."""
    return [vector[index] for index in range(4)]
