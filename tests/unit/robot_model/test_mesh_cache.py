"""The cache of files made from meshes: folders appear complete or not at all, and meshes name no missing texture."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pybullet_data
import pytest

from robot_model.mesh_cache import cache_folder, cached
from robot_model.urdf.for_ros import description_for_ros

PANDA = f"{pybullet_data.getDataPath()}/franka_panda/panda.urdf"
"""The materials of one of its meshes name paths of a Windows computer."""


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache"


def missing_textures(meshes):
    """Returns the textures that the meshes' materials name and RViz would not find."""
    missing = []
    for mesh in map(Path, meshes):
        for name in re.findall(r"^mtllib (.*)$", mesh.read_text(), re.MULTILINE):
            if (mesh.parent / name).is_file():
                textures = re.findall(r"^map_Kd (.*)$", (mesh.parent / name).read_text(), re.MULTILINE)
                missing += [texture for texture in textures if not (mesh.parent / texture).is_file()]
    return missing


def test_robot_description_for_ros_names_no_missing_texture(cache):
    data = Path(PANDA).parent / "meshes"
    assert len(missing_textures(data.glob("*/*.obj"))) == 5, "else there is nothing to mend"
    meshes = set(re.findall(r'"file://(.*?\.obj)"', description_for_ros(PANDA)))
    assert len(meshes) == 18 and missing_textures(meshes) == []
    (copied,) = [mesh for mesh in meshes if mesh.startswith(str(cache))]
    assert Path(copied).read_bytes() == (data / "collision/link6.obj").read_bytes()


def test_original_files_are_used_where_no_cache_can_be_written(tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert len(missing_textures(set(re.findall(r'"file://(.*?\.obj)"', description_for_ros(PANDA))))) == 5


WRITES = """
import sys, time
from robot_model.mesh_cache import cached

def make(folder):
    for number in range(20):
        (folder / str(number)).write_text(sys.argv[1])
        time.sleep(0.002)

print(len(list(cached("shared", make).iterdir())))
"""


def test_one_of_several_processes_makes_a_folder_visible_only_whole(cache):
    processes = [
        subprocess.Popen([sys.executable, "-c", WRITES, str(number)], stdout=subprocess.PIPE, text=True)
        for number in range(3)
    ]
    assert [process.communicate()[0] for process in processes] == ["20\n"] * 3
    assert len({path.read_text() for path in (cache_folder() / "shared").iterdir()}) == 1
    assert os.listdir(cache_folder()) == ["shared"]


def test_a_folder_that_could_not_be_made_is_not_there():
    def fail(folder):
        (folder / "half").touch()
        raise RuntimeError("interrupted")

    with pytest.raises(RuntimeError):
        cached("half", fail)
    assert list(cache_folder().iterdir()) == []
