"""Farms of episodes: the same episodes wherever they are made, whoever dies; what is wrong is named."""

from __future__ import annotations

import contextlib
import hashlib
import os
import random
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from farm_policies import DELAY_S
from ros_system import support_on_path, wait_until
from worlds import FLOOR, box, write_world

from rpbi_data import bag_to_images
from rpbi_data.episodes.folder import BAG, EpisodeFolder
from rpbi_data.episodes.verified_messages import verify
from rpbi_data.farm.job import LOG
from rpbi_data.farm.ros.farm import WORKER, Farm
from rpbi_data.farm.ros.maker import EpisodeMaker, make_remotely

ROOT = Path(__file__).resolve().parents[4]
CONSOLE = (sys.executable, str(ROOT / "devel/lib/custom_ros_tools/console"))
KILLS = 3
TICKS, EPISODES = 300, 8


@pytest.fixture(scope="module", autouse=True)
def policies_are_found() -> Iterator[None]:
    """Has the processes of farms find the policies of these tests."""
    with pytest.MonkeyPatch.context() as patch:
        for name, value in support_on_path().items():
            patch.setenv(name, value)
        yield


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A box on a floor."""
    return write_world(tmp_path_factory.mktemp("world"), collision=(FLOOR,), dynamic=(box("box"),), state_hash_hz=20.0)


def words(world: str, out: Path, policy: str = "Slide", episodes: int = EPISODES, **more: Any) -> list[str]:
    """Returns the words of a command."""
    options = {"policy": f"farm_policies:{policy}", "episodes": episodes, "ticks": TICKS, "out": out, **more}
    return ["farm", world, *(str(word) for key, value in options.items() for word in (f"--{key}", value))]


def digests(folder: Path) -> dict[int, str]:
    """Returns the hashes of bags by number; all messages of the same episode are the same, stamps too."""
    episodes = EpisodeFolder(folder)
    return {
        number: hashlib.sha256((episodes.folder_of(number) / BAG).read_bytes()).hexdigest()
        for number in episodes.numbers()
    }


def workers(farm: subprocess.Popen[Any]) -> list[int]:
    """Returns the processes that make episodes for a farm."""
    found = []
    for each in Path(f"/proc/{farm.pid}/task/{farm.pid}/children").read_text().split():
        with contextlib.suppress(OSError):  # it has just ended
            found += [int(each)] * (WORKER.encode() in Path(f"/proc/{each}/cmdline").read_bytes())
    return found


def start(command: list[str], folder: Path) -> subprocess.Popen[Any]:
    """Starts a farm that takes a while, in a session of its own, as in a terminal of its own."""
    options: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "start_new_session": True}
    environment = {**os.environ, DELAY_S: "0.05"}
    return subprocess.Popen([*CONSOLE, *command], cwd=folder, text=True, env=environment, **options)


@pytest.fixture(scope="module")
def alone(world, run, tmp_path_factory) -> Path:
    """Episodes of one process that nobody disturbs."""
    folder = tmp_path_factory.mktemp("alone") / "episodes"
    code, text = run(*words(world, folder, jobs=1))
    assert code == 0 and f"{EPISODES} of {EPISODES} episodes are in {folder}; new: " in text, text
    return folder


def test_episodes_are_those_that_a_recorder_would_write(alone):
    verdicts = [verify(EpisodeFolder(alone), number) for number in range(EPISODES)]
    assert all(verdict.is_same for verdict in verdicts), verdicts
    assert len(set(digests(alone).values())) == EPISODES, "each has a seed of its own"
    episode = EpisodeFolder(alone).read(1)
    assert (episode.state, episode.seeds) == ("complete", "seed 0, episode 1, policy farm_policies:Slide")
    assert {"/rpbi/state", "/rpbi/commands", "/rpbi/world_description", "/clock"} <= episode.topics.keys()
    assert episode.files and {each.label for each in EpisodeFolder(alone).all()} == {"success", "timeout"}
    assert {each.name for each in alone.iterdir() if not each.name.startswith("episode_")} == {
        "farm.yaml",
        LOG,
        "files",
    }


@pytest.mark.thorough
def test_images_of_cameras_are_recorded_on_request(world, run, tmp_path):
    camera = {"name": "eye", "hz": 20, "intrinsics": {"width": 64, "height": 48}, "object_tf": {"tf_id": "rpbi/eye"}}
    pose = {"tf_id": "rpbi/eye", "position": [0.0, 0.0, 2.0], "rpy": [np.pi, 0.0, 0.0]}
    red = {"shapeType": "GEOM_BOX", "halfExtents": [0.1, 0.1, 0.1], "rgbaColor": [1.0, 0.0, 0.0, 1.0]}
    bodies: dict[str, Any] = {"collision": (FLOOR,), "dynamic": (box(createVisualShape=red),), "rgbd_sensor": camera}
    path = write_world(tmp_path, **bodies, poses=[pose])
    for out in ("first", "second"):
        code, text = run(*words(path, tmp_path / out, episodes=1, jobs=1), "--images")
        assert code == 0, text
    assert digests(tmp_path / "first") == digests(tmp_path / "second")
    assert verify(EpisodeFolder(tmp_path / "first"), 0).is_same
    bag = EpisodeFolder(tmp_path / "first").folder_of(0) / BAG
    images = list(bag_to_images(bag, "/rpbi/camera/colour/image/compressed"))
    stamps = [time_s for time_s, _ in images]
    assert len(images) > 3 and np.diff(stamps) == pytest.approx(0.05)
    assert images[0][1].shape == (48, 64, 3) and images[0][1].std() > 5.0 and (images[0][1] != images[-1][1]).any()
    code, text = run(*words(path, tmp_path / "first", episodes=1))
    assert code == 1 and "farm.yaml: images: True there, False asked for" in text
    code, text = run(*words(world, tmp_path / "none", episodes=1), "--images")
    assert code == 1 and "rgbd_sensor: expected a camera for --images, got none" in text
    code, text = run(*words(write_world(tmp_path, **bodies), tmp_path / "none", episodes=1, jobs=1), "--images")
    assert code == 1 and "episode 0: camera 'eye' has no image: expected its frame in `poses`, or its pose" in text


def test_workers_that_are_killed_cost_their_episode_alone(world, alone, tmp_path):
    chance = random.Random(3)
    farm = start(words(world, tmp_path / "farm", jobs=2), tmp_path)
    killed: set[int] = set()
    for _ in range(KILLS):
        wait_until(lambda: set(workers(farm)) - killed, "there is a worker")
        time.sleep(chance.uniform(0.0, 0.6))
        victim = chance.choice(sorted(set(workers(farm)) - killed))
        os.kill(victim, signal.SIGKILL)
        killed.add(victim)
    text, _ = farm.communicate(timeout=120.0)
    assert farm.returncode == 0, text
    assert digests(tmp_path / "farm") == digests(alone)
    assert EpisodeFolder(tmp_path / "farm").partial() == []


@pytest.mark.thorough
def test_an_episode_that_kills_its_workers_is_left_out(world, alone, run, tmp_path):
    code, text = run(*words(world, tmp_path, "Kills", 4, jobs=2))
    assert code == 1 and "episode 1: left out: 3 times its process ended (SIGKILL)" in text, text
    there = digests(tmp_path)
    assert there == {number: found for number, found in digests(alone).items() if number in (0, 2, 3)}
    code, text = run("verify", tmp_path)
    assert code == 0 and "3 of 3 episodes are the same" in text, text


@pytest.mark.parametrize("way", [pytest.param(signal.SIGINT, marks=pytest.mark.thorough), signal.SIGKILL])
def test_interrupted_farm_continues_from_its_episodes(world, alone, run, tmp_path, way):
    folder = tmp_path / "farm"
    farm = start(words(world, folder, jobs=2), tmp_path)
    wait_until(lambda: folder.is_dir() and len(digests(folder)) >= 2, "there are episodes")
    its_workers = workers(farm)
    os.killpg(farm.pid, way) if way == signal.SIGINT else farm.kill()
    text, _ = farm.communicate(timeout=60.0)
    wait_until(lambda: not any(Path(f"/proc/{each}").exists() for each in its_workers), "its workers have ended")
    there = digests(folder)
    assert 2 <= len(there) < EPISODES and there.items() < digests(alone).items()
    if way == signal.SIGINT:
        assert farm.returncode == 130 and EpisodeFolder(folder).partial() == []
        assert f"{len(there)} of {EPISODES} episodes are in {folder}; the same command continues from there" in text
        assert "Traceback" not in text
    code, text = run("episodes", folder, "--repair")
    assert code == 1 and "these are of a farm: it makes them again itself" in text
    EpisodeFolder(folder).discard(min(there))
    assert run(*words(world, folder))[0] == 0
    expected = digests(alone)
    del expected[min(there)]
    assert digests(folder) == expected and EpisodeFolder(folder).partial() == []


def test_a_folder_of_another_farm_is_refused_by_name(world, alone, run, tmp_path):
    before = digests(alone)
    for option, value, expected in (
        ("seed", 5, "seed: 0 there, 5 asked for"),
        ("ticks", 200, "ticks: 300 there, 200 asked for"),
        ("policy", "Raises", "policy: farm_policies:Slide there, farm_policies:Raises asked for"),
    ):
        code, text = run(*words(world, alone, **{option: value}))
        assert code == 1 and f"farm.yaml: {expected}" in text, text
    (tmp_path / "notes.txt").write_text("mine")
    with Farm(world, "farm_policies:Slide", ticks=TICKS).claimed(EpisodeFolder(alone)):
        code, text = run(*words(world, alone))
        assert code == 1 and "another farm is at work in it" in text
    code, text = run(*words(world, tmp_path))
    assert code == 1 and "expected an empty folder or one of a farm, it has notes.txt" in text
    assert digests(alone) == before and [each.name for each in tmp_path.iterdir()] == ["notes.txt"]


def test_a_world_that_has_changed_is_refused(run, tmp_path):
    path = write_world(tmp_path, collision=(FLOOR,), dynamic=(box("box"),))
    assert run(*words(path, tmp_path / "farm", episodes=1))[0] == 0
    write_world(tmp_path, collision=(FLOOR,), dynamic=(box("box", (0.1, 0.1, 0.11)),))
    code, text = run(*words(path, tmp_path / "farm", episodes=2))
    assert code == 1 and "farm.yaml: the world, or a file that it names has changed" in text, text


@pytest.mark.parametrize(
    ("policy", "fault"),
    [
        ("Raises", "Raises failed in act at tick 7 with the seed (0, 1): KeyError: 'gripper' ("),
        ("RaisesAtOnce", "RaisesAtOnce failed in __init__ at tick 0 with the seed (0, 1): SystemExit: no such file ("),
        (
            "NoWord",
            "NoWord failed in act at tick 0 with the seed (0, 1): ValueError: expected a word as label, or None",
        ),
        ("TooEarly", "TooEarly failed in act at tick 0 with the seed (0, 1): ValueError: expected None before"),
        (
            "NotFinite",
            "NotFinite failed in act at tick 0 with the seed (0, 1): ValueError: force[0]: input should be a finite",
        ),
        ("Steps", "Steps failed in act at tick 0 with the seed (0, 1): ValueError: expected a policy that neither"),
    ],
)
def test_failing_policy_is_named_and_its_episode_not_written(world, tmp_path, policy, fault):
    maker = EpisodeMaker(Farm(world, f"farm_policies:{policy}", ticks=50).job)
    folder = EpisodeFolder(tmp_path)
    outcomes = [maker.make(folder, number) for number in (1, 2)]
    assert outcomes[0].fault.startswith(f"farm_policies:{fault}"), outcomes[0].fault
    assert not outcomes[0].stops and outcomes[1].label == "timeout"
    assert folder.numbers() == [2] and folder.partial() == []


def test_farm_continues_after_a_failing_policy(world, run, tmp_path):
    code, text = run(*words(world, tmp_path, "Raises", 4, ticks=50))
    assert code == 1 and f"2 of 4 episodes are in {tmp_path}; new: 2 timeout" in text, text
    for number in (0, 1):
        assert f"episode {number}: farm_policies:Raises failed in act at tick 7 with the seed (0, {number})" in text
    assert EpisodeFolder(tmp_path).numbers() == [2, 3]
    assert "KeyError: 'gripper'" in (tmp_path / LOG).read_text(), "with its traceback"


def test_farm_that_cannot_start_is_named(world, run, tmp_path):
    code, text = run(*words(world, tmp_path, "Slidd"))
    assert code == 1 and "--policy: policy 'farm_policies:Slidd': 'farm_policies' has no 'Slidd'; did you mean" in text
    code, text = run(*words(world, tmp_path, policy="FAULTY"))
    assert code == 1 and "expected a subclass of rpbi_data.farm.policy:Policy" in text
    code, text = run(*words(str(tmp_path / "none.yaml"), tmp_path))
    assert code == 1 and "none.yaml: no such file" in text
    with pytest.raises(SystemExit, match="2"):
        run(*words(world, tmp_path, episodes=0))
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_is_named_and_nothing_is_lost(world, alone, run, tmp_path, file_limit):
    assert run(*words(world, tmp_path, episodes=1))[0] == 0
    code, text = run(*words(world, tmp_path, **{"disk-reserve-mb": 1e9}))
    assert code == 1 and "MB free on the disk, less than the reserve of" in text, text
    file_limit((tmp_path / "episode_000000" / BAG).stat().st_size // 2)
    code, text = run(*words(world, tmp_path))
    assert code == 1 and "cannot be written: [Errno 27] File too large" in text, text
    assert "1 of 8 episodes are in" in text
    assert digests(tmp_path) == {0: digests(alone)[0]} and EpisodeFolder(tmp_path).partial() == []


def test_a_node_that_has_something_else_is_named(world):
    job = Farm(world, "farm_policies:Slide", ticks=50).job
    for change, thing in (({"world_sha256": "0"}, "the world of "), ({"policy_sha256": "0"}, "the file of the policy")):
        outcome, files = make_remotely(replace(job, **change), 0)
        assert outcome.stops and outcome.fault.startswith(f"{socket.gethostname()}: {thing}") and not files, outcome


@pytest.mark.thorough
def test_the_policy_of_the_page_makes_a_data_set(run, tmp_path):
    block = re.search(r"```python\n(.*?)```", (ROOT / "docs/farm.md").read_text(), re.DOTALL)
    assert block is not None
    (tmp_path / "push.py").write_text(block[1])
    kuka = "{rpbi_examples}/configs/basic_example_kuka_lwr/config.yaml"
    command = ["farm", kuka, "--policy", "push:Push", "--episodes", "4", "--seconds", "2", "--out", "pushes"]
    text, _ = (farm := start(command, tmp_path)).communicate(timeout=120.0)
    assert farm.returncode == 0, text
    assert {episode.label for episode in EpisodeFolder(tmp_path / "pushes").all()} == {"success", "timeout"}, text
    code, text = run("export", tmp_path / "pushes", "--to", "robomimic", "--out", tmp_path / "out")
    assert code == 0, text
    with h5py.File(tmp_path / "out/dataset.hdf5") as file:
        actions = [file[f"data/demo_{number}/actions"][:] for number in range(4)]
    assert all(np.ptp(each, axis=0).max() > 0.1 for each in actions), "targets of the policy are actions"


def test_without_ray_the_extra_is_named(world, run, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    code, text = run(*words(world, tmp_path, address="127.0.0.1:1"))
    assert code == 1 and "'ray' is not installed: ./rpbi setup farm" in text, text


@pytest.mark.thorough
def test_a_cluster_that_loses_a_node_makes_the_same_episodes(world, alone, run, tmp_path):
    import ray  # noqa: F401 (the extra `farm`)

    program = ROOT / "tests/support/programs/farm_on_ray.py"
    done = subprocess.run(
        [sys.executable, str(program), str(tmp_path), *words(world, tmp_path / "farm")],
        capture_output=True,
        env={**os.environ, DELAY_S: "0.05"},
        text=True,
        timeout=240.0,
    )
    assert done.returncode == 0, done.stderr
    assert digests(tmp_path / "farm") == digests(alone)
    lost = (tmp_path / "lost.txt").read_text()
    assert "the head of the Ray cluster does not answer" in lost and "Traceback" not in lost, lost
    there = digests(tmp_path / "lost")
    assert there and there.items() < digests(alone).items() and EpisodeFolder(tmp_path / "lost").partial() == []
    assert run(*words(world, tmp_path / "lost"))[0] == 0, "goes on without the cluster"
    assert digests(tmp_path / "lost") == digests(alone)
