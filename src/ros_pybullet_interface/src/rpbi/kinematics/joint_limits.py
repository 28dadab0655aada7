"""Limits of joints, and how positions are brought into them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rpbi.urdf.joints import Joint

from .problem import IKProblem

TURN = 2.0 * np.pi


class JointLimits:
    """Limits of n joints.

    Args:
        joints: The joints.

    Attributes:
        lower: n lower limits [rad or m], -inf where there is none.
        upper: n upper limits [rad or m], inf where there is none.
    """

    def __init__(self, joints: Sequence[Joint]) -> None:
        self._joints = joints
        self._is_revolute = np.array([joint.is_revolute for joint in joints], dtype=bool)
        self.lower = np.array([joint.lower for joint in joints])
        self.upper = np.array([joint.upper for joint in joints])

    def narrowed(self, problem: IKProblem) -> JointLimits:
        """Returns these limits with those of a problem, if it has any, inside them.

        A lower limit above the upper one means none, as it does in PyBullet, where the URDF has none either.

        Raises:
            ValueError: If a joint is left without any position; it names the joint.
        """
        limits = JointLimits(self._joints)
        for i, (joint, lower, upper) in enumerate(zip(self._joints, problem.lowerLimits, problem.upperLimits)):
            if lower > upper and np.isinf((joint.lower, joint.upper)).all():
                continue
            limits.lower[i], limits.upper[i] = max(lower, joint.lower), min(upper, joint.upper)
            if limits.lower[i] > limits.upper[i]:
                urdf = f"the URDF has {joint.lower:g} to {joint.upper:g}"
                message = f"no position of '{joint.name}' is within {lower:g} to {upper:g} ({urdf})"
                raise ValueError(f"lowerLimits, upperLimits: {message}")
        return limits

    def of(self, members: Sequence[int]) -> JointLimits:
        """Returns the limits of some of the joints, by where they are among them."""
        limits = JointLimits([self._joints[i] for i in members])
        limits.lower, limits.upper = self.lower[members], self.upper[members]
        return limits

    def wrap_to_limits(self, q: np.ndarray, near: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Returns positions within the limits, and which of them are not what was given plus whole turns.

        Args:
            q: n positions [rad or m].
            near: n positions; of several turns that fit, revolute joints take the one nearest to these.
        """
        turned = np.where(self._is_revolute, q - TURN * np.round((q - near) / TURN), q)
        over = np.maximum(turned - self.upper, 0.0)
        turned = np.where(self._is_revolute, turned - TURN * np.ceil(over / TURN), turned)
        under = np.maximum(self.lower - turned, 0.0)
        turned = np.where(self._is_revolute, turned + TURN * np.ceil(under / TURN), turned)
        inside = np.clip(turned, self.lower, self.upper)
        return inside, inside != turned

    def random(self, generator: np.random.Generator, near: np.ndarray) -> np.ndarray:
        """Returns n random positions within the limits; half a turn or 1 m around `near` where there are none."""
        half = np.where(self._is_revolute, np.pi, 1.0)
        lower = np.where(np.isfinite(self.lower), self.lower, near - half)
        upper = np.where(np.isfinite(self.upper), self.upper, near + half)
        return generator.uniform(lower, np.maximum(lower, upper))
