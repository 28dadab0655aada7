"""Modified copies of a URDF for kinematics libraries."""

import copy
from collections.abc import Sequence

from robot_model.geometry import scaled

from .document import UrdfDocument
from .elements import (
    Element,
    UrdfJoint,
    as_read,
    end_of,
    inertial,
    joint_element,
    new_element,
    read_vector,
    text_of,
    words,
)


def without_shapes(document: UrdfDocument, links: Sequence[str] | None = None) -> str:
    """Returns the text of a URDF with all or some of the links, and the joints between them, but without shapes.

    The result loads in about 0.5 ms, while a robot with meshes may take 100 ms. Every link gets unit mass at the link's
    origin, so that PyBullet's centre-of-mass frames coincide with the link frames.

    Args:
        document: The URDF.
        links: Names of the links to keep; by default all.
    """
    root = document.root_link()
    kept = sorted((name for name in document.links if links is None or name in links), key=lambda name: name != root)
    ends = {*kept}
    every = document.joint_elements
    tied = (one for one in every if links is None or {end_of(one, "parent"), end_of(one, "child")} <= ends)
    joints = map(as_read, tied)
    bare = [new_element("link", inertial("1"), name=name) for name in kept]
    return text_of(new_element("robot", *bare, *joints, **document.root.attrib))


def with_limited_joints(document: UrdfDocument, base: str | None = None) -> str:
    """Returns the text of a URDF in which continuous joints become revolute joints with limits 0 and 0.

    Limits 0 and 0 mean that the joint is unlimited. Pinocchio represents such a joint by one number, instead of sine
    and cosine.

    Args:
        document: The URDF.
        base: Link that becomes the new root; by default, the root does not change.

    Raises:
        ValueError: If a joint between `base` and the old root is invalid; the message names the joint.
    """
    root = copy.deepcopy(document.root)
    if base is not None:
        _reroot(root, base)
    for joint in root.findall("joint"):
        if joint.get("type") == "continuous":
            joint.set("type", "revolute")
            if joint.find("limit") is None:
                joint.append(new_element("limit", effort="0", velocity="0"))
            for limit in joint.iterfind("limit"):
                limit.attrib.update(lower="0", upper="0")
    return text_of(root)


def chain_urdf(joints: Sequence[UrdfJoint]) -> str:
    """Returns the text of a URDF for a chain of joints, sorted from base to tip, with empty links."""
    links = [new_element("link", name=name) for name in (joints[0].parent, *(joint.child for joint in joints))]
    return text_of(new_element("robot", *links, *map(joint_element, joints), name="chain"))


def _reroot(robot: Element, base: str) -> None:
    """Makes the link `base` the root of a robot element by reversing all joints between `base` and the old root.

    Extra links and fixed joints are added, so that the same joint positions give the same poses as before.
    """
    above = {end_of(joint, "child"): joint for joint in robot.findall("joint")}
    link = base
    while (joint := above.pop(link, None)) is not None:
        name, parent = joint.get("name", ""), end_of(joint, "parent")
        x, y, z = read_vector(joint, "origin", "xyz", "0 0 0")
        roll, pitch, yaw = read_vector(joint, "origin", "rpy", "0 0 0")
        backwards = scaled(-1.0, read_vector(joint, "axis", "xyz", "1 0 0"))
        for part in ("origin", "axis", "parent", "child"):
            for element in joint.findall(part):
                joint.remove(element)
        # Reversed transform: the inverse joint motion, then the inverse origin as four fixed joints (-r, -p, -y, -xyz)
        steps = (
            ("rpy", (-roll, 0.0, 0.0)),
            ("rpy", (0.0, -pitch, 0.0)),
            ("rpy", (0.0, 0.0, -yaw)),
            ("xyz", (-x, -y, -z)),
        )
        ends = [*(f"{name}/{number}" for number in range(len(steps))), parent]
        joint.extend([new_element("parent", link=link), new_element("child", link=ends[0])])
        joint.append(new_element("axis", xyz=words(backwards)))
        for (kind, vector), start, end in zip(steps, ends, ends[1:]):
            between = [new_element("parent", link=start), new_element("child", link=end)]
            origin = new_element("origin", **{kind: words(vector)})
            robot.append(new_element("link", name=start))
            robot.append(new_element("joint", *between, origin, name=f"{start}/fixed", type="fixed"))
        link = parent
