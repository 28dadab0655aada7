"""A fixed transform, as the arguments of a command give it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pydantic import model_validator

from .errors import ConfigError, Problem
from .schema import ConfigModel, FrameId, KeyedError, Position, Quat
from .transforms import quat_of

_ARGUMENTS = "arguments"
_KEYS = {
    8: ("x", "y", "z", "roll", "pitch", "yaw", "PARENT", "CHILD"),
    9: ("x", "y", "z", "qx", "qy", "qz", "qw", "PARENT", "CHILD"),
}


class StaticTransform(ConfigModel):
    """A transform between two frames."""

    parent: FrameId
    child: FrameId
    position: Position
    quat_xyzw: Quat

    @model_validator(mode="after")
    def _between_two_frames(self) -> StaticTransform:
        if self.parent == self.child:
            raise KeyedError("child", f"must be another frame than the parent, got '{self.child}' for both")
        return self

    @classmethod
    def from_arguments(cls, arguments: Sequence[str]) -> StaticTransform:
        """Read `x y z roll pitch yaw PARENT CHILD` or `x y z qx qy qz qw PARENT CHILD` [m, rad].

        Args:
            arguments: Those of the command, without its name and without ROS remappings.

        Raises:
            ConfigError: with one `Problem` for each fault.
        """
        keys = _KEYS.get(len(arguments))
        if keys is None:
            wanted = " or ".join(f"'{' '.join(keys)}'" for keys in _KEYS.values())
            got = f"{len(arguments)} arguments" if arguments else "none"
            raise ConfigError([Problem(_ARGUMENTS, "", f"expected {wanted}, got {got}")])
        problems: list[Problem] = []

        def number(key: str, text: str) -> float:
            try:
                return float(text)
            except ValueError:
                problems.append(Problem(_ARGUMENTS, key, f"expected a number, got {text!r}"))
                return 1.0  # stands in for it while the rest is checked

        numbers = [number(key, text) for key, text in zip(keys[:-2], arguments)]
        data: dict[str, Any] = {"parent": arguments[-2], "child": arguments[-1], "position": numbers[:3]}
        try:
            data["quat_xyzw"] = quat_of(numbers[3:]).tolist()
        except ValueError as error:
            problems.append(Problem(_ARGUMENTS, "", str(error)))
            data["quat_xyzw"] = [0.0, 0.0, 0.0, 1.0]  # likewise
        try:
            transform = cls.parse(data, _ARGUMENTS)
        except ConfigError as error:
            raise ConfigError([*problems, *error.problems]) from None
        if problems:
            raise ConfigError(problems)
        return transform
