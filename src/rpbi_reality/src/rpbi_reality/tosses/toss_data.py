"""Measured tosses of a cube, as `./rpbi reality --convert` writes them."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..npz_file import fault, read_npz, require, rows_of

_ROWS: dict[str, tuple[int | None, ...]] = {"position": (None, 3), "quaternion": (None, 4), "offset": (None,)}
_TOSSES: dict[str, tuple[int | None, ...]] = {
    "start_position": (None, 3),
    "start_quaternion": (None, 4),
    "start_linear_velocity": (None, 3),
    "start_angular_velocity": (None, 3),
    "frame_rate": (),
    "side": (),
}


class Start(NamedTuple):
    """State of the cube at the first frame of a toss.

    Attributes:
        position: Position [m] of the geometric centre in the table's frame, shape (3,).
        quaternion: Orientation x, y, z, w in the table's frame, shape (4,).
        linear_velocity: Velocity [m/s] of the geometric centre in the table's frame, shape (3,).
        angular_velocity: Angular velocity [rad/s] in the cube's frame, shape (3,).
    """

    position: np.ndarray
    quaternion: np.ndarray
    linear_velocity: np.ndarray
    angular_velocity: np.ndarray


class Toss(NamedTuple):
    """A measured toss.

    Attributes:
        name: Number of the toss in the source.
        start: State at the first frame.
        position: Measured positions [m] of the geometric centre, shape (frames, 3).
        quaternion: Measured orientations x, y, z, w, shape (frames, 4).
    """

    name: str
    start: Start
    position: np.ndarray
    quaternion: np.ndarray


class TossData(NamedTuple):
    """All tosses of a file.

    Attributes:
        tosses: The tosses.
        frame_rate: Rate [Hz] of the frames.
        side: Published side [m] of the cube, the unit of position errors.
    """

    tosses: list[Toss]
    frame_rate: float
    side: float

    @classmethod
    def read(cls, path: Path) -> TossData:
        """Reads the tosses of an NPZ file.

        Raises:
            ConfigError: If the file is not of the expected form, or lengths look like millimetres.
        """
        arrays = read_npz(path)
        require(path, arrays, _ROWS | _TOSSES)
        count = len(arrays["offset"]) - 1
        for key, shape in _TOSSES.items():
            if shape and len(arrays[key]) != count:
                raise fault(path, key, f"expected one row for each of {count} tosses, got {len(arrays[key])}")
        if len(arrays["quaternion"]) != len(arrays["position"]):
            raise fault(path, "quaternion", f"expected {len(arrays['position'])} rows, as `position` has")
        for key in ("quaternion", "start_quaternion"):
            if (abs(np.linalg.norm(arrays[key], axis=1) - 1.0) > 0.01).any():
                raise fault(path, key, "expected quaternions of norm 1")
        rate, side = float(arrays["frame_rate"]), float(arrays["side"])
        if not 10.0 <= rate <= 10_000.0:
            raise fault(path, "frame_rate", f"expected 10 to 10000 Hz, got {rate:g}")
        if not 0.001 <= side <= 1.0:
            raise fault(path, "side", f"expected 0.001 to 1 m, got {side:g}; are lengths in millimetres?")
        if abs(arrays["position"]).max() > 20.0:
            raise fault(path, "position", "expected metres, got more than 20; are lengths in millimetres?")
        names = arrays["toss"].tolist() if len(arrays.get("toss", ())) == count else range(count)
        tosses = []
        for index, rows in enumerate(rows_of(path, arrays["offset"], len(arrays["position"]), count)):
            start = Start(*(arrays[f"start_{field}"][index].astype(float) for field in Start._fields))
            pose = (arrays[field][rows].astype(float) for field in ("position", "quaternion"))
            tosses.append(Toss(str(names[index]), start, *pose))
        return cls(tosses, rate, side)
