#!/usr/bin/env python3
"""Print the inertial elements of `kuka_lwr.urdf`.

The mass of each link is taken from there and spread evenly over the link's first visual mesh.
"""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from make_meshes import FOLDER, MATERIALS
from mesh import Array, mass_properties

URDF = FOLDER.with_suffix(".urdf")


def inertials(urdf: Path = URDF) -> dict[str, tuple[float, Array, Array]]:
    """Mass [kg], centre (3,) [m] and inertia about it (3, 3) [kg m^2] of each visible link, in its axes."""
    solids = {name: mass_properties(mesh) for _, make in MATERIALS.values() for name, mesh in make().items()}
    found = {}
    for link in ElementTree.parse(urdf).iter("link"):
        visual = link.find("visual")
        if visual is None:
            continue
        solid = solids[Path(_attribute(visual, "geometry/mesh", "filename")).stem]
        xyz, rpy = (np.array(_attribute(visual, "origin", key).split(), float) for key in ("xyz", "rpy"))
        mass, turn = float(_attribute(link, "inertial/mass", "value")), rotation(*rpy)
        inertia = mass * turn @ solid.inertia_per_mass @ turn.T
        found[link.attrib["name"]] = mass, xyz + turn @ solid.centre, inertia
    return found


def rotation(roll: float, pitch: float, yaw: float) -> Array:
    """Rotation matrix of URDF's fixed-axis angles [rad]."""
    (ca, cb, cc), (sa, sb, sc) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    about_x = np.array([[1, 0, 0], [0, ca, -sa], [0, sa, ca]])
    about_y = np.array([[cb, 0, sb], [0, 1, 0], [-sb, 0, cb]])
    about_z = np.array([[cc, -sc, 0], [sc, cc, 0], [0, 0, 1]])
    return about_z @ about_y @ about_x


def element(mass: float, centre: Array, inertia: Array) -> str:
    """The URDF text of one link's inertial element."""
    unit = 10.0 ** np.floor(np.log10(np.trace(inertia)) - 3.0)
    rounded = np.round(inertia / unit) * unit + 0.0
    moments = {f"i{a}{b}": rounded["xyz".index(a), "xyz".index(b)] for a in "xyz" for b in "xyz" if a <= b}
    lines = [
        "    <inertial>",
        '      <origin xyz="{:.4f} {:.4f} {:.4f}"/>'.format(*(np.round(centre, 4) + 0.0)),
        f'      <mass value="{mass:g}"/>',
        "      <inertia " + " ".join(f'{key}="{value:.4g}"' for key, value in moments.items()) + "/>",
        "    </inertial>",
    ]
    return "\n".join(lines)


def _attribute(parent: ElementTree.Element, path: str, key: str) -> str:
    """An attribute of an element below another; "0 0 0" where URDF lets it be left out."""
    found = parent.find(path)
    return "0 0 0" if found is None else found.get(key, "0 0 0")


if __name__ == "__main__":
    for link_name, values in inertials().items():
        print(link_name, element(*values), sep="\n")
