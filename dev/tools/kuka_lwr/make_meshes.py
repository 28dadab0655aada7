#!/usr/bin/env python3
"""Makes the meshes of the KUKA LWR4+ of rpbi_examples: `make_meshes.py [--out FOLDER]`.

Nothing here was measured or taken from CAD files: the shapes are designed around the published kinematics
(shoulder at 0.31 m, upper arm 0.4 m, forearm 0.39 m, flange 0.078 m). Each of the four equal arm segments is
a neck that leans sideways from a roll joint into one half of a pitch joint; two segments meet face to face at
the pitch axis, which gives the arm its S-shaped outline. A ring around each joint hides its gap.
The result depends on these files only, so running it again changes nothing. After a change of shape, update
the inertias in `kuka_lwr.urdf` with `print_inertials.py`.
"""

import argparse
from collections.abc import Callable
from pathlib import Path

import numpy as np
from implicit_surface import Array, Field, disc, polygonise, rounded_box, smooth_max, smooth_min
from mesh import Mesh, merge, moved, revolve, write_materials, write_obj

FOLDER = Path(__file__).parents[3] / "src/rpbi_examples/robots/kuka_lwr"
NECK, ELBOW, WRIST, FLANGE = 0.060, 0.072, 0.055, 0.037  # radii of roll, pitch, wrist and last joint [m]
SEAM = 0.029  # the wrist's pitch joint closes at this distance from the arm's axis [m]
HIDDEN = 0.0045  # how far both halves of a pitch joint reach past its seam, inside the ring [m]


def segment(length: float, elbow: float, seam: float, outer: float) -> Field:
    """A segment from its roll joint at the origin (axis z) to its half of a pitch joint (axis y) above.

    Args:
        length: Height of the pitch axis [m].
        elbow: Radius of the pitch joint [m].
        seam: Where along y the two halves of the pitch joint meet [m].
        outer: Where along y this half ends [m].
    """
    thick, low = outer - seam, seam - HIDDEN

    def field(p: Array) -> Array:
        x, y, z = p.T
        rise = np.clip(z / (0.85 * length), 0.0, 1.0)
        sway = rise**2 * (3.0 - 2.0 * rise)
        depth, width = NECK + (0.38 * thick - NECK) * sway, NECK + (0.70 * elbow - NECK) * sway
        oval = (np.hypot(x / width, (y - (seam + 0.30 * thick) * sway) / depth) - 1.0) * depth
        top = length - 0.42 * elbow
        neck = smooth_max(oval, np.abs(z - top / 2.0) - top / 2.0, 0.006)
        axle = np.hypot(x, z - length)
        dome = disc(axle, y, elbow, low, outer, 0.46 * thick)
        face = disc(axle, y, elbow, low, (seam + outer) / 2.0, 0.002)
        other_half = smooth_max(axle - elbow - 0.004, y - low, 0.015)
        return smooth_max(smooth_min(neck, np.minimum(dome, face), 0.7 * thick), -other_half, 0.020)

    return field


def wrist(p: Array) -> Array:
    """The ball of the wrist: pitch joint at the origin (axis y, seam at +SEAM), roll joint 0.06 m above."""
    x, y, z = p.T
    axle, high = np.hypot(x, z), SEAM + HIDDEN
    dome = disc(axle, y, WRIST, -0.056, high, 0.036)
    face = disc(axle, y, WRIST, -0.020, high, 0.002)
    neck = disc(np.hypot(x, y), z, FLANGE, 0.0, 0.060, 0.002)
    other_half = smooth_max(axle - WRIST - 0.003, high - y, 0.012)
    return smooth_max(smooth_min(np.minimum(dome, face), neck, 0.014), -other_half, 0.012)


def base(p: Array) -> Array:
    """The pedestal, from the floor to the first roll joint at 0.11 m, with the plug housing at its back."""
    x, y, z = p.T
    radius = np.hypot(x, y)
    column = disc(radius, z, NECK, 0.0, 0.110, 0.002)
    drum = disc(radius, z, 0.080, 0.008, 0.089, 0.022)
    back = rounded_box([x - 0.070, y, z - 0.050], [0.045, 0.042, 0.026], 0.016)
    return smooth_min(column, smooth_min(drum, back, 0.045), 0.010)


def turned(profile: str, segments: int = 36, arc_points: int = 3) -> Mesh:
    """`revolve` for a profile written as "radius height [fillet], ..." in millimetres."""
    corners = [f"{corner} 0".split()[:3] for corner in profile.split(",")]
    in_metres = [(float(r) / 1e3, float(h) / 1e3, float(f) / 1e3) for r, h, f in corners]
    return revolve(in_metres, segments, arc_points)


def ring(radius: float) -> Mesh:
    """A band about the z axis that hides a joint's gap from both sides."""
    r = 1000.0 * radius
    return turned(f"{r - 10} -5.5, {r} -5.5 3, {r} 5.5 3, {r - 10} 5.5")


def rims(radius: float) -> Mesh:
    """The dark edges on both sides of a `ring`."""
    r = 1000.0 * radius
    return merge(turned(f"{r - 6} -9, {r} -9, {r} -5"), turned(f"{r} 5, {r} 9, {r - 6} 9"))


def shell() -> dict[str, Mesh]:
    """The white bodies, by file name."""
    low, high = (-0.085, -0.065, -0.012), (0.085, 0.095, 0.285)
    return {
        "base": polygonise(base, (-0.1, -0.1, -0.008), (0.14, 0.1, 0.12), 0.0095),
        "segment": polygonise(segment(0.2, ELBOW, 0.0, 0.078), low, high, 0.0115),
        "forearm": polygonise(segment(0.19, WRIST, SEAM, 0.078), low, high, 0.0115),
        "wrist": polygonise(wrist, (-0.07, -0.07, -0.07), (0.07, 0.05, 0.07), 0.0085),
    }


def orange() -> dict[str, Mesh]:
    """The joints' rings and the ball at the tip."""
    return {
        "ring_neck": ring(NECK + 0.0025),
        "ring_elbow": ring(ELBOW + 0.0025),
        "ring_wrist": ring(WRIST + 0.0025),
        "ring_flange": ring(FLANGE + 0.0020),
        "ball": turned("0 -15, 15 -15 15, 15 15 15, 0 15", 24, 6),
    }


def dark() -> dict[str, Mesh]:
    """Rims, covers, bolts, plugs and adaptor."""
    bolt = turned("5 0, 5 5 1, 0 5", 12)
    plug = turned("12 0, 12 6 1, 8 6, 8 22 2, 0 22", 24)
    around = np.arange(1, 6) * np.pi / 3.0  # none under the plugs
    return {
        "rims_neck": rims(NECK + 0.0010),
        "rims_elbow": rims(ELBOW + 0.0010),
        "rims_wrist": rims(WRIST + 0.0010),
        "cap_elbow": turned("44 0, 44 4 2.5, 35 6.5 6, 0 8"),
        "cap_wrist": turned("30 0, 30 4 2.5, 22 6.5 6, 0 7.5"),
        "bolts": merge(*(moved(bolt, 0.0905 * np.cos(a), 0.0905 * np.sin(a), 0.012) for a in around)),
        "plugs": merge(moved(plug, 0.0, -0.018, 0.0), moved(plug, 0.0, 0.018, 0.0)),
        "adaptor": turned("0 0, 31.5 0 1, 31.5 8 2, 38 14 2, 38 20 1, 0 20"),
    }


def metal() -> dict[str, Mesh]:
    """Foot, flange, sensor and tool."""
    return {
        "foot": turned("100 0, 100 12 3, 70 12"),
        "flange": turned("0 -24, 30 -24, 37 -12 2, 31.5 -6 1, 31.5 0 1, 0 0"),
        "sensor": turned("0 0, 37.5 0 2, 37.5 33 3, 0 33"),
        "tool": turned("0 0, 30 0 1, 30 8 2, 11 16 6, 11 59, 0 59"),
        "stem": turned("0 -92.3, 10 -92.3, 6 -80 4, 6 0, 0 0", 18),
    }


def sponge() -> dict[str, Mesh]:
    """The sponge, its contact face at z = 0."""
    return {"sponge": turned("0 -28, 34 -28 8, 34 0 8, 0 0")}


# Colour (red, green, blue) and meshes of each material; the colours are also those of kuka_lwr.urdf.
MATERIALS: dict[str, tuple[tuple[float, float, float], Callable[[], dict[str, Mesh]]]] = {
    "shell": ((0.88, 0.89, 0.90), shell),
    "orange": ((0.95, 0.38, 0.05), orange),
    "dark": ((0.16, 0.17, 0.19), dark),
    "metal": ((0.55, 0.57, 0.60), metal),
    "sponge": ((0.98, 0.80, 0.18), sponge),
}


def main() -> None:
    """Write all meshes and their materials."""
    parser = argparse.ArgumentParser(description="Make the meshes of the KUKA LWR4+.")
    parser.add_argument("--out", type=Path, default=FOLDER, help="folder to write to")
    out = parser.parse_args().out
    for material, (_, make) in MATERIALS.items():
        for name, mesh in make().items():
            write_obj(out / f"{name}.obj", mesh, material)
    write_materials(out / "materials.mtl", {name: colour for name, (colour, _) in MATERIALS.items()})


if __name__ == "__main__":
    main()
