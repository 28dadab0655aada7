"""The command line `./rpbi`: help, refusals, and Ctrl-C at once."""

from __future__ import annotations

import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
from ros_system import find_executable
from tries import tries
from worlds import BOX_FLOOR, box, iiwa, write_world

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs/commands.md").read_text()
SECTIONS = dict(re.findall(r"^## ([a-z_]+)\n\n(.*?)\n(?=^## )", PAGE, re.DOTALL | re.MULTILINE))
WORLD = str(ROOT / "src/rpbi_examples/configs/grasp_example/config.yaml")


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A checkout in which nothing is set up, in a folder with a space; the path of its ./rpbi."""
    folder = tmp_path_factory.mktemp("bare") / "my checkout"
    (folder / "docs").mkdir(parents=True)
    shutil.copy(ROOT / "rpbi", folder)
    shutil.copy(ROOT / "docs/commands.md", folder / "docs")
    return folder / "rpbi"


def run(command: list[str | Path], **sourced: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, capture_output=True, text=True, timeout=300.0, env=os.environ | sourced)


@pytest.mark.parametrize("command", SECTIONS)
def test_help_of_a_command_is_its_section_without_any_setup(bare, command):
    for words in ([command, "--help"], [command, "-h"], ["help", command]):
        done = run([bare, *words])
        assert (done.returncode, done.stderr) == (0, "")
        assert done.stdout == SECTIONS[command]
    assert f"./rpbi {command}" in SECTIONS[command]
    assert sorted(path.name for path in bare.parent.iterdir()) == ["docs", "rpbi"]


@pytest.mark.quick
def test_the_list_has_a_line_for_each_command(bare):
    done = run([bare])
    assert done.returncode == 0
    listed = dict(re.findall(r"^  (\w+) +(.+)$", done.stdout, re.MULTILINE))
    assert listed.keys() == SECTIONS.keys()
    assert all(f"\n{line}\n" in SECTIONS[command] for command, line in listed.items())


@pytest.mark.quick
def test_page_names_all_extras_and_all_benchmarks_run_by_name():
    extras = {path.stem for path in ROOT.glob("requirements/extras/*.txt")}
    assert words_of("setup", "EXTRA") >= extras
    (named,) = re.findall(
        r"^WHEN_NAMED = \((.*?)^\)", (ROOT / "dev/benchmarks/run.py").read_text(), re.MULTILINE | re.DOTALL
    )
    assert words_of("bench", "NAME") >= set(re.findall(r"\w+", named))


def words_of(command: str, argument: str) -> set[str]:
    """Returns the words of the line that explains an argument of a command."""
    (line,) = re.findall(rf"^    {argument} .*(?:\n {{10,}}.*)*", SECTIONS[command], re.MULTILINE)
    return set(re.findall(r"\w+", line))


def test_an_unknown_command_is_refused_with_the_list(bare):
    done = run([bare, "lanch"])
    assert done.returncode == 2
    assert done.stderr.startswith("There is no command 'lanch'; did you mean 'launch'?\nUsage: ./rpbi COMMAND")
    assert run([bare, "qqq"]).stderr.startswith("There is no command 'qqq'.\n")


def test_shell_refuses_a_command_without_c():
    done = run([ROOT / "rpbi", "shell", "python3", "x.py"])
    assert done.returncode == 2 and done.stdout == ""
    assert "expected -c before a command, got 'python3': ./rpbi shell -c 'python3 x.py'" in done.stderr


def test_checkout_in_a_folder_with_spaces_is_refused_at_once(bare):
    done = run([bare, "check", WORLD])
    assert done.returncode == 1
    assert done.stderr.startswith(f"This checkout is in '{bare.parent}': ")
    assert done.stderr.endswith(" take no path with spaces. Move it.\n") and done.stderr.count("\n") == 1


@pytest.mark.thorough
@pytest.mark.skipif(os.geteuid() != 0, reason="only root may install packages without being asked")
def test_first_setup_without_network_names_its_server_and_gives_up(tmp_path):
    """The only server of packages takes connections and never answers, as behind many a firewall."""
    checkout = tmp_path / "checkout"
    (checkout / "requirements").mkdir(parents=True)
    shutil.copy(ROOT / "rpbi", checkout)
    (checkout / "requirements/apt-packages.txt").write_text("package-that-nobody-has\n")
    for folder in ("lists/partial", "cache/archives/partial"):
        (tmp_path / folder).mkdir(parents=True)
    with socket.create_server(("127.0.0.1", 0)) as server:
        site = f"http://127.0.0.1:{server.getsockname()[1]}/debian"
        (tmp_path / "sources.list").write_text(f"deb {site} bookworm main\ndeb {site} bookworm-updates main\n")
        (tmp_path / "apt.conf").write_text(
            f'Dir::State::lists "{tmp_path}/lists"; Dir::Cache "{tmp_path}/cache";'
            f'Dir::Etc::sourcelist "{tmp_path}/sources.list"; Dir::Etc::sourceparts "{tmp_path}/none";'
        )
        environment = {**os.environ, "APT_CONFIG": str(tmp_path / "apt.conf")}
        command = [checkout / "rpbi", "setup"]
        done = subprocess.run(command, capture_output=True, text=True, timeout=300.0, env=environment)
    assert done.returncode == 1
    first, waiting, *_ = done.stderr.splitlines()
    assert first.startswith("==> Installing 1 Debian packages and what they need (log: ")
    assert re.match(rf"    1\d s  Asking for {site}/", waiting), done.stderr
    assert "    | No server of Debian packages answers.\n    What to do: check the network" in done.stderr


def test_check_says_nothing_but_its_own(tmp_path):
    """PyBullet tells of its build when it is imported; a world's folder may have spaces."""
    folder = tmp_path / "my worlds"
    folder.mkdir()
    world = write_world(folder, collision=(BOX_FLOOR,), dynamic=(box(basePosition=[1.0, 0.0, 0.2]),), robots=(iiwa(),))
    done = run([ROOT / "rpbi", "check", world])
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith(f"{world}: fine; ")


def test_sourced_workspace_replaces_our_examples_but_not_the_simulator(tmp_path):
    """Files of launch files are found by CMAKE_PREFIX_PATH, those in YAML by ROS_PACKAGE_PATH: of the same package."""
    package = tmp_path / "src/rpbi_examples"
    (package / "configs").mkdir(parents=True)
    (package / "package.xml").write_text(
        "<package><name>rpbi_examples</name><version>1.0.0</version><description>theirs</description>"
        "<maintainer email='nobody@example.com'>nobody</maintainer><license>none</license></package>"
    )
    (package / "configs/floor.yaml").write_text("theirs: 1")
    (tmp_path / "devel/share").mkdir(parents=True)
    (tmp_path / "devel/.catkin").write_text(str(tmp_path / "src"))
    launch = tmp_path / "their.launch"
    launch.write_text('<launch><rosparam file="$(find rpbi_examples)/configs/floor.yaml"/></launch>')
    sourced = {"CMAKE_PREFIX_PATH": str(tmp_path / "devel"), "ROS_PACKAGE_PATH": str(tmp_path / "src")}
    asked = [ROOT / "rpbi", "launch", launch, "--dump-params"]
    assert run(asked, **sourced).stdout.strip() == "/theirs: 1"
    (tmp_path / "devel/share/ros_pybullet_interface").mkdir()
    assert "name: floor" in run(asked, **sourced).stdout, "another simulator is not taken for ours"


PROGRAMS: dict[str, list[str]] = {
    "demo": [find_executable("rpbi_examples", "demo.py")],
    "check": [find_executable("ros_pybullet_interface", "check_world.py")],
    "replay": [find_executable("rpbi_utils", "replay")],
    "bench": [sys.executable, str(ROOT / "dev/benchmarks")],
    **{
        name: [find_executable("rpbi_utils", "world"), name]
        for name in ("list", "spawn", "remove", "move", "send", "attach", "detach", "gravity")
    },
}


@pytest.mark.parametrize(("kilobytes", "code"), [(300_000, 1), (500_000, 0)])
def test_memory_limit_is_refused_in_one_line_or_harmless(kilobytes, code):
    done = run(["bash", "-c", f"ulimit -v {kilobytes}; exec {ROOT}/rpbi check {WORLD}"])
    assert done.returncode == code
    assert done.stderr == ("memory is limited to 307 MB (ulimit -v); expected at least 500 MB\n" if code else "")


@pytest.mark.parametrize("command", PROGRAMS)
def test_the_page_has_the_options_that_the_program_has(command):
    told = run([*PROGRAMS[command], "--help"]).stdout
    assert set(re.findall(r"(?<!\w)--\w+", told)) - {"--help"} == set(re.findall(r"(?<!\w)--\w+", SECTIONS[command]))


def test_launch_lists_the_examples():
    done = run([ROOT / "rpbi", "launch"])
    examples = {path.stem for path in (ROOT / "src/rpbi_examples/launch").glob("*.launch")}
    assert set(re.findall(r"^  (\w+) +\S", done.stdout, re.MULTILINE)) == examples


def test_launch_refuses_an_example_that_is_not_there():
    done = run([ROOT / "rpbi", "launch", "basic_exmple_kuka_lwr"])
    assert done.returncode == 2
    assert re.match(r"launch: unknown example .*soft_body.*did you mean 'basic_example_kuka_lwr'\?\n$", done.stderr)


def test_launch_takes_a_package_and_its_file_as_roslaunch_does():
    done = run([ROOT / "rpbi", "launch", "safe_robot", "kuka_lwr.launch", "--ros-args"])
    assert done.returncode == 0 and "  command" in done.stdout
    missing = run([ROOT / "rpbi", "launch", "safe_robot", "nothing.launch"])
    assert missing.returncode == 2 and "nothing.launch" in missing.stderr


def test_launch_refuses_an_argument_that_the_launch_file_lacks():
    done = run([ROOT / "rpbi", "launch", "run_kuka", "gui:=false", "__ns:=left", "real_time_facotr:=0"])
    assert done.returncode == 2
    assert done.stderr == (
        "launch: unknown argument of run_kuka 'real_time_facotr': "
        "known are foxglove, guard, gui, headless, real_robot, real_time_factor, ros2, rviz, stand_in, start, "
        "use_sim_time, view; did you mean 'real_time_factor'?\n"
    )


def _answers(process_id: int) -> bool:
    """Tells whether a process has its own way with SIGINT, as Python has soon after its start."""
    status = Path(f"/proc/{process_id}/status").read_text()
    masks = re.findall(r"^Sig(?:Cgt|Ign):\t(\w+)$", status, re.MULTILINE)
    return any(int(mask, 16) & 1 << (signal.SIGINT - 1) for mask in masks)


def _sources_the_workspace(process: subprocess.Popen) -> bool:
    """Tells whether catkin's Python program runs in the group of a process."""
    for path in Path("/proc").glob("[0-9]*"):
        try:
            group = int((path / "stat").read_text().rpartition(")")[2].split()[2])
            if group == process.pid and "_setup_util.py" in (path / "cmdline").read_text():
                return _answers(int(path.name))
        except OSError:  # it has just ended
            continue
    return False


def _python_has_started(process: subprocess.Popen) -> bool:
    command = Path(f"/proc/{process.pid}/cmdline").read_text()
    return command.startswith("python3\0") and _answers(process.pid)


MOMENTS = {"sourcing the workspace": _sources_the_workspace, "Python has started": _python_has_started}


@pytest.mark.parametrize("moment", MOMENTS)
@pytest.mark.parametrize(
    "words",
    [
        pytest.param(["check", WORLD], id="check"),
        pytest.param(["launch", "run_kuka"], id="launch", marks=pytest.mark.thorough),
        pytest.param(["list"], id="list", marks=pytest.mark.thorough),
        pytest.param(["test", "tests/test_layout.py"], id="test", marks=pytest.mark.thorough),
    ],
)
def test_ctrl_c_at_once_ends_a_command_without_a_traceback(words, moment, tmp_path):
    is_there = MOMENTS[moment]
    for _ in tries("it is seen at that moment, which is short"):
        with open(tmp_path / "log", "w") as log:
            process = subprocess.Popen([ROOT / "rpbi", *words], stdout=log, stderr=log, start_new_session=True)
        while process.poll() is None and not is_there(process):
            time.sleep(0.001)
        if process.poll() is not None:
            continue
        os.killpg(process.pid, signal.SIGSTOP)  # or the moment might be over when the signal comes
        if is_there(process):
            break
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    os.killpg(process.pid, signal.SIGINT)
    os.killpg(process.pid, signal.SIGCONT)
    interrupted = {130, -signal.SIGINT, *([int(pytest.ExitCode.INTERRUPTED)] if words[0] == "test" else [])}
    assert process.wait(60.0) in interrupted
    assert "Traceback" not in (tmp_path / "log").read_text()
