"""Diagnoses faults in valid frames: wrong units, axes or orders of numbers, and segments that get stuck or jump."""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from custom_ros_tools.transforms import Array

from .orientations import inverse, rotate
from .segments import BONES, INDEX, SEGMENTS, SegmentFrame

SHAPE_PERIOD_S = 0.25
"""Period of the checks of a person's shape [s]. The motion is checked at each frame."""
STUCK_S = 1.0
MAX_SPEED_M_S, MAX_STEP_M = 25.0, 0.25
"""Limits of speed and distance between two frames. A segment that exceeds both limits has jumped."""
MAX_TURN_RAD, TURNING_S = np.radians(60.0), 0.1
"""Limit of rotation between two frames, and time in which it applies. A segment that turns further has jumped."""
TRUNK_M = (0.15, 5.0)
"""Plausible range of the distance from pelvis to head [m]. Distances outside it indicate a wrong unit."""
LENGTH_CHANGE, LENGTH_TOLERANCE_M = 0.2, 0.03
_STRAIGHT = {
    "L5": (0, 0, 1),
    "L3": (0, 0, 1),
    "T12": (0, 0, 1),
    "T8": (0, 0, 1),
    "Neck": (0, 0, 1),
    "Head": (0, 0, 1),
    "RightUpperArm": (0, -1, 0),
    "RightForeArm": (0, -1, 0),
    "RightHand": (0, -1, 0),
    "LeftUpperArm": (0, 1, 0),
    "LeftForeArm": (0, 1, 0),
    "LeftHand": (0, 1, 0),
    "RightLowerLeg": (0, 0, -1),
    "RightFoot": (0, 0, -1),
    "RightToe": (0.9, 0, -0.4),
    "LeftLowerLeg": (0, 0, -1),
    "LeftFoot": (0, 0, -1),
    "LeftToe": (0.9, 0, -0.4),
}
"""Approximate direction from the origin of a segment's parent to the segment's origin, in the parent's frame.

The directions are those of the T-pose.
"""
_ROWS = [row for row, (_, child) in enumerate(BONES) if SEGMENTS[child] in _STRAIGHT]
_PARENTS, _CHILDREN = BONES[_ROWS].T
_DIRECTIONS = np.array([_STRAIGHT[SEGMENTS[child]] for child in _CHILDREN], dtype=float)
_DIRECTIONS /= np.linalg.norm(_DIRECTIONS, axis=1)[:, None]
FITTING = np.cos(np.radians(50.0))
"""Cosine of the largest allowed angle between a bone and its direction in `_STRAIGHT`."""
_SWAPPED_SIDES = [INDEX[name.replace("Right", "*").replace("Left", "Right").replace("*", "Left")] for name in SEGMENTS]

_Pose = tuple[Array, Array]


class Finding(NamedTuple):
    """A probable fault of the stream: its subject, such as `jump`, and a message for the user."""

    subject: str
    message: str


def _with_positions(change: Callable[[Array], Array]) -> Callable[[Array, Array], _Pose]:
    return lambda positions, quats: (change(positions), quats)


def _with_quats(change: Callable[[Array], Array]) -> Callable[[Array, Array], _Pose]:
    return lambda positions, quats: (positions, change(quats))


def _picked(columns: list[int]) -> Callable[[Array], Array]:
    return lambda values: values[:, columns]


def _explanations() -> Iterator[tuple[str, Callable[[Array, Array], _Pose]]]:
    """Yields possible faults of a stream, the most likely first: a text, and a function that undoes the fault."""
    y_up = "the stream is Y-up: set y_up: true, or choose Z-up in MVN"
    yield "quaternions come as x, y, z, w instead of w, x, y, z", _with_quats(_picked([3, 0, 1, 2]))
    yield y_up, lambda positions, quats: (positions[:, [2, 0, 1]], quats[:, [2, 0, 1, 3]])
    yield "positions alone are Y-up", _with_positions(_picked([2, 0, 1]))
    yield "orientations alone are Y-up", _with_quats(_picked([2, 0, 1, 3]))
    yield "quaternions are inverted", _with_quats(inverse)
    for (a, first), (b, second) in ((("x", 0), ("y", 1)), (("y", 1), ("z", 2)), (("x", 0), ("z", 2))):
        order = [0, 1, 2]
        order[first], order[second] = second, first
        yield f"axes {a} and {b} of positions are swapped", _with_positions(_picked(order))
        yield f"parts {a} and {b} of quaternions are swapped", _with_quats(_picked([*order, 3]))
    for axis, name in enumerate("xyz"):
        signs = np.ones(4)
        signs[axis] = -1.0
        yield f"axis {name} of positions is reversed", _with_positions(lambda p, s=signs: p * s[:3])  # type: ignore[misc]
        yield f"part {name} of quaternions is reversed", _with_quats(lambda q, s=signs: q * s)  # type: ignore[misc]
    yield "left and right are swapped", lambda positions, quats: (positions[_SWAPPED_SIDES], quats[_SWAPPED_SIDES])


class FrameChecks:
    """Checks successive frames of one person. The frames must have the original, uncalibrated orientations."""

    def __init__(self) -> None:
        self._before: SegmentFrame | None = None
        self._before_s = 0.0
        self._changed_s = np.zeros(len(SEGMENTS))
        self._shape_due_s = -np.inf
        self._lengths: Array | None = None

    def check(self, frame: SegmentFrame, now_s: float) -> list[Finding]:
        """Returns the faults that a frame and the earlier frames reveal.

        Args:
            frame: The newest frame.
            now_s: Arrival of the frame, by any steady clock [s].
        """
        findings = [] if self._before is None else self._motion(self._before, frame, now_s)
        if self._before is None:
            self._changed_s[:] = now_s
        if now_s >= self._shape_due_s:
            self._shape_due_s = now_s + SHAPE_PERIOD_S
            findings += self._shape(frame)
        self._before, self._before_s = frame, now_s
        return findings

    def _motion(self, before: SegmentFrame, frame: SegmentFrame, now_s: float) -> list[Finding]:
        findings = []
        passed_s = (frame.time_ms - before.time_ms) / 1e3
        if passed_s < 0.0:
            findings.append(Finding("time", f"went back by {-passed_s:g} s, from {before.time_ms} ms"))
        if passed_s <= 0.0:
            passed_s = now_s - self._before_s
        steps = frame.positions - before.positions
        steps_m = np.sqrt(np.einsum("ij,ij->i", steps, steps))
        jumps = steps_m > max(MAX_STEP_M, MAX_SPEED_M_S * passed_s)
        if jumps.any():
            who = "the whole person" if jumps.all() else SEGMENTS[int(steps_m.argmax())]
            findings.append(Finding("jump", f"{who} moved by {steps_m.max():.2f} m in {passed_s:.3f} s"))
        cosines = np.abs(np.einsum("ij,ij->i", frame.quats_xyzw, before.quats_xyzw))
        if passed_s < TURNING_S and cosines.min() < np.cos(MAX_TURN_RAD / 2.0):
            turn_deg = np.degrees(2.0 * np.arccos(np.clip(cosines, 0.0, 1.0)))
            which = SEGMENTS[int(turn_deg.argmax())]
            findings.append(Finding("jump", f"{which} turned by {turn_deg.max():.0f} deg in {passed_s:.3f} s"))
        changed = (frame.quats_xyzw != before.quats_xyzw).any(axis=1)
        self._changed_s[changed] = now_s
        stuck = now_s - self._changed_s > STUCK_S
        if stuck.all():
            findings.append(Finding("stuck", f"the same frame is repeated for {STUCK_S:g} s; is MVN paused?"))
        elif stuck.any():
            names = ", ".join(SEGMENTS[index] for index in np.flatnonzero(stuck)[:4])
            findings.append(Finding("stuck", f"{names} has not turned at all for {STUCK_S:g} s, others have"))
        return findings

    def _shape(self, frame: SegmentFrame) -> list[Finding]:
        trunk_m = float(np.linalg.norm(frame.positions[INDEX["Head"]] - frame.positions[0]))
        if not TRUNK_M[0] <= trunk_m <= TRUNK_M[1]:
            unit = _unit(trunk_m)
            advice = f"; if positions come in {unit[0]}, set position_scale: {unit[1]:g}" if unit else ""
            return [Finding("positions", f"pelvis and head are {trunk_m:.3g} m apart{advice}")]
        findings = []
        lengths = np.linalg.norm(np.diff(frame.positions[BONES], axis=1)[:, 0], axis=1)
        if self._lengths is None:
            self._lengths = lengths
        changes = np.abs(lengths - self._lengths)
        worst = int((changes - LENGTH_CHANGE * self._lengths).argmax())
        if changes[worst] > LENGTH_CHANGE * self._lengths[worst] + LENGTH_TOLERANCE_M:
            parent, child = (SEGMENTS[index] for index in BONES[worst])
            change = f"were {self._lengths[worst]:.2f} m apart and are {lengths[worst]:.2f} m apart"
            findings.append(Finding("bones", f"origins of {parent} and {child} {change}; bones are rigid"))
        fits = _fits(frame.positions, frame.quats_xyzw)
        if fits.min() < FITTING:
            child = SEGMENTS[_CHILDREN[fits.argmin()]]
            parent = SEGMENTS[_PARENTS[fits.argmin()]]
            angle = np.degrees(np.arccos(np.clip(fits.min(), -1.0, 1.0)))
            where = f"{child} is {angle:.0f} deg away from where the orientation of {parent} says"
            findings.append(Finding("orientations", f"{where}: {_explanation(frame) or 'positions do not fit it'}"))
        return findings


def _fits(positions: Array, quats: Array) -> Array:
    """Returns the cosine of the angle between each bone and its expected direction in `_STRAIGHT`."""
    bones = rotate(inverse(quats[_PARENTS]), positions[_CHILDREN] - positions[_PARENTS])
    lengths = np.maximum(np.linalg.norm(bones, axis=1), 1e-9)
    return np.asarray(np.einsum("ij,ij->i", bones, _DIRECTIONS) / lengths)


def _explanation(frame: SegmentFrame) -> str | None:
    """Returns the fault whose correction makes all bones fit best; None if no correction makes all bones fit."""
    best, best_fit = None, -1.0
    for words, undo in _explanations():
        fits = _fits(*undo(frame.positions, frame.quats_xyzw))
        if fits.min() >= FITTING and fits.mean() > best_fit:
            best, best_fit = words, float(fits.mean())
    return best


def _unit(trunk_m: float) -> tuple[str, float] | None:
    """Returns the unit in which an implausible trunk length is plausible, and the factor from this unit to metres.

    Returns None if the length is not plausible in any of the units.

    Args:
        trunk_m: Received length of the trunk, taken as metres [m].
    """
    for name, scale in (("centimetres", 0.01), ("millimetres", 0.001), ("inches", 0.0254)):
        if 0.35 <= trunk_m * scale <= 1.1:
            return name, scale
    return None
