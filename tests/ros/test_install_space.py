"""The workspace and the template, installed; neither of them has sources or a devel space to fall back on."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest
from clean_shell import in_clean_shell
from ros_system import wait_until
from sensor_msgs.msg import Image, JointState, Range

pytestmark = pytest.mark.thorough

ROOT = Path(__file__).resolve().parents[2]
MESSAGES = "devel/lib/python3/dist-packages"


def _install(workspace: Path, packages: Path, onto: Path | None = None) -> Path:
    """Installs a copy of some packages over an installed workspace; returns where. All else is removed.

    The messages are those of the devel space: the same generator would make the same files again.
    """
    shutil.copytree(packages, workspace / "src", ignore=shutil.ignore_patterns("__pycache__"))
    (workspace / "src/CMakeLists.txt").unlink(missing_ok=True)
    prefixes = f"-DCATKIN_DEVEL_PREFIX={workspace}/devel -DCMAKE_INSTALL_PREFIX={workspace}/install"
    options = f"{prefixes} -DPYTHON_EXECUTABLE=/usr/bin/python3 -DCATKIN_ENABLE_TESTING=OFF"
    configure = f"ROS_LANG_DISABLE=gencpp:genlisp cmake -S . -B ../build {options}"
    _run(f"cd {workspace}/src; catkin_init_workspace; {configure}", onto and onto / "setup.bash")
    for folder in (workspace / MESSAGES).iterdir():
        for kind in ("msg", "srv"):
            if (folder / kind).exists():
                shutil.copytree(ROOT / MESSAGES / folder.name / kind, folder / kind, dirs_exist_ok=True)
    _run(f"make -C {workspace}/build install/fast")
    for folder in ("src", "build", "devel"):
        shutil.rmtree(workspace / folder)
    return workspace / "install"


def _run(line: str, setup: Path | None = None) -> str:
    done = subprocess.run(in_clean_shell(line, setup), capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    workspace = tmp_path_factory.mktemp("rpbi")
    (workspace / ".venv").symlink_to(ROOT / ".venv")
    return _install(workspace, ROOT / "src")


@pytest.fixture(scope="module")
def installed_lab(tmp_path_factory, installed):
    return _install(tmp_path_factory.mktemp("lab"), ROOT / "docs/templates", onto=installed)


def _do(installed: Path, line: str) -> str:
    return _run(line, installed / "setup.bash")


FOLDERS = ("configs", "launch", "robots", "rviz", "schema", "msg", "srv")


def test_every_file_that_is_used_at_run_time_is_installed(installed):
    files = [
        path.relative_to(package.parents[1])
        for package in (ROOT / "src").rglob("package.xml")
        for path in package.parent.rglob("*")
        if path.is_file() and path.relative_to(package.parent).parts[0] in (*FOLDERS, "package.xml")
    ]
    assert {path.parts[1] for path in files} == {*FOLDERS, "package.xml"}
    assert [
        path for path in files if "__pycache__" not in path.parts and not (installed / "share" / path).exists()
    ] == []


MODULES = (
    "custom_ros_tools.tf",
    "custom_srvs.srv",
    "ik_ros",
    "ros_pybullet_interface.msg",
    "rpbi.world",
    "rpbi_examples",
    "rpbi_utils",
    "episodes",
)


def test_python_comes_from_the_install_space_and_the_venv(installed):
    imports = f"import {', '.join(MODULES)}, pydantic, sys"
    files = f"print('files:', *(sys.modules[name].__file__ for name in {MODULES}))"
    line = f'/usr/bin/python3 -c "{imports}; {files}; print(pydantic.VERSION)"'
    *_, files, version, _ = _do(installed, line).split("\n")  # PyBullet says before when it was built
    assert [file for file in files.split()[1:] if not file.startswith(f"{installed}/lib/python3/")] == []
    assert version.startswith("2."), "that of .venv"


def test_an_example_runs_with_its_camera(ros, installed):
    states = ros.listen("/rpbi/kuka_lwr/joint_states", JointState)
    images = ros.listen("/rpbi/camera/colour/image", Image)
    line = "exec roslaunch rpbi_examples basic_example_kuka_lwr.launch headless:=true"
    process = ros.start(in_clean_shell(line, installed / "setup.bash"))
    states.wait_for(50)
    assert states.messages[0].name[0] == "base_joint"
    wait_until(lambda: states.messages[-1].position != states.messages[0].position, "the arm moves")
    assert images.wait_for(1)[0].width == 640
    assert "Traceback" not in ros.output(process)


def test_worlds_are_checked_and_bags_tabulated(installed):
    world = "{rpbi_examples}/configs/basic_example_kuka_lwr/config.yaml"
    assert "fine; 1000 ticks a second" in _do(installed, f"rosrun ros_pybullet_interface check_world.py '{world}'")
    assert "usage" in _do(installed, "rosrun rpbi_utils bag_to_table --help")


def test_the_template_runs_from_an_install_space_over_this_one(ros, installed_lab):
    ranges = ros.listen("/rpbi/belt/end/range", Range)
    process = ros.start(in_clean_shell("exec roslaunch my_robot_lab lab.launch", installed_lab / "setup.bash"))
    wait_until(lambda: any(message.range < message.max_range for message in ranges.messages), "the parcel comes")
    assert "Traceback" not in ros.output(process)
    where = "import my_robot_lab.conveyor as it; print(it.__file__)"
    assert _do(installed_lab, f"/usr/bin/python3 -c '{where}'").split("\n")[-2].startswith(f"{installed_lab}/lib/")
