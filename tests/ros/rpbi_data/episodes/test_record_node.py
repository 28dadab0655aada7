"""Episodes recorded from a world, listed, repaired, and simulated again."""

from __future__ import annotations

import contextlib
import io
import json
import os
import re
import shlex
import signal
import subprocess
from pathlib import Path
from typing import Any

import pytest
import rospy
from cob_srvs.srv import SetString
from keyboard.msg import Key
from node_world import main_config, publishing
from ros_system import wait_until
from sensor_msgs.msg import JointState, Joy
from std_msgs.msg import String
from std_srvs.srv import Trigger
from worlds import FLOOR, box, iiwa

from custom_ros_tools.console.modules import command_of
from ros_pybullet_interface.msg import SimulationState
from rpbi_data import EpisodeFolder, episodes_to_dataframes, topic_report
from rpbi_data.episodes.folder import git_state, versions

SPARE_MB = 1000.0
"""Space of the disk that a test leaves free of its reserve [MB], more than others use meanwhile."""
JOINTS = ["lbr_iiwa_joint_1", "lbr_iiwa_joint_2"]
PAGE = (Path(__file__).resolve().parents[4] / "docs/data.md").read_text()
RECORD = "rosrun episodes record_node.py _folder:=$HOME/demos"


def _run(name: str, *words: str | Path) -> tuple[int, str]:
    """Runs a command; returns its exit code and what it printed."""
    command = command_of(f"rpbi_data.console.{name}")
    assert command is not None
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(out):
        code = command.run([str(word) for word in words])
    return code, out.getvalue()


def _of_page(name: str, home: Path) -> list[str]:
    """Returns the words of a command of docs/data.md, from its name on."""
    command = re.search(rf"\./rpbi ({name} [^`\n]+)", PAGE)
    assert command is not None
    return [word.replace("~", str(home)) for word in shlex.split(command[1])]


def _recorder_pid(folder: EpisodeFolder) -> int:
    """Returns the process that records into a folder; other runs of this test have recorders too."""
    pattern = f"bag_writer.*{folder.path}/.*episode.bag"
    return int(subprocess.run(["pgrep", "-f", pattern], capture_output=True, text=True).stdout.split()[0])


class _Session:
    """A world with an arm, and the node that records.

    Args:
        command: The command that starts the node; a launch file has `parameters` as arguments.
    """

    def __init__(self, ros: Any, tmp_path: Path, command: str = RECORD, **parameters: Any) -> None:
        self.ros, self.folder = ros, EpisodeFolder(tmp_path / "demos")
        parts = {"collision": (FLOOR,), "dynamic": (box("box"),), "robots": (iiwa(),)}
        world = main_config(tmp_path, **parts, timeStep=0.004, state_hash_hz=20.0)
        ros.simulator(world, use_sim_time=True)
        parameters = {"disk_reserve_mb": 1.0, "copy_from": [str(tmp_path)], **parameters}
        words = shlex.split(command.replace("$HOME", str(tmp_path)))
        if words[0] == "roslaunch":
            words += [f"{name}:={value}" for name, value in parameters.items()]
        else:
            for name, value in parameters.items():
                rospy.set_param(f"/record/{name}", value)
        self.states = ros.listen("/rpbi/state", SimulationState)
        self.status = ros.listen("/record/status", String)
        self.node = ros.start(words)
        wait_until(lambda: self.now()["recording"] is False, "the node is up")
        wait_until(lambda: "no rpbi/world" not in self.call("start").message, "it has the world's description")

    def call(self, name: str) -> Any:
        return self.ros.call(f"/record/{name}", Trigger)

    def now(self) -> dict[str, Any]:
        return dict(json.loads(self.status.messages[-1].data))

    def has_recorded(self, number: int) -> bool:
        """Returns whether an episode is being recorded and has messages."""
        now = self.now()
        return bool(now["recording"]) and now["episode"] == number and now["messages"] > 100

    def move(self, angle: float) -> None:
        """Moves the arm for a while."""
        with publishing("/rpbi/iiwa/joint_states/target", JointState) as target:
            target.publish(JointState(name=JOINTS, position=[angle, angle / 2]))
            tick = self.states.messages[-1].tick
            wait_until(lambda: self.states.messages[-1].tick > tick + 75, "it moves")


def _answer(answer: Any) -> str:
    assert answer.success, answer.message
    return str(answer.message)


@pytest.mark.quick
def test_episodes_are_recorded_listed_verified_and_changed_files_named(ros: Any, tmp_path: Path) -> None:
    session = _Session(ros, tmp_path, seeds="3")
    folder = session.folder
    session.move(0.3)  # the first episode; a start is refused meanwhile
    assert not session.call("start").success
    with publishing("/keyboard/keydown", Key) as keys:
        keys.publish(Key(code=Key.KEY_s))
        wait_until(lambda: session.now()["label"] == "success", "the key labels it")
    assert "episode 0 is complete" in _answer(session.call("stop"))
    assert not session.call("stop").success
    _answer(session.call("start"))
    session.move(-0.3)
    assert "discarded/episode_000001" in _answer(session.call("discard"))
    session.move(0.1)  # between two episodes
    _answer(session.call("start"))
    session.move(0.5)
    wait_until(lambda: session.now()["messages"] > 100, "the counters have been read")
    os.kill(_recorder_pid(folder), signal.SIGKILL)
    wait_until(lambda: folder.numbers() == [0, 2], "what is left is repaired")

    first, third = folder.all()
    assert (first.label, first.seeds, first.state, first.lost) == ("success", "3", "complete", {})
    assert third.state == "recovered" and third.messages > 0 and "messages recovered of" in third.note
    assert first.topics["/rpbi/iiwa/joint_states"]["messages"] > 10
    assert {"/clock", "/rpbi/commands", "/rpbi/state"} <= first.topics.keys()
    assert any(each["path"].endswith(".urdf") and each["meshes"] for each in first.files)
    assert (first.versions, first.git) == (versions(), git_state()) and len(first.git) >= 40

    code, text = _run("episodes", folder.path)
    assert code == 0 and len(text.splitlines()) == 3 and "recovered" in text
    assert _run("episodes", folder.path, "--relabel", "2", "killed")[0] == 0
    code, text = _run("episodes", folder.path, "--show", "2")
    assert code == 0 and "label    killed" in text
    tables = episodes_to_dataframes(folder.path, "/rpbi/iiwa/joint_states")
    states = tables["/rpbi/iiwa/joint_states"]
    assert states.index.names == ["episode", "time"] and set(states.index.get_level_values(0)) == {0, 2}

    yamls = [each["path"] for each in first.files if each["path"].endswith(".yaml")]
    [path] = [each for each in yamls if "baseMass" in Path(each).read_text()]
    Path(path).write_text(f"# newer\n{Path(path).read_text()}")
    code, text = _run("verify", folder.path, "--jobs", "2")
    assert code == 0, text
    assert "episode 0 (success): same: " in text and "2 of 2 episodes are the same" in text
    assert text.count(f"; note: {path} differs from its copy in the episode\n") == 2

    (folder.folder_of(0) / "episode.yaml").write_text("[")
    [copy] = [each for each in folder.files.glob("*.yaml") if "baseMass" in each.read_text()]
    copy.write_text(copy.read_text().replace("1", "2", 1))
    code, text = _run("verify", folder.path)
    assert code == 1 and text.count(f"files/{copy.name}, the copy of {tmp_path}/") == 1
    assert f"episode 0: {folder.folder_of(0)}/episode.yaml: cannot be read" in text and "0 of 2 episodes" in text


@pytest.mark.thorough
def test_session_of_the_page_works_with_resets_keys_and_buttons(
    ros: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (command,) = re.findall(r"^roslaunch episodes record.launch .*$", PAGE, re.MULTILINE)
    buttons = {"start_button": 1, "discard_button": 2, "label_buttons": {"0": "success"}}
    session = _Session(ros, tmp_path, command, reset=True, also=["joy"], joy="pad", **buttons)
    session.move(0.4)
    assert _answer(ros.call("/record/label", SetString, "shown")) == "episode 0: shown"
    with (
        publishing("/pad", Joy) as joy,
        publishing("/keyboard/keydown", Key) as keys,
        publishing("/rpbi/iiwa/joint_states/target", JointState),
    ):

        def act(press: int | str, **expected: Any) -> None:
            """Presses a key, or a button by its index, and waits for a status."""
            if isinstance(press, str):
                keys.publish(Key(code=getattr(Key, f"KEY_{press}")))
            else:
                joy.publish(Joy(buttons=[int(index == press) for index in range(3)]))
                joy.publish(Joy(buttons=[0, 0, 0]))
            wait_until(lambda: expected.items() <= session.now().items(), f"{press} acts")

        act("r", recording=False, label="shown")
        act(1, recording=True, episode=1)  # the recorder is connected to the target from its beginning
        session.move(-0.4)
        act(0, label="success")
        act(1, recording=False)
        for start, discard in (("r", 2), (1, "x")):
            act(start, recording=True)
            act(discard, recording=False)
    folder = session.folder
    wait_until(lambda: folder.numbers() == [0, 1], "the others are discarded")
    assert [each.label for each in folder.all()] == ["shown", "success"] and folder.taken() == {0, 1, 2, 3}
    assert "/pad" in folder.read(1).topics
    for name in ("episodes", "verify", "view", "export", "check_dataset"):
        if name == "export":
            folder.discard(0)  # the recorder is connected to the target from the beginning of the next one on
        code, text = _run(*_of_page(name, tmp_path))
        assert code == 0, text
    assert (tmp_path / "episode_0.html").exists()
    for to in ("robomimic", "mcap"):
        code, text = _run("export", folder.path, "--to", to, "--out", tmp_path / to)
        assert code == 0, text
        code, text = _run("check_dataset", tmp_path / to, "--source", folder.path)
        assert code == 0, text
    [urdf] = [each for each in folder.files.glob("*.urdf")]
    urdf.write_text(urdf.read_text().replace('<mass value="', '<mass value="1'))
    code, text = _run("verify", folder.path)
    assert code == 1 and f"{urdf.name}, the copy of" in text and "differs at tick" in text


@pytest.mark.thorough
def test_a_second_recorder_leaves_the_running_episode_alone(ros: Any, tmp_path: Path) -> None:
    session = _Session(ros, tmp_path)
    folder = session.folder
    for name, value in (("folder", str(folder.path)), ("disk_reserve_mb", 1.0)):
        rospy.set_param(f"/second/{name}", value)
    second = ros.listen("/second/status", String)
    ros.start(["rosrun", "episodes", "record_node.py", "__name:=second"])
    wait_until(lambda: second.messages, "the second one is up")
    wait_until(lambda: "no rpbi/world" not in ros.call("/second/start", Trigger).message, "it records")
    assert folder.partial() == [folder.part_of(0), folder.part_of(1)]
    assert _run("episodes", folder.path)[1].endswith("2 more: being recorded\n")
    assert _run("episodes", folder.path, "--repair")[1].count("is being recorded by another process") == 2
    assert "episode 0 is complete" in _answer(session.call("stop"))
    assert "episode 1 is complete" in _answer(ros.call("/second/stop", Trigger))
    assert "expected a label of at most" in ros.call("/second/label", SetString, "x" * 101).message


@pytest.mark.thorough
def test_node_repairs_partial_episodes_and_names_a_full_disk(ros: Any, tmp_path: Path) -> None:
    session = _Session(ros, tmp_path)
    session.move(0.2)
    recorder, (part,) = _recorder_pid(session.folder), session.folder.partial()
    wait_until(lambda: (part / "episode.bag.active").stat().st_size > 10_000, "messages are on the disk")
    session.node.kill()
    os.kill(recorder, signal.SIGKILL)
    session.node.wait()
    folder = session.folder
    assert (folder.numbers(), len(folder.partial())) == ([], 1)
    code, text = _run("episodes", folder.path, "--repair")
    assert code == 0 and "episode 0: recovered: the recorder was killed, " in text
    assert folder.read(0).messages > 0 and folder.partial() == []

    rospy.set_param("/record/disk_reserve_mb", folder.free_mb() - SPARE_MB)
    ros.start(["rosrun", "episodes", "record_node.py"])
    wait_until(lambda: session.call("start").success, "it has the world's description")
    wait_until(lambda: session.has_recorded(1), "messages come")
    filler = tmp_path / "filler"
    with filler.open("wb") as file:
        os.posix_fallocate(file.fileno(), 0, int(2e6 * SPARE_MB))
    wait_until(lambda: not session.now()["recording"], "the episode is ended")
    assert "MB free on the disk" in session.call("start").message
    filler.unlink()
    episode = folder.read(1)
    assert episode.state == "incomplete" and "less than the reserve" in episode.note
    assert topic_report(folder.folder_of(1) / "episode.bag")["messages"].sum() == episode.messages > 100

    _answer(session.call("start"))
    wait_until(lambda: session.has_recorded(2), "messages come")
    (folder.part_of(2) / ".episode.yaml.part").touch()  # the node cannot write there any more, its recorder can
    wait_until(lambda: not session.now()["recording"], "the episode is ended")
    assert topic_report(folder.part_of(2) / "episode.bag")["messages"].sum() > 100
    assert (folder.numbers(), folder.partial()) == ([0, 1], [folder.part_of(2)])
