"""What is known of how a link behaves in contact and motion, and what a request would change of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple


class LinkDynamics(NamedTuple):
    """What PyBullet's `getDynamicsInfo` tells of a link, under the names of the message ObjectDynamics.

    Attributes:
        mass: Mass [kg], 0 for what never moves.
        lateral_friction: Coulomb friction coefficient.
        local_inertia_diagonal: Principal moments of inertia [kg m^2].
        local_inertia_pos: Centre of mass in the link's frame [m].
        local_inertia_orn: Principal axes in the link's frame, x, y, z, w.
        restitution: Bounciness.
        rolling_friction: Friction against rolling.
        spinning_friction: Friction about the contact normal.
        contact_damping: Damping of contacts [N s/m], -1 as long as it is not set.
        contact_stiffness: Stiffness of contacts [N/m], -1 as long as it is not set.
        body_type: PyBullet's: 1 rigid, 2 multi, 3 soft.
        collision_margin: Margin around the shape [m].
    """

    mass: float
    lateral_friction: float
    local_inertia_diagonal: Sequence[float]
    local_inertia_pos: Sequence[float]
    local_inertia_orn: Sequence[float]
    restitution: float
    rolling_friction: float
    spinning_friction: float
    contact_damping: float
    contact_stiffness: float
    body_type: int
    collision_margin: float


KEYS = {
    "mass": "mass",
    "lateral_friction": "lateralFriction",
    "local_inertia_diagonal": "localInertiaDiagonal",
    "restitution": "restitution",
    "rolling_friction": "rollingFriction",
    "spinning_friction": "spinningFriction",
    "contact_damping": "contactDamping",
    "contact_stiffness": "contactStiffness",
    "collision_margin": "collisionMargin",
}
"""PyBullet's argument for each field of LinkDynamics that can be changed."""


def difference(present: LinkDynamics, wanted: LinkDynamics) -> dict[str, Any]:
    """Returns what has to be changed, by PyBullet's name; empty lists ask for nothing.

    Raises:
        ValueError: If a value is not finite, negative, or cannot be changed; it names all such fields.
    """
    changed: dict[str, Any] = {}
    faults: list[str] = []
    for field in LinkDynamics._fields:
        old, new = _numbers(getattr(present, field)), _numbers(getattr(wanted, field))
        if new in (old, ()):
            continue
        if len(new) != len(old):
            faults.append(f"{field}: expected {len(old)} numbers or none, got {len(new)}")
        elif not all(map(math.isfinite, new)):
            faults.append(f"{field}: must be finite, got {_shown(new)}")
        elif field not in KEYS:
            faults.append(f"{field}: cannot be changed, expected {_shown(old)}, got {_shown(new)}")
        elif min(new) < 0:
            faults.append(f"{field}: must be >= 0, got {_shown(new)}")
        else:
            changed[KEYS[field]] = getattr(wanted, field)
    pair = {"contact_damping": wanted.contact_damping, "contact_stiffness": wanted.contact_stiffness}
    if not faults and any(KEYS[field] in changed for field in pair):
        for field, value in pair.items():
            if value < 0:
                faults.append(f"{field}: must be >= 0 when the other is set, got {value:g}")
            changed[KEYS[field]] = value
    if faults:
        raise ValueError("; ".join(faults))
    return changed


def _numbers(value: float | Sequence[float]) -> tuple[float, ...]:
    return tuple(value) if isinstance(value, Sequence) else (value,)


def _shown(values: tuple[float, ...]) -> str:
    return f"{values[0]:g}" if len(values) == 1 else str(list(values))
