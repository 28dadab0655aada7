"""Converts the published pushes to `arm_pushes.npz`, and the study's simulated runs to `arm_pushes_simulators.npz`."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from custom_ros_tools.config import replace_package
from custom_ros_tools.errors import ConfigError, InterfaceError, Problem
from custom_ros_tools.files import atomic_file
from rpbi.world.file_kinds import load_main_file

from ..pose_errors import unit_quaternions
from .marker_calibration import EXPECTED, JOINTS, SPREAD, ArmKinematics, MarkerCalibration, MarkerFit
from .motion_capture import CapturedRun, MarkerPoses, read_recording, read_simulated
from .push_data import PushPoses, mean_poses

RECORDINGS = "Data/MotionCapture"
SIMULATIONS = "Data/Simulation"
URDF = "Software/kinova_description/urdf/m1n6s300.urdf"
STEMS = {1: "Experiment1/Single", 2: "Experiment2/Double", 3: "Experiment3/CubeExp"}
"""Start of the names of an experiment's files."""
MOVING = {1: [1], 2: [1, 4], 3: [1, 2, 3]}
"""Indices of the joints that move in an experiment."""
CHANGED_RUN = 8
"""First run of experiment 2 after a change of the motion capture, which needs a calibration of its own."""
BASE_HEIGHT = 0.055
"""Height [m] of the arm's base above the table, as in the study's simulations."""
CUBE_HALF = 0.0375
SPEED = np.radians(30.0)
"""Largest commanded speed of a joint [rad/s]."""
ENGINES = {
    "PyBullet": "PyBullet",
    "Mujoco": "MuJoCo",
    "VRepBullet278": "V-REP Bullet 2.78",
    "VRepBullet283": "V-REP Bullet 2.83",
    "VRepNewton": "V-REP Newton",
    "VRepODE": "V-REP ODE",
    "VRepVortex": "V-REP Vortex",
}
"""Names of the simulators, indexed by their names in files."""
FRAMES = 25
"""Frames of each run from which the calibration is fitted."""


class _Run(NamedTuple):
    """A recording: experiment, number of the run, and content."""

    experiment: int
    number: int
    recording: CapturedRun

    @property
    def session(self) -> tuple[int, bool]:
        """Runs of equal sessions have one calibration."""
        return self.experiment, self.experiment == 2 and self.number >= CHANGED_RUN


class _Session(NamedTuple):
    """Fitted transforms of a session: the arm's, and those of the cube's markers to the cube's centre."""

    fit: MarkerFit
    calibration: MarkerCalibration
    cube_turn: Rotation
    cube_lift: np.ndarray


def schedule(experiment: int) -> list[tuple[float, dict[int, float]]]:
    """Returns times [s] and new targets [rad] of an experiment, indexed by joint, from the world of the experiment."""
    main = load_main_file(replace_package(f"{{rpbi_reality}}/configs/pushes/experiment_{experiment}.yaml"))
    entries: list[dict[str, Any]] = main["robots"][0]["controllers"]["servo"]["schedule"]
    return [
        (float(each["time_s"]), {int(name[-1]) - 1: float(np.radians(a)) for name, a in each["joints"].items()})
        for each in entries
    ]


def commanded_path(experiment: int) -> np.ndarray:
    """Returns joint angles [rad] every 0.05 s if each joint moves to its targets at 30 deg/s, shape (n, 6)."""
    changes, rows = schedule(experiment), [np.zeros(JOINTS)]
    target = np.zeros(JOINTS)
    for step in range(round((changes[-1][0] + 6.0) / 0.05)):
        for time_s, joints in changes:
            if step == round(time_s / 0.05):
                target[list(joints)] = list(joints.values())
        rows.append(rows[-1] + np.clip(target - rows[-1], -SPEED * 0.05, SPEED * 0.05))
    return np.array(rows)


def departure(time: np.ndarray, way: np.ndarray) -> float | None:
    """Returns when a joint departs: a line through its path between 4 and 18 deg, extended back to 0.

    Args:
        time: Times [s], shape (n,).
        way: Distance from the joint's place before [rad], shape (n,).

    Returns:
        The time [s]; None if the joint does not move as far.
    """
    low, high = np.radians([4.0, 18.0])
    beyond = np.flatnonzero(way > high)
    if not len(beyond):
        return None
    below = np.flatnonzero(way[: beyond[0]] < low)
    rows = slice(below[-1] + 1 if len(below) else 0, beyond[0])
    if beyond[0] - rows.start < 3:
        return None
    return float(np.polynomial.polynomial.polyfit(way[rows], time[rows], 1)[0])


def start_of_commands(time: np.ndarray, angles: np.ndarray, experiment: int) -> float | None:
    """Returns the time in a recording [s] at which the schedule starts; None if no joint moves.

    The later changes of targets decide, since the first motion is late by an uneven time.

    Args:
        time: Times of the recording [s], shape (n,).
        angles: Angles of the moving joints [rad], shape (n, joints).
        experiment: Number of the experiment.
    """

    def departures(begin: float, rest: tuple[float, float], end: float) -> list[float]:
        still, moves = (time > rest[0]) & (time < rest[1]), (time > begin) & (time < end)
        if not still.any() or not moves.any():
            return []
        ways = abs(angles[moves] - np.median(angles[still], 0))
        return [found for way in ways.T if (found := departure(time[moves], way)) is not None]

    first = departures(0.3, (0.3, 0.9), np.inf)
    if not first:
        return None
    begin = float(np.mean(first))
    later = [
        each - change
        for change, _ in schedule(experiment)[1:]
        for each in departures(begin + change - 0.5, (begin + change - 1.2, begin + change - 0.5), begin + change + 2.5)
    ]
    return float(np.mean(later)) if later else begin


def _files(folder: Path, experiment: int) -> list[Path]:
    parent, stem = (folder / STEMS[experiment]).parent, Path(STEMS[experiment]).name
    found = [path for path in parent.glob(f"{stem}*_6D.tsv") if re.fullmatch(rf"{stem}\d+_6D", path.stem)]
    return sorted(found, key=lambda path: path.stem)


def _session(runs: list[_Run], arm: ArmKinematics, known: list[MarkerCalibration]) -> _Session:
    experiment = runs[0].experiment
    fit = MarkerFit(arm, MOVING[experiment], commanded_path(experiment))
    chosen = [_rows(run.recording.hand, np.linspace(60, len(run.recording.time) - 20, FRAMES)) for run in runs]
    expected, spread = EXPECTED, SPREAD
    if known:  # in experiment 2, the data do not tell the height of the base
        mean = MarkerCalibration.of(np.mean([np.concatenate(each) for each in known], 0))
        height = np.array([0.0, 0.0, mean.base_position[2]])
        expected = EXPECTED._replace(
            base_position=height, marker_position=mean.marker_position, marker_rotation=mean.marker_rotation
        )
        spread = SPREAD._replace(
            base_position=np.array([0.02, 0.02, 0.0005]),
            marker_position=np.full(3, 0.002),
            marker_rotation=np.radians(np.full(3, 1.0)),
        )
    calibration, _ = fit.calibration(_joined(chosen), expected, spread)
    rest = calibration.in_base(_joined([_rows(run.recording.cube, np.arange(30, 100)) for run in runs]))
    position, rotation = np.median(rest.position, 0), rest.rotation.mean()
    yaw = Rotation.from_rotvec([0.0, 0.0, np.arctan2(*rotation.as_matrix()[[1, 0], 0])])
    lift = np.array([0.0, 0.0, CUBE_HALF - BASE_HEIGHT - position[2]])
    return _Session(fit, calibration, rotation.inv() * yaw, yaw.inv().apply(lift))


def _rows(body: MarkerPoses, rows: np.ndarray) -> MarkerPoses:
    return body.rows(np.unique(np.clip(rows.astype(int), 0, len(body.position) - 1)))


def _joined(bodies: list[MarkerPoses]) -> MarkerPoses:
    positions, rotations = zip(*bodies)
    return MarkerPoses(np.concatenate(positions), Rotation.concatenate(rotations))


def _converted(run: _Run, session: _Session, path: Path) -> tuple[dict[str, np.ndarray], float]:
    """Returns the arrays of a run, and the time in the recording that becomes time 0 [s]."""
    recording, calibration = run.recording, session.calibration
    angles = session.fit.angles(calibration, recording.hand)
    zero = start_of_commands(recording.time, angles, run.experiment)
    if zero is None:
        raise ConfigError([Problem(str(path), "", "expected a joint that moves by 18 deg or more")])
    all_angles = np.full((len(angles), JOINTS), np.nan)
    all_angles[:, MOVING[run.experiment]] = angles
    hand, cube = calibration.hand(recording.hand), calibration.in_base(recording.cube)
    cube = MarkerPoses(cube.position, cube.rotation * session.cube_turn)
    return {
        "time": recording.time - zero,
        "hand_position": hand.position,
        "hand_quaternion": unit_quaternions(hand.rotation.as_quat()),
        "cube_position": cube.position + cube.rotation.apply(session.cube_lift),
        "cube_quaternion": unit_quaternions(cube.rotation.as_quat()),
        "joint_angle": all_angles,
    }, zero


def convert_pushes(source: Path, folder: Path) -> dict[Path, int]:
    """Converts all runs of a clone of the source.

    Args:
        source: Clone of the repository.
        folder: Folder of the NPZ files, which are written.

    Returns:
        The number of runs in each written file.

    Raises:
        ConfigError: If the clone has no recordings, or a file is not of the expected form.
    """
    try:
        arm = ArmKinematics(source / URDF)
    except (InterfaceError, ValueError) as error:
        raise ConfigError([Problem(str(source / URDF), "", str(error))]) from None
    runs, paths = [], []
    for experiment in STEMS:
        for index, path in enumerate(_files(source / RECORDINGS, experiment)):
            runs.append(_Run(experiment, index + 1, read_recording(path)))
            paths.append(path)
    if not runs:
        raise ConfigError([Problem(str(source), "", f"expected files *_6D.tsv in {RECORDINGS}")])
    sessions: dict[tuple[int, bool], _Session] = {}
    for key in sorted({run.session for run in runs}, key=lambda key: (key[0] == 2, *key)):  # experiment 2 is last
        known = [each.calibration for (other, _), each in sessions.items() if key[0] == 2 != other]
        sessions[key] = _session([run for run in runs if run.session == key], arm, known)
    parts: dict[str, list[np.ndarray]] = {}
    zeros = []
    for run, path in zip(runs, paths):
        arrays, zero = _converted(run, sessions[run.session], path)
        zeros.append(zero)
        for key_, each in arrays.items():
            parts.setdefault(key_, []).append(each.astype(np.float32))
    written = {folder / "arm_pushes.npz": len(runs)}
    columns = {
        "experiment": np.array([run.experiment for run in runs], np.int32),
        "run": np.array([run.number for run in runs], np.int32),
        "zero_in_recording": np.array(zeros, np.float32),
    }
    _write(folder / "arm_pushes.npz", parts, columns)
    if count := _convert_simulators(source / SIMULATIONS, arm, folder / "arm_pushes_simulators.npz"):
        written[folder / "arm_pushes_simulators.npz"] = count
    return written


def _convert_simulators(source: Path, arm: ArmKinematics, target: Path) -> int:
    """Writes the mean of the runs of each simulator and experiment; returns the number of runs."""
    parts: dict[str, list[np.ndarray]] = {}
    experiments, names, total = [], [], 0
    for experiment, stem in STEMS.items():
        for engine, name in ENGINES.items():
            tables = [read_simulated(path) for path in sorted(source.glob(f"{stem}_{engine}_*.csv"))]
            poses = [_simulated_poses(table, engine, arm) for table in tables if table is not None]
            if not poses:
                continue
            length = min(len(each.hand_position) for each in poses)
            with np.errstate(all="ignore"):
                mean = mean_poses([PushPoses(*(column[:length] for column in each)) for each in poses])
            time = np.arange(length) * 0.05 + (0.05 if engine.startswith("VRep") else 0.0)
            for key, each in {"time": time, **mean._asdict()}.items():
                parts.setdefault(key, []).append(each.astype(np.float32))
            experiments.append(experiment)
            names.append(name)
            total += len(poses)
    if total:
        _write(target, parts, {"experiment": np.array(experiments, np.int32), "simulator": np.array(names)})
    return total


def _simulated_poses(table: np.ndarray, engine: str, arm: ArmKinematics) -> PushPoses:
    hand, cube = table[:, 3:7], table[:, 10:14]
    if engine == "Mujoco":  # w is first
        hand, cube = hand[:, [1, 2, 3, 0]], cube[:, [1, 2, 3, 0]]
    if engine == "PyBullet":  # the link before the hand, whose centre of mass is in joint 6
        hand = (Rotation.from_quat(hand) * arm.last_turn).as_quat()
    down = np.array([0.0, 0.0, -BASE_HEIGHT])
    return PushPoses(table[:, :3] + down, hand, table[:, 7:10] + down, cube)


def _write(target: Path, parts: dict[str, list[np.ndarray]], columns: dict[str, np.ndarray]) -> None:
    offset = np.cumsum([0, *map(len, parts["time"])]).astype(np.int32)
    arrays = {key: np.concatenate(each) for key, each in parts.items()}
    target.parent.mkdir(parents=True, exist_ok=True)
    with atomic_file(target) as part, part.open("wb") as stream:
        np.savez_compressed(stream, **arrays, **columns, offset=offset)
