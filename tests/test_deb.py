"""The Debian package of the install space: its control file, its content, and an example that runs from it."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest
from clean_shell import in_clean_shell
from sensor_msgs.msg import Image, JointState

from custom_ros_tools.console import deb as command
from custom_ros_tools.console.command import Command
from custom_ros_tools.console.release import version

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = """
# ROS
python3-rospy rosbash # tools
# Building the workspace
g++ catkin
# Pictures
ffmpeg
# Tests
xvfb
"""


@pytest.fixture
def workspace(tmp_path: Path) -> Path:
    """The files of a workspace that make its control file."""
    (tmp_path / "requirements").mkdir()
    (tmp_path / "requirements/apt-packages.txt").write_text(PACKAGES)
    source = tmp_path / "src/ros_pybullet_interface"
    source.mkdir(parents=True)
    shutil.copy(ROOT / "src/ros_pybullet_interface/package.xml", source)
    return tmp_path


def test_dependencies_are_the_packages_of_run_time(workspace):
    assert command.debian_packages(workspace) == ["ffmpeg", "python3-rospy", "rosbash"]
    assert {"python3-rospy", "rviz", "libegl1"} <= {*command.debian_packages(ROOT)}
    assert not {"g++", "make", "xvfb"} & {*command.debian_packages(ROOT)}


def test_sections_that_are_left_out_exist():
    text = (ROOT / "requirements/apt-packages.txt").read_text()
    assert all(f"\n# {title}\n" in text for title in command.NOT_AT_RUN_TIME)
    assert command.CHECKS in (ROOT / "requirements/base.txt").read_text()


def test_control_file_has_version_and_python(workspace):
    text = command.control(workspace, "amd64")
    assert f"Version: {version(workspace)}\nArchitecture: amd64\n" in text
    assert "Depends: python3 (>= 3.11), python3 (<< 3.12), ffmpeg, python3-rospy, rosbash\n" in text
    assert all(line.startswith((" ", "Description")) for line in text.split("Priority: optional\n")[1].splitlines())


def test_failed_step_is_named_with_its_output(monkeypatch, capsys, workspace):
    monkeypatch.setattr(command, "workspace", lambda: workspace)
    monkeypatch.setattr(command, "install", lambda *_: command.run("make", ["bash", "-c", "echo no rule; exit 2"]))
    assert Command(command.deb).run([]) == 1
    assert capsys.readouterr().err == "deb: make failed: no rule\n"
    assert not (workspace / "out").exists()


@pytest.fixture(scope="module")
def unpacked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder /opt/rpbi of the package that `./rpbi deb` builds, unpacked elsewhere."""
    done = subprocess.run([ROOT / "rpbi", "deb"], check=True, capture_output=True, text=True)
    package = ROOT / re.search(r"^built: (.*\.deb)$", done.stdout, re.MULTILINE)[1]
    folder = tmp_path_factory.mktemp("deb")
    subprocess.run(["dpkg-deb", "--extract", package, folder], check=True)
    assert {path.name for path in folder.iterdir()} == {"opt", "usr"}
    return folder / "opt/rpbi"


@pytest.mark.thorough
class TestPackage:
    def test_no_file_is_of_the_checkout(self, unpacked):
        names = {str(path.relative_to(unpacked)) for path in unpacked.rglob("*")}
        assert "install/share/rpbi_examples/robots/kuka_lwr.urdf" in names
        assert ".venv/lib/python3.11/site-packages/pydantic/main.py" in names
        assert not [name for name in names if "pytest" in name or "/ruff" in name]

    def test_example_runs_with_its_camera(self, ros, unpacked):
        states = ros.listen("/rpbi/kuka_lwr/joint_states", JointState)
        images = ros.listen("/rpbi/camera/colour/image", Image)
        line = "exec roslaunch rpbi_examples basic_example_kuka_lwr.launch headless:=true"
        process = ros.start(in_clean_shell(line, unpacked / "install/setup.bash"))
        states.wait_for(50)
        assert images.wait_for(1)[0].width == 640
        assert "Traceback" not in ros.output(process)
