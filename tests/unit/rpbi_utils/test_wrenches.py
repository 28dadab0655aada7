"""Calibration of wrenches: the payload that explains them, and what is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robot_model.geometry import Pose, Quaternion, normalized
from rpbi_utils.wrenches.calibration import (
    CalibrationParameters,
    MovedError,
    PayloadConfig,
    RestingMean,
    WrenchCalibration,
    gravity_in,
)
from rpbi_utils.wrenches.identification import PoseSample, UndeterminedError, identify_payload

LIMITS = CalibrationParameters(max_samples=10)
PAYLOAD = PayloadConfig(
    mass=1.7, centre=(0.03, -0.05, 0.12), force_offset=(2.0, -1.0, 4.0), torque_offset=(0.3, 0.1, -0.2)
)
TILTS = ((0.0, 0.0), (0.6, 0.0), (0.0, 0.6), (-0.5, 0.3))
"""Angles about x and y [rad]."""


def tilted(about_x: float, about_y: float) -> Quaternion:
    return normalized((math.sin(about_x / 2), math.sin(about_y / 2), 0.0, 1.0))


def sample(payload: PayloadConfig, quat: Quaternion, noise: np.ndarray | float = 0.0) -> PoseSample:
    gravity = gravity_in(Pose(quat_xyzw=quat), 9.81)
    return PoseSample(payload.offset + payload.weight(gravity) + noise, gravity)


def test_weight_is_the_wrench_that_holds_the_payload():
    """Upwards by m g, with the moment of a force at the centre."""
    assert PAYLOAD.weight(gravity_in(Pose(), 9.81)) == pytest.approx([0, 0, 16.677, -0.05 * 16.677, -0.03 * 16.677, 0])


@pytest.mark.parametrize("sign", [1, -1], ids=["exerted", "acting on the sensor"])
def test_mass_centre_and_offsets_are_found(sign):
    payload = PAYLOAD.model_copy(update={"mass": sign * PAYLOAD.mass})
    found = identify_payload([sample(payload, tilted(*each)) for each in TILTS], LIMITS)
    assert found.payload.mass == pytest.approx(payload.mass)
    assert found.payload.centre == pytest.approx(payload.centre)
    assert found.payload.offset == pytest.approx(payload.offset)
    assert found.force_residual < 1e-9 and found.torque_residual < 1e-9
    assert str(found).startswith("mass 1.7000 kg")


def test_deviations_are_those_of_many_tries():
    rng = np.random.default_rng(0)
    deviations = np.array([0.2, 0.2, 0.2, 0.02, 0.02, 0.02])
    tries = [
        identify_payload([sample(PAYLOAD, tilted(*each), deviations * rng.normal(size=6)) for each in TILTS], LIMITS)
        for _ in range(400)
    ]
    masses = [each.payload.mass for each in tries]
    centres = np.array([each.payload.centre for each in tries])
    assert np.mean(masses) == pytest.approx(1.7, rel=0.01)
    assert np.std(masses) == pytest.approx(np.sqrt(np.mean([each.mass_sd**2 for each in tries])), rel=0.2)
    assert centres.std(axis=0).max() == pytest.approx(np.sqrt(np.mean([each.centre_sd**2 for each in tries])), rel=0.3)


@pytest.mark.parametrize("torque", [0.001, 0.01], ids=["mass decides", "moment decides"])
@pytest.mark.parametrize("poses", [3, 4])
def test_truth_is_within_two_deviations(poses, torque):
    """About 95 % of cases; without the mass's own deviation 1 % to 70 %."""
    rng = np.random.default_rng(4200 + poses)
    deviations = np.array([0.2, 0.2, 0.2, torque, torque, torque])
    within = []
    for _ in range(500):
        samples = [sample(PAYLOAD, tilted(*each), deviations * rng.normal(size=6)) for each in TILTS[:poses]]
        found = identify_payload(samples, LIMITS)
        off = np.abs(np.subtract(found.payload.centre, PAYLOAD.centre)).max()
        within.append((abs(found.payload.mass - PAYLOAD.mass) < 2.0 * found.mass_sd, off < 2.0 * found.centre_sd))
    assert np.mean(within, axis=0) == pytest.approx(0.95, abs=0.03)


def refused(samples: list[PoseSample]) -> str:
    with pytest.raises(UndeterminedError) as error:
        identify_payload(samples, LIMITS)
    return str(error.value)


def test_poses_that_do_not_determine_it_are_refused():
    about_one_axis = [sample(PAYLOAD, tilted(angle, 0.0)) for angle in (0.0, 0.4, 0.8, 1.2)]
    assert "expected at least 3 poses, got 2" in refused(about_one_axis[:2])
    assert "the poses are too alike" in refused(about_one_axis[:1] * 5)
    told = refused(about_one_axis)
    assert "about a second axis" in told and "got 0.1" not in told
    identify_payload([*about_one_axis, sample(PAYLOAD, tilted(0.4, 0.6))], LIMITS)


def test_a_touch_and_an_empty_sensor_are_refused():
    touched = [sample(PAYLOAD, tilted(*each)) for each in TILTS]
    touched[1].wrench[0] += 9.0
    assert "force: expected a residual of 1 N at most" in refused(touched)
    empty = PAYLOAD.model_copy(update={"mass": 1e-9})
    assert "expected a payload, got a mass of" in refused([sample(empty, tilted(*each)) for each in TILTS])


def test_calibrated_wrench_contains_contacts_only():
    calibration = WrenchCalibration(PAYLOAD)
    push = np.array([1.0, 2.0, 3.0, 0.1, 0.2, 0.3])
    for each in TILTS:
        one = sample(PAYLOAD, tilted(*each), push)
        assert calibration.calibrated(one.wrench, one.gravity) == pytest.approx(push)
    drifted = sample(PAYLOAD, tilted(0.2, 0.1), push)
    calibration.zero(drifted.wrench, drifted.gravity)
    again = sample(PAYLOAD, tilted(-0.4, 0.3), push)
    assert calibration.calibrated(again.wrench, again.gravity) == pytest.approx(np.zeros(6), abs=1e-12)
    plain = WrenchCalibration()
    plain.zero(push, None)
    assert plain.calibrated(2.0 * push, None) == pytest.approx(push)


def mean_of(wrenches: np.ndarray, poses: list[Pose | None]) -> tuple[np.ndarray, Pose | None]:
    mean = RestingMean(LIMITS)
    for wrench, pose in zip(wrenches, poses):
        assert not mean.is_complete
        mean.add(wrench, pose)
    assert mean.is_complete
    return mean.result()


def test_a_mean_is_one_of_a_sensor_at_rest():
    rng = np.random.default_rng(0)
    wrenches = 5.0 + np.array([0.3, 0.3, 0.3, 0.03, 0.03, 0.03]) * rng.normal(size=(10, 6))
    mean, pose = mean_of(wrenches, [Pose()] * 10)
    assert mean == pytest.approx(wrenches.mean(axis=0)) and pose == Pose()
    assert mean_of(wrenches, [None] * 10)[1] is None
    assert mean_of(wrenches, [None, *[Pose()] * 9])[1] is None, "nor if TF comes late"

    pushed = wrenches.copy()
    pushed[5:, 2] += 4.0
    sliding = [Pose((0.0002 * i, 0.0, 0.0)) for i in range(10)]
    turning = [Pose(quat_xyzw=tilted(0.001 * i, 0.0)) for i in range(10)]
    for moved, poses, expected in (
        (pushed, [None] * 10, "the force changes: expected a spread of 1 N at most, got 2"),
        (wrenches, sliding, "the sensor moves: expected 0.001 m at most, got 0.0018"),
        (wrenches, turning, "the sensor turns: expected 0.005 rad at most, got 0.009"),
    ):
        with pytest.raises(MovedError, match=expected):
            mean_of(moved, poses)
