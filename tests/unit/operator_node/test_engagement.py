"""The avatar never jumps, wherever it is and the person is."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from operator_node.avatar.joints import LOWER, UPPER
from operator_node.avatar.retargeting import MAX_STEP_S, AvatarPose, Engagement

JOINT_SPEED, SPEED, ANGULAR_SPEED = 3.0, 2.0, 4.0
ROUNDING = 1e-9


def random_pose(random) -> AvatarPose:
    return AvatarPose(
        random.normal(size=3), Rotation.random(random_state=random).as_quat(), random.uniform(LOWER, UPPER)
    )


def angle(a: AvatarPose, b: AvatarPose) -> float:
    return (Rotation.from_quat(a.quat_xyzw).inv() * Rotation.from_quat(b.quat_xyzw)).magnitude()


def test_no_step_exceeds_speed_times_time_at_start_or_reconnect():
    random = np.random.default_rng(0)
    for _ in range(300):
        engagement = Engagement(JOINT_SPEED, SPEED, ANGULAR_SPEED)
        before = random_pose(random)
        engagement.begin(before)
        for _ in range(4):  # after each pause the person is elsewhere
            target, dt = random_pose(random), random.choice((1e-3, 1 / 60, 5.0))
            now = engagement.step(target, dt)
            time_s = min(dt, MAX_STEP_S)
            assert np.abs(now.hinges - before.hinges).max() <= JOINT_SPEED * time_s + ROUNDING
            assert np.linalg.norm(now.position - before.position) <= SPEED * time_s + ROUNDING
            assert angle(before, now) <= ANGULAR_SPEED * time_s + 1e-6
            before = now


def test_it_gets_there_and_stays():
    random = np.random.default_rng(1)
    engagement, target = Engagement(JOINT_SPEED, SPEED, ANGULAR_SPEED), random_pose(random)
    engagement.begin(random_pose(random))
    for _ in range(200):
        now = engagement.step(target, 0.05)
    assert now.hinges == pytest.approx(target.hinges) and now.position == pytest.approx(target.position)
    assert angle(now, target) < 1e-6
