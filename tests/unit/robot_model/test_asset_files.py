"""Files that a configuration names are found in the documented order, else told where they were sought."""

from __future__ import annotations

from pathlib import Path

import pybullet_data
import pytest

from robot_model.asset_files import find_file, find_folder

DATA = pybullet_data.getDataPath()


def test_absolute_path_is_taken_as_it_is(tmp_path: Path) -> None:
    (tmp_path / "a.urdf").write_text("")
    assert find_file(f"{tmp_path}/a.urdf", "~config") == f"{tmp_path}/a.urdf"
    with pytest.raises(ValueError, match=f"^no such file: {tmp_path}/b.urdf$"):
        find_file(f"{tmp_path}/b.urdf", "~config")


def test_relative_path_is_relative_to_the_file_from_any_directory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "configs").mkdir()
    (tmp_path / "a.urdf").write_text("")
    monkeypatch.chdir(tmp_path)
    assert find_file("../a.urdf", "configs/world.yaml") == f"{tmp_path}/a.urdf"
    assert find_file("../a.urdf", f"{tmp_path}/configs/world.yaml") == f"{tmp_path}/a.urdf"


def test_parameter_server_has_no_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.urdf").write_text("")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ValueError, match=rf"^no such file: a.urdf \(looked in {DATA}\); .* write {{package}}/PATH"):
        find_file("a.urdf", "~config")


def test_search_paths_come_before_pybullets_data(tmp_path: Path) -> None:
    assert find_file("plane.urdf", "~config", [str(tmp_path)]) == f"{DATA}/plane.urdf"
    (tmp_path / "plane.urdf").write_text("")
    assert find_file("plane.urdf", "~config", [str(tmp_path)]) == f"{tmp_path}/plane.urdf"


def test_folder_is_no_file(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="^expected a file, got the folder "):
        find_file(str(tmp_path), "~config")


def test_unknown_package_is_reported_as_a_wrong_value() -> None:
    with pytest.raises(ValueError, match="^unknown ROS package 'zebra_robot'"):
        find_file("package://zebra_robot/a.urdf", "~config")


def test_folder_is_found_next_to_the_file_or_by_keyword(tmp_path: Path) -> None:
    (tmp_path / "meshes").mkdir()
    assert find_folder("meshes", f"{tmp_path}/world.yaml") == f"{tmp_path}/meshes"
    assert find_folder("pybullet_data_path", "~config") == DATA
    with pytest.raises(ValueError, match=f"^no such folder: {tmp_path}/none$"):
        find_folder("none", f"{tmp_path}/world.yaml")


@pytest.mark.parametrize("start", ["{example-robot-data}", "package://example-robot-data"])
def test_robots_of_extra_assets_are_found_like_a_ros_package(start):
    found = find_file(f"{start}/robots/talos_data/robots/talos_reduced.urdf", "~")
    assert Path(found).is_file() and found.endswith("/talos_reduced.urdf")


def test_missing_extra_is_reported_with_its_install_command(monkeypatch):
    monkeypatch.setattr("sys.path", [])
    with pytest.raises(ValueError, match="'example-robot-data' is not installed: ./rpbi setup assets"):
        find_file("{example-robot-data}/robots/talos.urdf", "~")
