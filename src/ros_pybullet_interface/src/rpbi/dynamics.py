"""How bodies and links behave in contact and motion: reading it, and changing it while the world runs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pybullet

from custom_ros_tools.errors import PhysicsError, UnknownNameError

from .link_dynamics import LinkDynamics
from .pybullet_models import ChangeDynamics

if TYPE_CHECKING:
    from .bodies.body import Body

_OF_CONTACTS = (
    *("lateralFriction", "spinningFriction", "rollingFriction", "restitution", "contactStiffness", "contactDamping"),
    *("frictionAnchor", "ccdSweptSphereRadius", "contactProcessingThreshold", "anisotropicFriction", "collisionMargin"),
)
_OF_JOINTS = ("jointDamping", "maxJointVelocity", "jointLowerLimit", "jointUpperLimit", "jointLimitForce")


def link_index(body: Body, link: str) -> int:
    """Returns PyBullet's index of a link.

    Args:
        body: The body.
        link: Name of the link; empty for the root link.

    Raises:
        UnknownNameError: If the body has no such link.
        ValueError: If the body is soft.
    """
    if body.is_soft:
        raise ValueError(f"'{body.name}' is soft: what it is made of stands in its file and does not change")
    links = {body.pb.getJointInfo(body.body_id, index)[12].decode(): index for index in body.joint_indices}
    known = [body.root_link, *(name for name, index in links.items() if index in body.link_indices)]
    wanted = link or body.root_link
    if wanted not in known:
        raise UnknownNameError(f"link of {body.name}", wanted, known)
    return links.get(wanted, -1)


def read_dynamics(body: Body, link: str) -> LinkDynamics:
    """Returns how a link behaves now.

    Raises:
        UnknownNameError: If the body has no such link.
    """
    return LinkDynamics(*body.pb.getDynamicsInfo(body.body_id, link_index(body, link)))


def change_dynamics(body: Body, link: str, change: ChangeDynamics) -> None:
    """Changes how a link behaves; when it raises, nothing has changed.

    With the mass, moments of inertia change in proportion, unless they are given: PyBullet's own way, those of the
    collision shape, would forget the URDF's.

    Args:
        body: The body.
        link: Name of the link; empty for the root link.
        change: What to change.

    Raises:
        UnknownNameError: If the body has no such link.
        ValueError: If it makes no sense for this link; it names all such keys.
        PhysicsError: If PyBullet refuses.
    """
    index = link_index(body, link)
    present = LinkDynamics(*body.pb.getDynamicsInfo(body.body_id, index))
    arguments = change.kwargs()
    faults = _faults(body, index, present, arguments)
    if faults:
        raise ValueError("; ".join(faults))
    if "mass" in arguments:
        ratio = arguments["mass"] / present.mass
        arguments.setdefault("localInertiaDiagonal", [ratio * moment for moment in present.local_inertia_diagonal])
    try:
        body.pb.changeDynamics(body.body_id, index, **arguments)
    except pybullet.error as error:
        raise PhysicsError(f"{body.name}: {error}") from error
    if arguments.keys() & _OF_CONTACTS:
        _renew_contacts(body, index)
    body.dynamics_changes += 1


def _renew_contacts(body: Body, index: int) -> None:
    """Has PyBullet make the contacts of a link anew: those that last keep the friction that they began with."""
    ends = {((touch[1], touch[3]), (touch[2], touch[4])) for touch in body.pb.getContactPoints(body.body_id)}
    for (body_a, link_a), (body_b, link_b) in sorted(ends):
        if (body.body_id, index) in ((body_a, link_a), (body_b, link_b)):
            for is_enabled in (0, 1):
                body.pb.setCollisionFilterPair(body_a, body_b, link_a, link_b, is_enabled)


def _faults(body: Body, index: int, present: LinkDynamics, arguments: dict[str, Any]) -> list[str]:
    """Returns what a link cannot be given."""
    faults = []
    what = body.name if index < 0 else f"{body.name}/{body.pb.getJointInfo(body.body_id, index)[12].decode()}"
    for key in ("mass", "localInertiaDiagonal"):
        if key in arguments and not present.mass:
            faults.append(f"{key}: '{what}' is static, and stays so; add a dynamic object instead")
    if present.mass and arguments.get("mass") == 0:
        faults.append("mass: must be > 0 [kg], got 0: what moves cannot be made static")
    if present.mass and 0.0 in arguments.get("localInertiaDiagonal", ()):
        faults.append("localInertiaDiagonal: must be > 0 [kg m^2] each")
    if arguments.get("contactStiffness") == 0:
        faults.append("contactStiffness: must be > 0 [N/m], got 0: nothing would keep bodies apart")
    if not body.pb.getCollisionShapeData(body.body_id, index):
        faults += [f"{key}: '{what}' has no collision shape" for key in arguments if key in _OF_CONTACTS]
    if index < 0 or body.pb.getJointInfo(body.body_id, index)[2] == pybullet.JOINT_FIXED:
        faults += [f"{key}: '{what}' hangs on no joint that moves" for key in arguments if key in _OF_JOINTS]
    return faults
