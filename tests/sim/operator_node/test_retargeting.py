"""The avatar does what the person does; what the person does comes from PyBullet's forward kinematics."""

from __future__ import annotations

import time

import numpy as np
import pytest
from avatar_in_pybullet import AvatarInPybullet, largest_errors
from scipy.spatial.transform import Rotation

from operator_node.avatar.anthropometry import segment_offsets
from operator_node.avatar.human_urdf import human_urdf
from operator_node.avatar.joints import HINGES, LOWER, UPPER, segment_frame
from operator_node.avatar.retargeting import AvatarPlace, AvatarPose, Retargeting
from operator_node.mvn.segments import SEGMENTS

HEIGHT_M = 1.75
OFFSETS = segment_offsets(HEIGHT_M)
LEVEL = np.array((0.0, 0.0, 0.0, 1.0))
HIPS = np.array((0.0, 0.0, 0.53 * HEIGHT_M))


@pytest.fixture(scope="module")
def avatar(tmp_path_factory):
    avatar = AvatarInPybullet(human_urdf(HEIGHT_M, 75.0), tmp_path_factory.mktemp("avatar"))
    yield avatar
    avatar.pb.disconnect()


def standing(hinges: dict[str, float], offsets=OFFSETS, turn=LEVEL):
    return segment_frame(offsets, HIPS, turn, hinges)


def hinges_of(pose: AvatarPose) -> dict[str, float]:
    return dict(zip(HINGES, pose.hinges))


def test_pybullet_loads_mass_and_shapes_of_the_urdf(avatar):
    masses = {name: avatar.pb.getDynamicsInfo(avatar.body, index)[0] for name, index in avatar.links.items()}
    pelvis_kg = 0.6 * 0.1117 * 75.0  # which PyBullet leaves out of a fixed base
    assert sum(masses.values()) + pelvis_kg == pytest.approx(75.0, abs=1e-3)
    shapes = {shape[1] for shape in avatar.pb.getVisualShapeData(avatar.body)}
    assert shapes == {avatar.links[name] for name in SEGMENTS}
    for name in SEGMENTS:
        assert avatar.pb.getCollisionShapeData(avatar.body, avatar.links[name]), f"{name} is felt"
        inertia = np.array(avatar.pb.getDynamicsInfo(avatar.body, avatar.links[name])[2])
        assert name == "Pelvis" or (inertia > 0.0).all() and inertia.max() < inertia.sum() - inertia.max()


def test_each_link_is_where_its_segment_is(avatar):
    random = np.random.default_rng(0)
    retargeting = Retargeting(OFFSETS)
    worst_m = worst_deg = 0.0
    for _ in range(400):
        turn = Rotation.random(random_state=random).as_quat()
        avatar.put(AvatarPose(random.normal(size=3), turn, random.uniform(LOWER, UPPER)))
        person = avatar.frame()
        pose = retargeting.pose(person)
        assert (pose.hinges >= LOWER).all() and (pose.hinges <= UPPER).all()
        avatar.put(pose)
        off_m, off_deg = largest_errors(person, avatar.frame())
        worst_m, worst_deg = max(worst_m, off_m), max(worst_deg, off_deg)
    assert worst_m < 1e-3 and worst_deg < 0.1


def test_our_forward_kinematics_are_pybullets(avatar):
    random = np.random.default_rng(2)
    pose = AvatarPose(
        random.normal(size=3), Rotation.random(random_state=random).as_quat(), random.uniform(LOWER, UPPER)
    )
    avatar.put(pose)
    ours = segment_frame(OFFSETS, pose.position, pose.quat_xyzw, hinges_of(pose))
    assert max(largest_errors(avatar.frame(), ours)) < 1e-3


def test_limits_hold_and_the_rest_follows():
    pose = Retargeting(OFFSETS).pose(standing({"jRightElbow_rotz": 0.5, "jLeftElbow_rotz": 1.0, "jC1Head_rotz": 0.4}))
    found = hinges_of(pose)
    assert found["jLeftElbow_rotz"] == pytest.approx(np.radians(10.0)), "it does not bend backwards"
    assert found["jRightElbow_rotz"] == pytest.approx(0.5) and found["jC1Head_rotz"] == pytest.approx(0.4)


def test_hinges_move_continuously_while_the_person_turns_around():
    retargeting, last = Retargeting(OFFSETS), None
    for degrees in range(0, 1080, 4):
        turn = Rotation.from_euler("z", degrees, degrees=True).as_quat() * (-1) ** (degrees // 40)
        angle = np.radians(60.0 * np.sin(np.radians(degrees)))
        pose = retargeting.pose(standing({"jRightHip_rotz": 0.5 * angle, "jLeftShoulder_rotx": angle}, turn=turn))
        if last is not None:
            assert np.abs(pose.hinges - last.hinges).max() < np.radians(5.0)
        last = pose


@pytest.mark.parametrize("middle_deg", (-90.0, 90.0))
def test_a_shoulder_goes_through_its_singular_posture(middle_deg):
    """There only sum or difference of the outer hinges is known; noise must not throw them about."""
    random, retargeting = np.random.default_rng(3), Retargeting(OFFSETS)
    last = None
    for step in np.linspace(-8.0, 8.0, 161):
        hinges = {
            "jRightShoulder_rotx": 0.3,
            "jRightShoulder_roty": np.radians(middle_deg + step),
            "jRightShoulder_rotz": 0.2,
        }
        person = standing(hinges)
        noise = Rotation.from_rotvec(random.normal(0.0, 2e-6, (len(SEGMENTS), 3)))
        noisy = (noise * Rotation.from_quat(person.quats_xyzw)).as_quat()
        pose = retargeting.pose(person._replace(quats_xyzw=noisy))
        if last is not None:
            assert np.abs(pose.hinges - last.hinges).max() < np.radians(1.0)
        last = pose
        off_deg = largest_errors(person, segment_frame(OFFSETS, HIPS, LEVEL, hinges_of(pose)))[1]
        assert off_deg < 0.1


def test_avatar_of_a_taller_person_has_feet_on_the_ground():
    tall = segment_offsets(1.95)
    person = segment_frame(tall, np.array((2.0, 0.0, 0.53 * 1.95)), LEVEL, {"jRightKnee_roty": 0.0})
    pose = Retargeting(OFFSETS).pose(person)
    assert pose.position == pytest.approx((2.0 * 1.75 / 1.95, 0.0, 0.53 * 1.75), abs=1e-9)
    feet = segment_frame(OFFSETS, pose.position, pose.quat_xyzw, {}).positions[SEGMENTS.index("RightFoot"), 2]
    assert feet == pytest.approx(0.039 * 1.75, abs=1e-9)


def test_avatar_begins_at_its_place_and_follows_the_person():
    turn = Rotation.from_euler("z", 50.0, degrees=True).as_quat()
    first = segment_frame(OFFSETS, np.array((7.0, -4.0, 0.9)), turn, {})
    retargeting = Retargeting(OFFSETS, AvatarPlace(1.0, 2.0, np.pi / 2))
    pose = retargeting.pose(first)
    assert pose.position == pytest.approx((1.0, 2.0, 0.9))
    assert Rotation.from_quat(pose.quat_xyzw).as_euler("xyz") == pytest.approx((0.0, 0.0, np.pi / 2))
    ahead = Rotation.from_quat(turn).apply((1.0, 0.0, 0.0))
    pose = retargeting.pose(first._replace(positions=first.positions + ahead))
    assert pose.position == pytest.approx((1.0, 3.0, 0.9)), "a step ahead is one along y here"


def test_a_stream_in_centimetres_is_refused():
    person = standing({})
    with pytest.raises(ValueError, match="expected legs of 0.17 to 4.3 m, got 86 m"):
        Retargeting(OFFSETS).pose(person._replace(positions=100.0 * person.positions))


def test_it_takes_less_than_a_millisecond():
    """The median, so that a busy machine does not matter; benchmarks tell the rest."""
    retargeting, person, times_s = Retargeting(OFFSETS), standing({"jRightElbow_rotz": 0.5}), []
    for _ in range(200):
        start_s = time.thread_time()
        retargeting.pose(person)
        times_s.append(time.thread_time() - start_s)
    assert np.median(times_s) < 1e-3
