"""The converter of the published pushes, on files of the source's form with known transforms."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from custom_ros_tools.errors import ConfigError
from rpbi_reality.console.reality import reality
from rpbi_reality.pose_errors import angle_deg
from rpbi_reality.pushes.convert_pushes import RECORDINGS, SIMULATIONS, STEMS, URDF, convert_pushes, schedule
from rpbi_reality.pushes.marker_calibration import ArmKinematics
from rpbi_reality.pushes.motion_capture import MarkerPoses, read_recording

LENGTHS = [
    (0.0, 0.0, 0.15),
    (0.0, 0.0, 0.12),
    (0.0, -0.29, 0.0),
    (0.0, 0.12, -0.01),
    (0.0, 0.0, -0.08),
    (0.0, 0.0, -0.08),
]
TURNS = [
    (0.0, 3.1416, 0.0),
    (-1.5708, 0.0, 3.1416),
    (0.0, 3.1416, 0.0),
    (-1.5708, 0.0, 0.0),
    (1.0, 0.0, 0.0),
    (1.0, 0.0, 0.0),
]
BASE = MarkerPoses(np.array([[0.004, -0.003, 0.0505]]), Rotation.from_euler("xyz", [0.2, -0.3, 2.0], degrees=True))
MARKERS = MarkerPoses(np.array([[0.003, 0.0, -0.004]]), Rotation.from_euler("xyz", [0.5, -0.3, 0.4], degrees=True))
"""Not far from what the fit expects, since the data do not tell all of it."""
CUBE = MarkerPoses(np.array([[0.501, 0.003, -0.0175]]), Rotation.from_euler("z", 4.0, degrees=True))
LIFT_M = 0.009
ZERO_S = 1.3
"""Time in the recordings at which the schedule starts."""


def _urdf() -> str:
    names = ["m1n6s300_link_base", *(f"m1n6s300_link_{n}" for n in range(1, 7))]
    links = "".join(f'<link name="{name}"/>' for name in names)
    joints = ""
    for index in range(6):
        xyz, rpy = (" ".join(map(str, each[index])) for each in (LENGTHS, TURNS))
        joints += f"""<joint name="m1n6s300_joint_{index + 1}" type="continuous"><origin xyz="{xyz}" rpy="{rpy}"/>
            <parent link="{names[index]}"/><child link="{names[index + 1]}"/><axis xyz="0 0 1"/></joint>"""
    return f'<robot name="arm">{links}{joints}</robot>'


def _angles(experiment: int, time: np.ndarray) -> np.ndarray:
    """Returns joint angles that follow the schedule at 30 deg/s, shape (n, 6)."""
    changes, rows, target = list(schedule(experiment)), [], np.zeros(6)
    now = np.zeros(6)
    for time_s in time:
        while changes and time_s - ZERO_S >= changes[0][0]:
            for joint, angle in changes.pop(0)[1].items():
                target[joint] = angle
        now = now + np.clip(target - now, -np.radians(0.3), np.radians(0.3))
        rows.append(now)
    return np.array(rows)


def _columns(position: np.ndarray, rotation: Rotation) -> np.ndarray:
    rest = np.zeros((len(position), 4))
    return np.hstack([position * 1e3, rest, rotation.as_matrix().transpose(0, 2, 1).reshape(-1, 9)])


def _pushed(time: np.ndarray) -> MarkerPoses:
    position = np.repeat(CUBE.position, len(time), 0)
    position[:, 0] += 0.02 * np.clip(time - 12.0, 0.0, 2.0)
    return MarkerPoses(position, Rotation.concatenate([CUBE.rotation] * len(time)))


def _write_run(repository: Path, experiment: int, duration_s: float, seed: int) -> tuple[np.ndarray, MarkerPoses]:
    """Writes a recording; returns the times and the poses of the hand in the base link."""
    time, random = np.arange(0.0, duration_s, 0.01), np.random.default_rng(seed)
    hand = ArmKinematics(repository / URDF).hand(_angles(experiment, time))
    cube, n = _pushed(time), len(time)
    seen = {
        "base": (np.repeat(BASE.position, n, 0), Rotation.concatenate([BASE.rotation] * n)),
        "hand": (hand.position + hand.rotation.apply(MARKERS.position), hand.rotation * MARKERS.rotation),
        "cube": (cube.position + [0.0, 0.0, LIFT_M], cube.rotation * Rotation.from_euler("x", 0.8, degrees=True)),
    }
    table = [np.arange(n)[:, None] + 1.0, time[:, None]]
    for name, (position, rotation) in seen.items():
        if name != "base":
            position, rotation = BASE.position + BASE.rotation.apply(position), BASE.rotation * rotation
        table += [_columns(position + random.normal(0.0, 2e-4, position.shape), rotation), np.full((n, 1), np.nan)]
    path = repository / RECORDINGS / f"{STEMS[experiment]}{seed:04d}_6D.tsv"
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = ["\t".join("" if np.isnan(x) else f"{x:.5f}" for x in row) for row in np.hstack(table)]
    path.write_text("\n".join(lines) + "\n")
    return time, hand


@pytest.fixture
def repository(tmp_path) -> Path:
    (tmp_path / "source" / URDF).parent.mkdir(parents=True)
    (tmp_path / "source" / URDF).write_text(_urdf())
    return tmp_path / "source"


def _write_simulated(repository: Path, engine: str, quaternion: list[float]) -> None:
    row = [0.1, 0.2, 0.4, *quaternion, 0.5, 0.0, 0.0375, *quaternion]
    folder = repository / SIMULATIONS / "Experiment1"
    folder.mkdir(parents=True, exist_ok=True)
    for number in (0, 1):
        shifted = [row[0] + 0.01 * number, *row[1:]]
        (folder / f"Single_{engine}_{number}.csv").write_text(f"{' '.join(map(str, shifted))}\n" * 120)


def test_known_transforms_and_times_are_found(repository, tmp_path, capsys):
    truth = {(1, 1): _write_run(repository, 1, 8.0, 1), (3, 1): _write_run(repository, 3, 20.0, 2)}
    _write_simulated(repository, "Mujoco", [1.0, 0.0, 0.0, 0.0])
    _write_simulated(repository, "VRepNewton", [0.0, 0.0, 0.0, 1.0])
    assert reality(convert=repository, data=tmp_path / "data") == 0
    assert "arm_pushes.npz: 2 runs" in capsys.readouterr().out
    found = dict(np.load(tmp_path / "data/arm_pushes.npz"))
    for index, ((experiment, _), (time, hand)) in enumerate(truth.items()):
        rows = slice(*found["offset"][index : index + 2])
        assert found["experiment"][index] == experiment
        assert found["zero_in_recording"][index] == pytest.approx(ZERO_S, abs=0.02)
        assert found["time"][rows] == pytest.approx(time - found["zero_in_recording"][index], abs=1e-4)
        error = np.linalg.norm(found["hand_position"][rows] - hand.position, axis=1)
        raw = np.linalg.norm(read_recording(_recording(repository, experiment)).hand.position - hand.position, axis=1)
        assert np.median(error) < 0.004 < 0.03 < np.median(raw)  # one joint does not tell the place of the markers
        assert np.median(angle_deg(found["hand_quaternion"][rows], hand.rotation.as_quat())) < 1.0
        cube = found["cube_position"][rows]
        assert cube[:100, 2].mean() == pytest.approx(-0.0175, abs=1e-3)  # on the table
        assert np.linalg.norm(cube - _pushed(time).position, axis=1).max() < 0.0035
    simulated = dict(np.load(tmp_path / "data/arm_pushes_simulators.npz"))
    assert simulated["simulator"].tolist() == ["MuJoCo", "V-REP Newton"]
    assert simulated["hand_position"][0] == pytest.approx([0.105, 0.2, 0.345])  # mean of the runs, above the base
    assert simulated["hand_quaternion"] == pytest.approx(np.tile([0.0, 0.0, 0.0, 1.0], (240, 1)))
    assert simulated["time"][[0, 120]] == pytest.approx([0.0, 0.05])


def _recording(repository: Path, experiment: int) -> Path:
    return next((repository / RECORDINGS).glob(f"{STEMS[experiment]}*"))


def test_frames_without_a_body_are_left_out(repository):
    _write_run(repository, 1, 3.0, 1)
    path = _recording(repository, 1)
    lines = path.read_text().splitlines()
    lines[5] = "\t".join([*lines[5].split("\t")[:19], *[""] * 34])
    lines[7] = "\t".join([*lines[7].split("\t")[:2], *["0.00000"] * 51])
    path.write_text("\n".join(lines))
    time = read_recording(path).time
    assert len(time) == len(lines) - 2 and 0.05 not in time.round(3) and 0.07 not in time.round(3)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda lines: ["No header\twas expected", *lines], "columns of numbers"),
        (lambda lines: [line.rsplit("\t", 20)[0] for line in lines], "0 of 300 rows have them"),
        (lambda lines: [*lines[:100], *lines[:100]], "increasing times"),
    ],
)
def test_faulty_recordings_are_refused(repository, tmp_path, spoil, message):
    _write_run(repository, 1, 3.0, 1)
    path = _recording(repository, 1)
    path.write_text("\n".join(spoil(path.read_text().splitlines())))
    with pytest.raises(ConfigError, match=message) as refused:
        convert_pushes(repository, tmp_path / "data")
    assert path.name in str(refused.value) and not (tmp_path / "data").exists()


def test_a_recording_without_motion_is_refused(repository, tmp_path):
    _write_run(repository, 1, 1.2, 1)
    with pytest.raises(ConfigError, match="expected a joint that moves by 18 deg or more"):
        convert_pushes(repository, tmp_path / "data")


def test_a_clone_without_recordings_is_refused(repository, tmp_path):
    (repository / RECORDINGS).mkdir(parents=True)
    with pytest.raises(ConfigError, match=r"expected files \*_6D.tsv"):
        convert_pushes(repository, tmp_path / "data")
