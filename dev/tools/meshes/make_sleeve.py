"""Writes the sleeve of the telepresence example: a tube of cloth along x, from its cuff at the origin on.

Its corners come ring by ring, those of the cuff first.

"""

from __future__ import annotations

from pathlib import Path

import numpy as np

PATH = Path(__file__).parents[3] / "src/rpbi_examples/configs/meshes/sleeve.obj"
RADIUS_M, LENGTH_M = 0.085, 0.30
AROUND, RINGS = 14, 12


def text() -> str:
    """Returns the mesh."""
    lines = ["# A sleeve, by dev/tools/meshes/make_sleeve.py"]
    for x in np.linspace(0.0, LENGTH_M, RINGS):
        for angle in 2.0 * np.pi * np.arange(AROUND) / AROUND:
            lines.append(f"v {x:.6f} {RADIUS_M * np.cos(angle):.6f} {RADIUS_M * np.sin(angle):.6f}")
    for ring in range(RINGS - 1):
        for index in range(AROUND):
            a, b = (ring * AROUND + each % AROUND + 1 for each in (index, index + 1))
            c, d = a + AROUND, b + AROUND
            lines += [f"f {a} {b} {c}", f"f {b} {d} {c}"]
    return "\n".join([*lines, ""])


if __name__ == "__main__":
    PATH.write_text(text())
