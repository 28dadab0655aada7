"""A plant for pushing that simulates the world in this process, without ROS."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Any, cast

import numpy as np

from custom_ros_tools.transforms import yaw_of
from rpbi.samples import ViconSample
from rpbi.world import World
from rpbi.world.forks.prediction import PlannedInput, Prediction
from rpbi_mpc.controller import Plant, Sensed
from rpbi_mpc.sampling.world import RolloutTicks

from .planar.motion import rotation

TIMEOUT_S = 0.1
"""Time without a pose of the slider after which the slider counts as hidden [s]."""


class PushingWorld(Plant):
    """A simulated plant with a slider that is tracked by Vicon, and a pusher on two linear joints.

    The commands are the velocities of both joints. Measurements of pusher and slider have the same delay.

    Args:
        world: World with a body `box`, which has a sensor `vicon`, and a robot `pusher`. The first two joints of the
            robot move the pusher along x and y.
        middle: Position x, y of the slider's middle in the body's frame [m].
        timeout_s: Time without a pose after which the slider counts as hidden [s].

    Attributes:
        truth: True scenes, one row per `advance`: time [s], x, y, yaw of the slider, x, y of the pusher [m, rad].
    """

    def __init__(self, world: World, middle: tuple[float, float] = (0.0, 0.0), timeout_s: float = TIMEOUT_S) -> None:
        self.world, self.middle, self._timeout_s = world, np.array(middle), timeout_s
        self.box, self.pusher = cast(Any, world.bodies["box"]), cast(Any, world.bodies["pusher"])
        self._joints = [joint.name for joint in self.pusher.model.moving][:2]
        self._base = np.array(self.pusher.base_pose().position[:2])
        self._pushers = deque([self.pusher_position()], maxlen=round(1.0 / world.clock.dt_s))
        self._newest: tuple[int, np.ndarray] | None = None
        self._seen_tick = world.clock.tick
        self.truth: list[np.ndarray] = []
        """True scene after each `advance`: time [s], x, y, yaw of the slider, x, y of the pusher."""
        self.stand()

    def sense(self) -> Sensed:
        tick, dt_s = self.world.clock.tick, self.world.clock.dt_s
        unseen_s = (tick - self._seen_tick) * dt_s
        if self._newest is None or unseen_s > self._timeout_s:
            return Sensed(
                tick * dt_s, None, f"box: no pose for {unseen_s:.2f} s, expected one every {self._timeout_s:g} s"
            )
        measured_tick, pose = self._newest
        age = tick - measured_tick
        pusher = self._pushers[-1 - min(age, len(self._pushers) - 1)]
        return Sensed(tick * dt_s, np.concatenate([pose, pusher]), age_s=age * dt_s)

    def act(self, command: np.ndarray) -> None:
        self.world.put(*self._target(command))

    def _target(self, command: np.ndarray) -> tuple[str, dict[str, float]]:
        return "pusher/target", dict(zip(self._joints, map(float, command)))

    def stand(self) -> None:
        self.act(np.zeros(2))

    def advance(self, duration_s: float) -> None:
        for _ in range(round(duration_s / self.world.clock.dt_s)):
            for sample in self.world.step():
                if isinstance(sample, ViconSample):
                    self._see(sample)
            self._pushers.append(self.pusher_position())
        self.truth.append(
            np.array([self.world.clock.tick * self.world.clock.dt_s, *self.slider_pose(), *self._pushers[-1]])
        )

    def scenes(self, velocities: np.ndarray, period_s: float, delay_s: float) -> np.ndarray:
        """Simulates candidates in forks of the world, and returns the scenes; see `PushRollouts`."""
        ticks = RolloutTicks.of(velocities.shape[1], period_s, delay_s, self.world.clock.dt_s)
        candidates = [
            [PlannedInput(int(start), *self._target(velocity)) for start, velocity in zip(ticks.starts, each)]
            for each in velocities
        ]
        found = self.world.predict(candidates, ticks.total, watch=("box", "pusher"), every=ticks.every)
        return np.stack([self._scenes(each, ticks.rows) for each in found])

    def _scenes(self, prediction: Prediction, rows: np.ndarray) -> np.ndarray:
        if prediction.fault:
            return np.full((len(rows), 5), np.nan)
        poses = np.array([self._in_plane(pose[:3], pose[3:]) for pose in prediction.poses["box"][rows]])
        return np.hstack([poses, self._base + prediction.joints["pusher"][rows, :2]])

    def pusher_position(self) -> np.ndarray:
        """Returns the true position x, y of the pusher in the world [m]."""
        position: np.ndarray = self._base + list(self.pusher.joint_positions().values())[:2]
        return position

    def slider_pose(self) -> np.ndarray:
        """Returns the true pose x, y, yaw of the slider's middle in the world [m, m, rad]."""
        pose = self.box.base_pose()
        return self._in_plane(pose.position, pose.quat_xyzw)

    def _see(self, sample: ViconSample) -> None:
        tick = self.world.clock.tick - round(sample.age_ns / (self.world.clock.dt_s * 1e9))
        if self._newest is None or tick > self._newest[0]:
            self._newest = (tick, self._in_plane(sample.pose.position, sample.pose.quat_xyzw))
            self._seen_tick = self.world.clock.tick

    def _in_plane(self, position: Sequence[float], quat_xyzw: Sequence[float]) -> np.ndarray:
        yaw = yaw_of(quat_xyzw)
        middle = np.array(position[:2]) + rotation(yaw) @ self.middle
        return np.array([*middle, yaw])
