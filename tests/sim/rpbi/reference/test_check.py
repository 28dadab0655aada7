"""`./rpbi check`, as users call it."""

from __future__ import annotations

import os
import re
import subprocess
from pathlib import Path

import yaml
from worlds import BOX_FLOOR, ball, box, write_world

ROOT = Path(__file__).resolve().parents[4]


def check(world: str, folder: Path, **environment: str) -> tuple[int, list[str], list[str]]:
    """Returns the exit code, and the lines of both outputs but for PyBullet's own."""
    done = subprocess.run(
        [str(ROOT / "rpbi"), "check", world],
        cwd=folder,
        capture_output=True,
        text=True,
        env={**os.environ, **environment},
        timeout=120.0,
    )
    out, told = (
        [line for line in text.splitlines() if not line.startswith("pybullet build")]
        for text in (done.stdout, done.stderr)
    )
    return done.returncode, out, told


def package(folder: Path, name: str, floor: str) -> None:
    """Writes a ROS package with a world of one object."""
    configs = folder / name / "configs"
    configs.mkdir(parents=True)
    (folder / name / "package.xml").write_text(f"<package><name>{name}</name></package>")
    (configs / "floor.yaml").write_text(yaml.safe_dump({**BOX_FLOOR, "name": floor}))
    (configs / "world.yaml").write_text("collision_objects: ['{rpbi_examples}/configs/floor.yaml']")


def test_warnings_differ_from_errors_and_only_errors_fail(tmp_path):
    sunk = box(basePosition=[0.0, 0.0, 0.05])
    write_world(tmp_path, collision=(BOX_FLOOR,), dynamic=(sunk,))
    code, lines, told = check("world.yaml", tmp_path)
    assert (code, told) == (
        0,
        ["warning: floor.yaml: at the start, 'floor' and 'box' overlap by 0.05 m, and will be pushed apart"],
    )
    assert lines[0] == "world.yaml: fine; 1000 ticks a second, 1 warning"
    write_world(tmp_path, collision=(BOX_FLOOR,), dynamic=(ball(radius=1.0), {**sunk, "mass": 1.0}))
    code, lines, told = check("world.yaml", tmp_path)
    assert code == 1 and lines == []
    assert [line.split(": unknown key")[0] for line in told] == [
        "error: ball.yaml: radius",
        "error: box.yaml: mass",
        "world.yaml: 2 errors",
    ]


def test_missing_meshes_are_reported_with_all_other_problems(tmp_path):
    mesh = "<visual><geometry><mesh filename='none.stl'/></geometry></visual>"
    (tmp_path / "cup.urdf").write_text(f"<robot name='cup'><link name='cup'>{mesh}</link></robot>")
    cup = {"loadURDF": {"fileName": "cup.urdf"}}
    write_world(tmp_path, dynamic=(box(baseMas=1.0),), urdfs=({**cup, "name": "a"}, {**cup, "name": "b", "hz": 1}))
    code, lines, told = check("world.yaml", tmp_path)
    assert (code, lines) == (1, [])
    missing = f"loadURDF.fileName: {tmp_path}/cup.urdf: no such mesh: none.stl"
    assert [line.split(" (searched")[0].split("; ")[0] for line in told] == [
        "error: box.yaml: baseMas: unknown key 'baseMas'",
        "error: b.yaml: hz: unknown key 'hz'",
        f"error: a.yaml: {missing}",
        f"error: b.yaml: {missing}",
        "world.yaml: 4 errors",
    ]


def test_the_world_of_the_docs_is_fine(tmp_path):
    blocks = re.findall(r"```yaml\n# (\w+\.yaml)\n(.*?)```", (ROOT / "docs" / "worlds.md").read_text(), re.DOTALL)
    for name, text in blocks:
        (tmp_path / name).write_text(text)
    code, lines, told = check("world.yaml", tmp_path)
    assert (code, told) == (0, [])
    assert [line.split()[:2] for line in lines[1:4]] == [["collision", "floor"], ["dynamic", "box"], ["robot", "arm,"]]


def test_packages_of_a_sourced_workspace_are_found_before_the_examples(tmp_path):
    package(tmp_path, "their_lab", "their_floor")
    code, lines, _ = check("{their_lab}/configs/world.yaml", tmp_path, ROS_PACKAGE_PATH=str(tmp_path))
    assert code == 0 and lines[1].split() == ["collision", "floor"], "that of our examples"
    package(tmp_path, "rpbi_examples", "changed_floor")
    code, lines, _ = check("{their_lab}/configs/world.yaml", tmp_path, ROS_PACKAGE_PATH=str(tmp_path))
    assert code == 0 and lines[1].split() == ["collision", "changed_floor"]
    code, _, told = check("{their_lab}/configs/world.yaml", tmp_path, ROS_PACKAGE_PATH="")
    assert code == 1 and "unknown ROS package 'their_lab'" in told[0]


def test_classes_of_a_sourced_workspace_are_found(tmp_path):
    """Only those: other folders in PYTHONPATH may hold packages for other Pythons."""
    modules = tmp_path / "devel" / "lib" / "python3" / "dist-packages"
    modules.mkdir(parents=True)
    (modules / "their_lab.py").write_text(
        "from rpbi.bodies.visual import VisualObject\n\nclass Thing(VisualObject):\n    section = 'objects'\n"
    )
    thing = {"name": "thing", "type": "their_lab:Thing", "createVisualShape": {"shapeType": "GEOM_SPHERE", "radius": 1}}
    (tmp_path / "thing.yaml").write_text(yaml.safe_dump(thing))
    (tmp_path / "world.yaml").write_text("objects: [thing.yaml]")
    code, lines, told = check("world.yaml", tmp_path, CMAKE_PREFIX_PATH=str(tmp_path / "devel"), PYTHONPATH="")
    assert code == 0 and lines[1].split() == ["their_lab:Thing", "thing"], told
    code, _, told = check("world.yaml", tmp_path, CMAKE_PREFIX_PATH="", PYTHONPATH=str(modules))
    assert code == 1 and "no module 'their_lab'" in told[0]


def test_a_camera_that_this_machine_cannot_draw_is_reported(tmp_path):
    eye = {"name": "eye", "object_tf": {"tf_id": "eye"}}
    poses = [{"tf_id": "eye"}]
    write_world(tmp_path, collision=(BOX_FLOOR,), poses=poses, rgbd_sensor={**eye, "hz": 20_000.0})
    code, _, told = check("world.yaml", tmp_path)
    (warning,) = [line for line in told if "machine" in line]
    start = "warning: world.yaml: hz: 20000 is too much for 'eye': this machine draws at most "
    assert code == 0 and warning.startswith(start) and warning.endswith(" images of 640 x 480 a second")
    write_world(tmp_path, collision=(BOX_FLOOR,), poses=poses, rgbd_sensor={**eye, "hz": 0.5})
    assert not [line for line in check("world.yaml", tmp_path)[2] if "machine" in line]
