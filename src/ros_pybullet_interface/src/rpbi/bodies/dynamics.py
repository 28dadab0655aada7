"""Reads and changes the dynamics of bodies and links while the world runs."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import pybullet
from pydantic.alias_generators import to_camel

from custom_ros_tools.errors import PhysicsError, UnknownNameError
from rpbi.config.pybullet_models import ChangeDynamics
from rpbi.engine.client import MAXIMAL_COORDINATES

from .body import Body


class LinkDynamics(NamedTuple):
    """Dynamics of a link, with the field names of the message ObjectDynamics.

    Attributes:
        mass: Mass [kg], 0 for static bodies.
        lateral_friction: Coulomb friction coefficient.
        local_inertia_diagonal: Principal moments of inertia [kg m^2].
        local_inertia_pos: Centre of mass [m] in the link's frame.
        local_inertia_orn: Orientation of the principal axes in the link's frame, quaternion x, y, z, w.
        restitution: Coefficient of restitution.
        rolling_friction: Coefficient of rolling friction.
        spinning_friction: Coefficient of friction about the contact normal.
        contact_damping: Damping of contacts [N s/m], -1 if it is not set.
        contact_stiffness: Stiffness of contacts [N/m], -1 if it is not set.
        body_type: PyBullet's body type: 1 rigid body (in maximal coordinates), 2 multi-body, 3 soft body.
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


_UNCHANGEABLE = ("local_inertia_pos", "local_inertia_orn", "body_type")
"""Fields of LinkDynamics that cannot be changed."""


def difference(present: LinkDynamics, wanted: LinkDynamics) -> dict[str, Any]:
    """Returns the wanted values that differ from the present ones, indexed by the argument names of `changeDynamics`.

    Args:
        present: The present dynamics.
        wanted: The wanted dynamics; a field whose value is an empty sequence stays unchanged.

    Raises:
        ValueError: If a wanted value has the wrong length, is not finite, is negative, or cannot be changed; the
            message names all such fields.
    """
    changed: dict[str, Any] = {}
    problems: list[str] = []
    for field in LinkDynamics._fields:
        old, new = _numbers(getattr(present, field)), _numbers(getattr(wanted, field))
        if new in (old, ()):
            continue
        if len(new) != len(old):
            problems.append(f"{field}: expected {len(old)} numbers or none, got {len(new)}")
        elif not all(map(math.isfinite, new)):
            problems.append(f"{field}: must be finite, got {_shown(new)}")
        elif field in _UNCHANGEABLE:
            problems.append(f"{field}: cannot be changed, expected {_shown(old)}, got {_shown(new)}")
        elif min(new) < 0:
            problems.append(f"{field}: must be >= 0, got {_shown(new)}")
        else:
            changed[to_camel(field)] = getattr(wanted, field)
    if not problems and changed.keys() & {"contactDamping", "contactStiffness"}:
        changed |= {"contactDamping": wanted.contact_damping, "contactStiffness": wanted.contact_stiffness}
        for field in ("contact_damping", "contact_stiffness"):
            if (value := getattr(wanted, field)) < 0:
                problems.append(f"{field}: must be >= 0 when the other is set, got {value:g}")
    if problems:
        raise ValueError("; ".join(problems))
    return changed


def _numbers(value: float | Sequence[float]) -> tuple[float, ...]:
    return tuple(value) if isinstance(value, Sequence) else (value,)


def _shown(values: tuple[float, ...]) -> str:
    return f"{values[0]:g}" if len(values) == 1 else str(list(values))


_OF_CONTACTS = (
    *("lateralFriction", "spinningFriction", "rollingFriction", "restitution", "contactStiffness", "contactDamping"),
    *("frictionAnchor", "ccdSweptSphereRadius", "contactProcessingThreshold", "anisotropicFriction", "collisionMargin"),
)
_OF_JOINTS = ("jointDamping", "maxJointVelocity", "jointLowerLimit", "jointUpperLimit", "jointLimitForce")


def link_index(body: Body, link: str) -> int:
    """Returns PyBullet's index of a link.

    Args:
        link: Name of the link; empty for the root link.

    Raises:
        UnknownNameError: If the body has no such link.
        ValueError: If the body is soft.
    """
    if body.is_soft:
        raise ValueError(f"'{body.name}' is soft: its material is set in its file and cannot be changed")
    known = [body.root_link, *map(body.link_name, body.link_indices)]
    name = link or body.root_link
    if name not in known:
        raise UnknownNameError(f"link of {body.name}", name, known)
    return next((index for index in body.joint_indices if body.link_name(index) == name), -1)


def read_dynamics(body: Body, link: str) -> LinkDynamics:
    """Returns the present dynamics of the link with a given name; an empty name is the root link.

    Raises:
        UnknownNameError: If the body has no such link.
        ValueError: If the body is soft.
    """
    return LinkDynamics(*body.dynamics_info(link_index(body, link)))


def change_dynamics(body: Body, link: str, change: ChangeDynamics) -> None:
    """Changes the dynamics of a link; if this raises an error, the dynamics are unchanged.

    If the change has a mass but no moments of inertia, these change in proportion to the mass. PyBullet alone would
    replace the moments from the URDF by moments computed from the collision shape.

    Args:
        link: Name of the link; empty for the root link.

    Raises:
        UnknownNameError: If the body has no such link.
        ValueError: If the body is soft, or keys are invalid for this link; the message names all such keys.
        PhysicsError: If PyBullet reports an error.
    """
    index = link_index(body, link)
    present = LinkDynamics(*body.dynamics_info(index))
    arguments = change.kwargs()
    if problems := _problems(body, index, present, arguments):
        raise ValueError("; ".join(problems))
    if "mass" in arguments:
        ratio = arguments["mass"] / present.mass
        arguments.setdefault("localInertiaDiagonal", [ratio * moment for moment in present.local_inertia_diagonal])
    try:
        body.change_dynamics(index, **arguments)
    except pybullet.error as error:
        raise PhysicsError(f"{body.name}: {error}") from error
    if arguments.keys() & _OF_CONTACTS:
        _renew_contacts(body, index)
    body.dynamics_changes += 1


def _renew_contacts(body: Body, index: int) -> None:
    """Makes PyBullet create the contacts of a link anew, since existing contacts would keep their old friction."""
    ends = {((touch[1], touch[3]), (touch[2], touch[4])) for touch in body.pb.getContactPoints(body.body_id)}
    for (body_a, link_a), (body_b, link_b) in sorted(ends):
        if (body.body_id, index) in ((body_a, link_a), (body_b, link_b)):
            for is_enabled in (0, 1):
                body.pb.setCollisionFilterPair(body_a, body_b, link_a, link_b, is_enabled)


def _problems(body: Body, index: int, present: LinkDynamics, arguments: dict[str, Any]) -> list[str]:
    """Returns a message for each argument of `changeDynamics` that is invalid for a link."""
    what = body.name if index < 0 else f"{body.name}/{body.link_name(index)}"
    problems = []
    if not present.mass:
        static = f"'{what}' is static, and stays so; add a dynamic object instead"
        problems += [f"{key}: {static}" for key in ("mass", "localInertiaDiagonal") if key in arguments]
    if present.mass and arguments.get("mass") == 0:
        problems.append("mass: must be > 0 [kg], got 0: a moving body cannot be made static")
    if present.mass and 0.0 in arguments.get("localInertiaDiagonal", ()):
        problems.append("localInertiaDiagonal: must be > 0 [kg m^2] each")
    if arguments.get("contactStiffness") == 0:
        problems.append("contactStiffness: must be > 0 [N/m], got 0: nothing would keep bodies apart")
    if present.body_type != MAXIMAL_COORDINATES and not body.pb.getCollisionShapeData(body.body_id, index):
        problems += [f"{key}: '{what}' has no collision shape" for key in arguments if key in _OF_CONTACTS]
    if index < 0 or body.pb.getJointInfo(body.body_id, index)[2] == pybullet.JOINT_FIXED:
        problems += [f"{key}: '{what}' is not below a moving joint" for key in arguments if key in _OF_JOINTS]
    return problems
