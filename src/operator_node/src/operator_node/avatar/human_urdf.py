"""Creates the URDF of a person, and reads the segments' origins from the URDF of an avatar."""

import math
import tempfile
from collections.abc import Iterator, Sequence

import numpy as np

from custom_ros_tools.errors import ConfigError, Problem
from operator_node.mvn.segments import PARENTS, SEGMENTS
from robot_model.urdf.document import UrdfDocument

from . import anthropometry as table
from .anthropometry import Array
from .joints import HINGES, JOINTS, HumanJoint

HEIGHTS_M, MASSES_KG = (0.5, 2.5), (3.0, 300.0)
"""Allowed ranges of height and mass."""
MIN_LENGTH_M = 1e-3
"""Smallest allowed distance between the origins of a segment and its parent [m]."""
HELPER_MASS_KG, HELPER_INERTIA = 0.01, 1e-4
"""Mass [kg] and inertia [kg m^2] of the links between a joint's hinges. The segment's mass is reduced accordingly."""
MAX_SPEED = 20.0
"""Largest speed of each hinge [rad/s]."""
_SKIN, _CLOTHES, _SHOES = "0.87 0.72 0.60 1", "0.25 0.37 0.55 1", "0.20 0.20 0.22 1"
_BARE = ("Neck", "Head", "Hand")
_TIPS = {
    "Shoulder": "UpperArm",
    "UpperArm": "ForeArm",
    "ForeArm": "Hand",
    "UpperLeg": "LowerLeg",
    "LowerLeg": "Foot",
    "Neck": "Head",
}
"""Next segment, whose origin is the end of a limb. Names are without the side."""


def human_urdf(height_m: float, mass_kg: float, offsets: Array | None = None) -> str:
    """Returns the URDF of a person. Links are named as in `SEGMENTS`, joints as in `HINGES`.

    All joints are at 0 in the T-pose. The frame of a link equals the frame of its segment. Each segment has a simple
    shape for display and collision. The shape's thickness follows from the segment's mass, length and density.

    Args:
        height_m: Height of the person [m].
        mass_kg: Mass of the person [kg].
        offsets: Origin of each segment in its parent's frame (23 x 3) [m], such as from `measured_offsets`; by default
            from the tables.

    Raises:
        ValueError: If height or mass is out of range, or an offset is invalid.
    """
    for what, unit, value, (least, most) in (("height", "m", height_m, HEIGHTS_M), ("mass", "kg", mass_kg, MASSES_KG)):
        if not least <= value <= most:
            raise ValueError(f"{what}: expected {least:g} to {most:g} {unit}, got {value:g}")
    offsets = table.segment_offsets(height_m) if offsets is None else _checked(offsets, height_m)
    lines = [
        '<?xml version="1.0"?>',
        f"<!-- A person of {height_m:g} m and {mass_kg:g} kg, by human_urdf.py of the package operator_node. -->",
        '<robot name="human">',
        *_link("Pelvis", offsets, height_m, mass_kg, helpers=0),
    ]
    for joint in JOINTS:
        lines += _joint(joint, offsets[SEGMENTS.index(joint.child)])
        lines += _link(joint.child, offsets, height_m, mass_kg, helpers=2)
    return "\n".join([*lines, "</robot>", ""])


def _checked(offsets: Array, height_m: float) -> Array:
    offsets = np.array(offsets, dtype=float)
    if offsets.shape != (len(SEGMENTS), 3) or not np.isfinite(offsets).all():
        raise ValueError(f"offsets: expected {len(SEGMENTS)} x 3 finite numbers")
    lengths = np.linalg.norm(offsets, axis=1)
    for name, parent, length in zip(SEGMENTS, PARENTS, lengths):
        if parent >= 0 and not MIN_LENGTH_M <= length <= height_m:
            between = f"from {SEGMENTS[parent]} to {name}"
            raise ValueError(f"offsets: expected {MIN_LENGTH_M:g} to {height_m:g} m {between}, got {length:g}")
    return offsets


def _joint(joint: HumanJoint, offset: Array) -> Iterator[str]:
    """Yields the URDF lines of a joint: three hinges, and the two links between the hinges."""
    first, second = f"{joint.child}_f1", f"{joint.child}_f2"
    ends = ((joint.parent, first), (first, second), (second, joint.child))
    for number, ((parent, child), hinge, axis, (low, high)) in enumerate(
        zip(ends, joint.hinges, joint.order, joint.limits)
    ):
        if number:
            yield f'  <link name="{parent}">'
            yield from _inertial(HELPER_MASS_KG, np.zeros(3), HELPER_INERTIA * np.eye(3))
            yield "  </link>"
        yield f'  <joint name="{hinge}" type="revolute">'
        yield f'    <parent link="{parent}"/>'
        yield f'    <child link="{child}"/>'
        yield f'    <origin xyz="{_text(np.zeros(3) if number else offset)}" rpy="0 0 0"/>'
        yield f'    <axis xyz="{" ".join("1" if axis == each else "0" for each in "xyz")}"/>'
        limits = f'lower="{_number(low)}" upper="{_number(high)}" effort="{joint.effort:g}" velocity="{MAX_SPEED:g}"'
        yield f"    <limit {limits}/>"
        yield "  </joint>"


def _link(name: str, offsets: Array, height_m: float, mass_kg: float, helpers: int) -> Iterator[str]:
    mass = table.MASS_PERCENT[name] / 100.0 * mass_kg
    volume = mass / table.DENSITY[name]
    limb = name.removeprefix("Right").removeprefix("Left")
    own_mass = mass - helpers * HELPER_MASS_KG
    colour = _SHOES if limb in ("Foot", "Toe") else _SKIN if limb in _BARE else _CLOTHES
    yield f'  <link name="{name}">'
    if limb == "Head":
        radius = (volume * 0.75 / math.pi) ** (1.0 / 3.0)
        crown = (1.0 - table.NECK_SHARE) * table.HEAD_AND_NECK * height_m
        centre = np.array((0.0, 0.0, max(crown - radius, 0.0)))
        yield from _inertial(own_mass, centre, 0.4 * own_mass * radius**2 * np.eye(3))
        yield from _shapes(colour, [_sphere(radius, centre)])
    elif limb in _TIPS or limb == "Hand":
        tip = _tip_of(name, limb, offsets, height_m)
        length = float(np.linalg.norm(tip))
        radius = math.sqrt(volume / (math.pi * length))
        yield from _inertial(own_mass, *_limb_inertia(limb, own_mass, tip, radius))
        yield from _shapes(colour, [_cylinder(radius, tip), _sphere(radius, np.zeros(3)), _sphere(radius, tip)])
    else:
        centre, size = _box_of(name, limb, offsets, height_m, volume)
        x, y, z = size**2
        yield from _inertial(own_mass, centre, own_mass / 12.0 * np.diag((y + z, x + z, x + y)))
        yield from _shapes(colour, [f'<origin xyz="{_text(centre)}"/><geometry><box size="{_text(size)}"/></geometry>'])
    yield "  </link>"


def _tip_of(name: str, limb: str, offsets: Array, height_m: float) -> Array:
    """Returns the vector from a limb's origin to its tip [m]. A hand has the direction of its forearm."""
    if limb == "Hand":
        forearm = offsets[SEGMENTS.index(name)]
        return np.asarray(forearm * table.HAND * height_m / np.linalg.norm(forearm))
    return np.asarray(offsets[SEGMENTS.index(name.removesuffix(limb) + _TIPS[limb])])


def _limb_inertia(limb: str, mass: float, tip: Array, radius: float) -> tuple[Array, Array]:
    """Returns the centre of mass (3) [m] and the inertia about this centre (3 x 3) [kg m^2] of a limb.

    A limb that is not in the table is treated as a cylinder.
    """
    length = float(np.linalg.norm(tip))
    along = np.outer(tip, tip) / length**2
    if limb in table.GYRATION:
        centre, k_across, k_along = table.GYRATION[limb]
        across_2, along_2 = (k_across * length) ** 2, (k_along * length) ** 2
    else:
        centre, across_2, along_2 = 0.5, radius**2 / 4.0 + length**2 / 12.0, radius**2 / 2.0
    return centre * tip, mass * (along_2 * along + across_2 * (np.eye(3) - along))


def _box_of(name: str, limb: str, offsets: Array, height_m: float, volume: float) -> tuple[Array, Array]:
    """Returns centre and size of the box that represents a segment of the trunk or a foot [m]."""
    sole, breadth = table.ANKLE_HEIGHT * height_m, table.FOOT_BREADTH * height_m
    if limb in ("Foot", "Toe"):
        toe = offsets[SEGMENTS.index(name.replace("Foot", "Toe"))]
        back = -table.HEEL * height_m if limb == "Foot" else 0.0
        front = float(toe[0]) if limb == "Foot" else (table.FOOT_LENGTH - table.HEEL - table.BALL) * height_m
        ground = -sole if limb == "Foot" else -sole - float(toe[2])
        thick = volume / ((front - back) * breadth)
        return np.array(((front + back) / 2.0, 0.0, ground + thick / 2.0)), np.array((front - back, breadth, thick))
    next_up = {"Pelvis": "L5", "L5": "L3", "L3": "T12", "T12": "T8", "T8": "Neck"}[name]
    length = float(np.linalg.norm(offsets[SEGMENTS.index(next_up)]))
    breadth = (table.HIP_BREADTH if name == "Pelvis" else table.CHEST_BREADTH) * height_m
    return offsets[SEGMENTS.index(next_up)] / 2.0, np.array((volume / (length * breadth), breadth, length))


def _inertial(mass: float, centre: Array, inertia: Array) -> Iterator[str]:
    names = (("ixx", 0, 0), ("ixy", 0, 1), ("ixz", 0, 2), ("iyy", 1, 1), ("iyz", 1, 2), ("izz", 2, 2))
    moments = " ".join(f'{name}="{inertia[row, column]:.6e}"' for name, row, column in names)
    yield "    <inertial>"
    yield f'      <origin xyz="{_text(centre)}"/>'
    yield f'      <mass value="{_number(mass)}"/>'
    yield f"      <inertia {moments}/>"
    yield "    </inertial>"


def _shapes(colour: str, shapes: Sequence[str]) -> Iterator[str]:
    for shape in shapes:
        material = f'<material name="{colour.replace(" ", "_")}"><color rgba="{colour}"/></material>'
        yield f"    <visual>{shape}{material}</visual>"
        yield f"    <collision>{shape}</collision>"


def _sphere(radius: float, centre: Array) -> str:
    return f'<origin xyz="{_text(centre)}"/><geometry><sphere radius="{_number(radius)}"/></geometry>'


def _cylinder(radius: float, tip: Array) -> str:
    """Returns the URDF elements of a cylinder from the link's origin to the point `tip` [m]."""
    length = float(np.linalg.norm(tip))
    tilt, turn = math.acos(max(-1.0, min(1.0, tip[2] / length))), math.atan2(tip[1], tip[0])
    origin = f'<origin xyz="{_text(tip / 2.0)}" rpy="0 {_number(tilt)} {_number(turn)}"/>'
    return f'{origin}<geometry><cylinder radius="{_number(radius)}" length="{_number(length)}"/></geometry>'


def _text(vector: Array) -> str:
    return " ".join(_number(value) for value in vector)


def _number(value: float) -> str:
    text = f"{round(value, 6) + 0.0:.6f}"  # + 0.0 turns negative zero into zero
    return text.rstrip("0").rstrip(".")


def urdf_offsets(name: str, text: str) -> Array:
    """Returns the origin of each segment in its parent's frame (23 x 3) [m], from the URDF of a person.

    Args:
        name: Source of the URDF, for error messages.
        text: Content of the URDF.

    Raises:
        ConfigError: If the URDF is invalid, or lacks one of `HINGES`.
    """
    with tempfile.NamedTemporaryFile("w", suffix=".urdf") as file:
        file.write(text)
        file.flush()
        found = UrdfDocument(name, file.name).joints
    if missing := [hinge for hinge in HINGES if hinge not in found]:
        message = f"expected the joints of a person, as in human_urdf.py; it lacks '{missing[0]}'"
        raise ConfigError([Problem(name, "", message)])
    offsets = np.zeros((len(SEGMENTS), 3))
    for index, joint in enumerate(JOINTS, start=1):
        offsets[index] = np.sum([found[hinge].xyz for hinge in joint.hinges], axis=0)
    return offsets
