"""Hostile meshes: some that are invented part by part, and good files with changed bytes."""

from __future__ import annotations

import struct
from pathlib import Path
from random import Random

import pybullet_data

from .texts import NAMES, NUMBERS, number, spoil
from .urdfs import FIFO

DATA = Path(pybullet_data.getDataPath())
GOOD = (
    *("cube.obj", "teddy2_VHACD_CHs.obj", "kuka_iiwa/meshes/link_7.stl", "racecar/meshes/cone.dae", "cloth_z_up.obj"),
    *("torus/torus_textured.obj", "tube.vtk"),
)


def write_mesh(random: Random, folder: Path) -> Path:
    """Writes a hostile mesh into a folder, sometimes with files that it names, and returns its path."""
    if random.random() < 0.5:
        source = DATA / random.choice([each for each in GOOD if (DATA / each).is_file()])
        path = folder / f"mesh{source.suffix}"
        path.write_bytes(spoil(random, source.read_bytes()))
        return path
    suffix, make = random.choice(((".obj", _obj), (".obj", _obj), (".stl", _stl), (".dae", _dae), (".vtk", _vtk)))
    path = folder / f"mesh{suffix}"
    path.write_bytes(make(random))
    if suffix == ".obj" and random.random() < 0.5:
        (folder / "mesh.mtl").write_bytes(_materials(random))
        picture = (DATA / "cube.png").read_bytes() if (DATA / "cube.png").is_file() else b"\x89PNG\r\n"
        (folder / "picture.png").write_bytes(spoil(random, picture))
    return path


def _obj(random: Random) -> bytes:
    corners = random.choice((0, 1, 3, 4, 8, 100))
    lines = [random.choice(("mtllib mesh.mtl", f"mtllib {FIFO}", f"mtllib {random.choice(NAMES)}", "mtllib /dev/zero"))]
    lines += [f"v {number(random)} {number(random)} {number(random)}" for _ in range(corners)]
    lines += [f"vt {number(random)} {number(random)}" for _ in range(random.choice((0, corners)))]
    lines.append(f"usemtl {random.choice(('paint', *NAMES))}")
    for _ in range(random.choice((0, 1, 4, 12, 200))):
        lines.append("f " + " ".join(_corner(random, corners) for _ in range(random.choice((3, 3, 3, 4, 1, 0, 60)))))
    if random.random() < 0.2:
        lines.append(
            random.choice(("s off", "o %n", "g " + "a" * 9000, "f", "v", "vn", "l 1 2", "\n" * 50_000, "mtllib"))
        )
    return "\n".join(lines).encode(errors="replace")


def _corner(random: Random, count: int) -> str:
    index = (
        random.randint(1, max(count, 1))
        if random.random() < 0.97
        else random.choice((0, -1, count + 1, 2**31, -(2**31)))
    )
    return random.choice((f"{index}", f"{index}/{index}", f"{index}//{index}", f"{index}/{index}/{index}"))


def _materials(random: Random) -> bytes:
    files = ("picture.png", "picture.png", FIFO, "/dev/zero", "../" * 20 + "dev/zero", "mesh.obj", *NAMES)
    lines = [f"newmtl {random.choice(('paint', *NAMES))}"]
    for key in ("Kd", "Ka", "Ks"):
        lines.append(f"{key} {number(random)} {number(random)} {number(random)}")
    lines += [f"map_Kd {random.choice(files)}", f"Ns {random.choice(NUMBERS)}"]
    return "\n".join(lines).encode(errors="replace")


def _stl(random: Random) -> bytes:
    count = random.choice((0, 1, 4, 12, 500))
    triangles = b""
    for _ in range(count):
        values = [random.uniform(-1, 1) for _ in range(12)]
        if random.random() < 0.02:
            values[random.randrange(12)] = random.choice((float("nan"), float("inf"), 1e38, 1e-40))
        triangles += struct.pack("<12fH", *values, 0)
    said = count if random.random() < 0.7 else random.choice((0, count + 1, 2**31, 2**32 - 1, 85899346))
    return random.choice((b"\0" * 80, b"solid x".ljust(80))) + struct.pack("<I", said) + triangles


def _dae(random: Random) -> bytes:
    corners = " ".join(number(random) for _ in range(12))
    count = random.choice((12, 12, 0, 3, 10**9, -1))
    indices = " ".join(str(random.choice((0, 1, 2, 3, 3, 99, -1, 2**31))) for _ in range(12))
    triangles = random.choice((4, 4, 0, 10**9, -4))
    scale = random.choice(("1", "nan", "", "1e30"))
    matrix = " ".join(number(random) for _ in range(random.choice((16, 16, 0, 3))))
    text = (
        f'<COLLADA><asset><unit meter="{scale}"/><up_axis>Z_UP</up_axis></asset>'
        '<library_geometries><geometry id="g"><mesh>'
        f'<source id="s"><float_array id="a" count="{count}">{corners}</float_array><technique_common>'
        f'<accessor source="#a" count="4" stride="{random.choice((3, 3, 0, -3, 10**6))}"/>'
        f"</technique_common></source>"
        f'<vertices id="v"><input semantic="POSITION" source="#{random.choice("sssvg")}"/></vertices>'
        f'<triangles count="{triangles}"><input semantic="VERTEX" source="#v" offset="{random.choice((0, 0, 5, -1))}"/>'
        f"<p>{indices}</p></triangles></mesh></geometry></library_geometries>"
        '<library_visual_scenes><visual_scene id="w">'
        f'<node><matrix>{matrix}</matrix><instance_geometry url="#g"/></node></visual_scene></library_visual_scenes>'
        f'<scene><instance_visual_scene url="#{random.choice("wwwx")}"/></scene></COLLADA>'
    )
    return text.encode(errors="replace")


def _vtk(random: Random) -> bytes:
    points = random.choice((0, 4, 4, 8))
    lines = ["# vtk DataFile Version 2.0", "x", "ASCII", "DATASET UNSTRUCTURED_GRID"]
    lines.append(f"POINTS {random.choice((points, points, -1, 10**9))} float")
    lines += [f"{number(random)} {number(random)} {number(random)}" for _ in range(points)]
    cells = random.choice((1, 1, 0, 5))
    lines.append(f"CELLS {random.choice((cells, cells, 10**9))} {5 * cells}")
    lines += ["4 " + " ".join(str(random.choice((0, 1, 2, 3, 3, -1, 2**31))) for _ in range(4)) for _ in range(cells)]
    return "\n".join(lines).encode(errors="replace")
