"""Concave meshes: what their hulls add is told, and convexDecomposition makes them of convex parts."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from cup_mesh import CUP_M3, HEIGHT_M, HULL_M3, WALL_M, write_cup
from worlds import FLOOR, ball, write_world

from custom_ros_tools.errors import ConfigError
from rpbi.meshes.triangles import volumes
from rpbi.world import World
from rpbi.world.world_warnings import world_warnings

RADIUS_M = 0.02
PARTS_ADD_M = 4e-3
"""V-HACD's parts are made of voxels, and reach so far out of the mesh at most."""


@pytest.fixture(autouse=True, scope="module")
def cache(tmp_path_factory):
    """A cache of this module's tests, in which nothing is yet."""
    folder, before = tmp_path_factory.mktemp("cache"), os.environ.get("XDG_CACHE_HOME")
    os.environ["XDG_CACHE_HOME"] = str(folder)
    yield folder / "rpbi/meshes"
    os.environ.pop("XDG_CACHE_HOME")
    if before is not None:
        os.environ["XDG_CACHE_HOME"] = before


@pytest.fixture
def build(tmp_path):
    worlds = []

    def build_world(**more) -> World:
        mesh = {"shapeType": "GEOM_MESH", "fileName": str(write_cup(tmp_path / "cup.obj"))}
        cup = {"name": "cup", "createVisualShape": mesh, "createCollisionShape": mesh, "baseMass": 0.5}
        cup |= {"basePosition": [0.0, 0.0, PARTS_ADD_M], **more}
        above = ball(radius_m=RADIUS_M, basePosition=[0.0, 0.0, HEIGHT_M + 2 * RADIUS_M], baseMass=0.05)
        folder = tmp_path / f"world{len(worlds)}"
        folder.mkdir()
        path = write_world(folder, collision=(FLOOR,), dynamic=(cup, above), timeStep=0.002)
        worlds.append(World.from_file(path))
        return worlds[-1]

    yield build_world
    for world in worlds:
        world.close()


def hull_warnings(world):
    """Returns the warnings of meshes that collide as their hulls."""
    return [each for each in world_warnings(world) if each.key == "createCollisionShape.fileName"]


def height_in_cup_m(world):
    """Returns how high the ball is above the cup's foot once it rests [m]."""
    for _ in range(1000):
        world.step()
    heights = {name: world.bodies[name].base_pose().position[2] for name in ("ball", "cup")}
    return heights["ball"] - RADIUS_M - heights["cup"]


def test_ball_enters_a_decomposed_cup_but_rests_on_a_hull(build, cache):
    parts = build(convexDecomposition=True)
    (kept,) = cache.glob("convex-*")
    assert [path.name for path in kept.iterdir()] == ["parts.obj"]
    made_ns = (kept / "parts.obj").stat().st_mtime_ns
    assert hull_warnings(parts) == []
    assert height_in_cup_m(parts) == pytest.approx(WALL_M, abs=PARTS_ADD_M)
    hull = build()
    (told,) = hull_warnings(hull)
    added = f"which adds {HULL_M3 - CUP_M3:.2g} m^3 to its {CUP_M3:.2g} m^3"
    assert (told.file.rpartition("/")[2], told.key, told.message) == (
        "cup.yaml",
        "createCollisionShape.fileName",
        f"the concave mesh collides as its convex hull, {added}; see convexDecomposition",
    )
    assert height_in_cup_m(hull) == pytest.approx(HEIGHT_M, abs=1e-3)
    build(convexDecomposition=True)
    assert (kept / "parts.obj").stat().st_mtime_ns == made_ns, "it is made once"


def test_volumes_are_those_of_closed_surfaces_only(tmp_path):
    cup = write_cup(tmp_path / "cup.obj")
    assert volumes(str(cup)) == pytest.approx((CUP_M3, HULL_M3))
    (tmp_path / "open.obj").write_text(cup.read_text().rstrip("\n").rpartition("\n")[0])
    assert volumes(str(tmp_path / "open.obj")) is None


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"convexDecomposition": {"resolution": 1}}, "convexDecomposition.resolution: must be >= 10000"),
        ({"convexDecomposition": "yes"}, "convexDecomposition: expected a mapping, got text 'yes'"),
        (
            {"convexDecomposition": True, "createCollisionShape": {"shapeType": "GEOM_SPHERE", "radius": 0.1}},
            "convexDecomposition: expected a createCollisionShape of GEOM_MESH with a fileName",
        ),
    ],
)
def test_invalid_decompositions_are_refused(build, changed, message):
    with pytest.raises(ConfigError) as refused:
        build(**changed)
    assert message in str(refused.value)


DIVIDES = """
import sys
from rpbi.meshes.decomposition import convex_parts
print(convex_parts(sys.argv[1], {"resolution": 10000}))
"""


def test_convex_parts_without_a_cache_are_removed_with_their_process(tmp_path):
    (tmp_path / "file").touch()
    command = [sys.executable, "-c", DIVIDES, write_cup(tmp_path / "cup.obj")]
    done = subprocess.run(
        command, capture_output=True, text=True, env={**os.environ, "XDG_CACHE_HOME": str(tmp_path / "file")}
    )
    assert done.stderr == "" and done.stdout.strip().endswith("parts.obj") and not Path(done.stdout.strip()).exists()
