"""Converts the published cube tosses to the file `cube_tosses.npz`."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from custom_ros_tools.errors import ConfigError, Problem
from custom_ros_tools.files import atomic_file

from ..pose_errors import unit_quaternions
from .tensor_file import read_tensor

FOLDER = "data/tosses_processed"
"""Folder of the tosses in the source."""
UNIT_M = 0.0524
"""Unit of length in the source [m]: half the side of the cube."""
FRAME_RATE = 148.0
SIDE = 0.10248
"""Side of the cube as the positions show it [m]; 0.1048 is published."""
GRAVITY = 9.605
"""Gravity as the positions show it [m/s^2]."""
CENTRE = np.array([0.0, 0.0, 0.0057])
"""Centre of mass in the cube's frame, as the free flight shows it [m]."""
CLEARANCE = 0.0015
"""Height of the lowest corner at which free flight ends [m]."""
COLUMNS = 19
"""Columns of a toss: position, quaternion w x y z, linear and angular velocity, and inputs."""


class FreeFlight(NamedTuple):
    """State of the geometric centre at frame 0, and the number of frames of free flight."""

    frames: int
    position: np.ndarray
    quaternion: np.ndarray
    linear_velocity: np.ndarray
    angular_velocity: np.ndarray


def fit_free_flight(position: np.ndarray, rotation: Rotation) -> FreeFlight:
    """Fits a parabola of the centre of mass and a constant angular velocity to the frames before contact.

    Args:
        position: Positions of the geometric centre [m], shape (n, 3).
        rotation: n orientations.

    Returns:
        The state; the angular velocity is in the cube's frame.

    Raises:
        ValueError: If fewer than 3 frames are free flight.
    """
    signs = np.stack(np.meshgrid((-1, 1), (-1, 1), (-1, 1)), -1).reshape(-1, 3)
    heights = np.stack([position[:, 2] + rotation.apply(corner * SIDE / 2.0)[:, 2] for corner in signs])
    touches = np.flatnonzero(heights.min(0) < CLEARANCE)
    n = int(touches[0]) if len(touches) else len(position)
    if n < 3:
        raise ValueError(f"expected at least 3 frames of free flight, got {n}")
    time = np.arange(n) / FRAME_RATE
    lifted = position[:n] + rotation[:n].apply(CENTRE) + np.outer(GRAVITY * time**2 / 2.0, (0.0, 0.0, 1.0))
    start, velocity = np.polynomial.polynomial.polyfit(time, lifted, 1)
    spin = (rotation[1:n] * rotation[: n - 1].inv()).as_rotvec().mean(0) * FRAME_RATE
    for _ in range(10):
        turned = Rotation.from_rotvec(np.outer(time, spin))
        first = (turned.inv() * rotation[:n]).mean()
        left = (rotation[:n] * (turned * first).inv()).as_rotvec()
        spin = spin + np.polynomial.polynomial.polyfit(time, left, 1)[1]
    first = (Rotation.from_rotvec(np.outer(time, spin)).inv() * rotation[:n]).mean()
    arm = first.apply(CENTRE)
    return FreeFlight(n, start - arm, first.as_quat(), velocity - np.cross(spin, arm), first.inv().apply(spin))


def convert_tosses(source: Path, target: Path) -> int:
    """Converts all tosses of a clone of the source.

    Args:
        source: Clone of the repository, or its folder of tosses.
        target: The NPZ file, which is written.

    Returns:
        The number of tosses.

    Raises:
        ConfigError: If the folder has no tosses, or a file is not of the expected form.
    """
    folder = source / FOLDER if (source / FOLDER).is_dir() else source
    files = sorted((path for path in folder.glob("*.pt") if re.fullmatch(r"\d+", path.stem)), key=lambda p: int(p.stem))
    if not files:
        raise ConfigError([Problem(str(source), "", f"expected files N.pt in {FOLDER}")])
    parts: dict[str, list[np.ndarray]] = {}
    flights = []
    for path in files:
        rows = read_tensor(path)
        rows = rows.reshape(rows.shape[-2:]) if rows.ndim >= 2 else rows
        if rows.ndim != 2 or rows.shape[1] < 13 or len(rows) < 10 or not np.isfinite(rows).all():
            raise ConfigError([Problem(str(path), "", f"expected finite rows of {COLUMNS} numbers, got {rows.shape}")])
        position, quaternion = rows[:, :3] * UNIT_M, unit_quaternions(rows[:, [4, 5, 6, 3]])
        try:
            flights.append(fit_free_flight(position, Rotation.from_quat(quaternion)))
        except ValueError as error:
            raise ConfigError([Problem(str(path), "", str(error))]) from None
        toss = (position, quaternion, rows[:, 7:10] * UNIT_M, rows[:, 10:13])
        for key, each in zip(("position", "quaternion", "linear_velocity", "angular_velocity"), toss):
            parts.setdefault(key, []).append(each.astype(np.float32))
    arrays: dict[str, np.ndarray] = {key: np.concatenate(each) for key, each in parts.items()}
    lengths = [len(each) for each in parts["position"]]
    arrays["offset"] = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int32)
    arrays["toss"] = np.array([int(path.stem) for path in files], np.int32)
    arrays["free_flight_frames"] = np.array([flight.frames for flight in flights], np.int32)
    for key in FreeFlight._fields[1:]:
        arrays[f"start_{key}"] = np.array([getattr(flight, key) for flight in flights], np.float32)
    facts = {"frame_rate": FRAME_RATE, "side": 2.0 * UNIT_M, "measured_side": SIDE, "measured_gravity": GRAVITY}
    target.parent.mkdir(parents=True, exist_ok=True)
    with atomic_file(target) as part, part.open("wb") as stream:
        np.savez_compressed(stream, **arrays, **facts, measured_centre_of_mass=CENTRE)
    return len(files)
