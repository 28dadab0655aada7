"""Sensors that report bodies as Vicon and AprilTag detectors do, with latency, noise and occlusion."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from worlds import FLOOR, ball, box, iiwa, write_world

from custom_ros_tools.errors import ConfigError
from robot_model.geometry import rotation_between
from rpbi.geometry import Pose
from rpbi.ros.interface_table import endpoints
from rpbi.samples import AprilTagsSample, ViconSample
from rpbi.world import World

DT_NS = 1_000_000
LOOKS_DOWN = (1.0, 0.0, 0.0, 0.0)
"""Orientation of an optical frame that looks along -z of the world, with its x along x."""


@pytest.fixture
def build(tmp_path) -> Iterator[Callable[..., World]]:
    """Builds a world."""
    worlds = []

    def build_world(*dynamic: dict[str, Any], **more: Any) -> World:
        worlds.append(World.from_file(write_world(tmp_path, dynamic=dynamic, collision=(FLOOR,), **more)))
        return worlds[-1]

    yield build_world
    for world in worlds:
        world.close()


def sliding(**sensor: Any) -> dict[str, Any]:
    """Returns a box that falls and turns, seen by Vicon."""
    velocity = {"linearVelocity": [0.5, 0.0, 1.0], "angularVelocity": [0.0, 0.0, 1.0]}
    vicon = {"type": "vicon", "name": "box", "hz": 100, **sensor}
    return box("box", basePosition=[0.0, 0.0, 1.0], resetBaseVelocity=velocity, sensors=[vicon])


def run(world: World, ticks: int, kind: type) -> tuple[list[tuple[int, Any]], list[Pose]]:
    """Returns the samples of a kind with their ticks, and where the box was at each tick."""
    samples, poses = [], [world.bodies["box"].base_pose()]
    for _ in range(ticks):
        samples += [(world.clock.tick, one) for one in world.step() if isinstance(one, kind)]
        poses.append(world.bodies["box"].base_pose())
    return samples, poses


def test_vicon_reports_where_the_body_was_and_how_long_ago(build) -> None:
    samples, poses = run(build(sliding(latency_s=0.025)), 200, ViconSample)
    assert [tick for tick, _ in samples] == list(range(40, 201, 10)), "at its rate, once something is old enough"
    for tick, sample in samples:
        assert (sample.name, sample.frame, sample.age_ns) == ("box/box", "vicon/box/box", 30 * DT_NS)
        assert sample.pose.position == pytest.approx(poses[tick - 30].position)
        assert sample.pose.quat_xyzw == pytest.approx(poses[tick - 30].quat_xyzw)


def test_noise_has_its_configured_deviation_and_is_reproducible(build) -> None:
    world = build(sliding(hz=1000, noise_m=[0.001, 0.002, 0.0], noise_rad=0.01, seed=3))
    samples, poses = run(world, 1000, ViconSample)
    errors = np.array(
        [
            (
                *np.subtract(sample.pose.position, poses[tick].position),
                *rotation_between(poses[tick].quat_xyzw, sample.pose.quat_xyzw),
            )
            for tick, sample in samples
        ]
    )
    assert errors.std(axis=0) == pytest.approx([0.001, 0.002, 0.0, 0.01, 0.01, 0.01], rel=0.1, abs=1e-9)
    assert abs(errors.mean(axis=0)).max() < 0.001
    world.reset()
    again, _ = run(world, 1000, ViconSample)
    assert again == samples


def test_occlusion_hides_samples_for_its_share_without_affecting_physics(build) -> None:
    world = build(sliding(hz=1000, occlusion={"share": 0.3, "length_s": 0.02}, seed=5))
    samples, poses = run(world, 2000, ViconSample)
    assert len(samples) / 2000 == pytest.approx(0.7, abs=0.1)
    gaps = np.diff([tick for tick, _ in samples])
    assert set(gaps[gaps > 1] % 20) == {1}, "it is hidden for whole parts"
    seen_by_nobody = build({**sliding(), "sensors": []})
    assert run(seen_by_nobody, 2000, ViconSample) == ([], poses)


def test_each_segment_of_a_subject_is_a_body_link(build) -> None:
    segments = [("foot", None), ("hand", "lbr_iiwa_link_7")]
    sensors = [{"type": "vicon", "name": name, "hz": 100, "link": link} for name, link in segments]
    world = build(robots=(iiwa("person", sensors=sensors),))
    for _ in range(10):
        found = {one.frame: one.pose for one in world.step() if isinstance(one, ViconSample)}
    body = world.bodies["person"]
    assert set(found) == {"vicon/person/foot", "vicon/person/hand"}
    assert found["vicon/person/foot"].position == pytest.approx(body.base_pose().position)
    assert found["vicon/person/hand"].position == pytest.approx(body.link_pose(6).position)
    with pytest.raises(ConfigError, match="person.yaml: sensors.box.link: unknown link 'lid': known are"):
        build(robots=(iiwa("person", sensors=[{"type": "vicon", "name": "box", "hz": 1, "link": "lid"}]),))


def test_each_detector_has_a_topic_of_its_own(build) -> None:
    """Two cameras look at the same tags."""
    sensors = [
        {"type": "april_tags", "name": f"tags_{i}", "hz": 100, "camera": "eye", "tags": [TAG], **more}
        for i, more in enumerate(({}, {"topic": "left/tag_detections"}))
    ]
    world = build(box("box", sensors=sensors), rgbd_sensor=CAMERA)
    assert [row.name for row in endpoints(world) if row.name.endswith("tag_detections")] == [
        "tag_detections",
        "left/tag_detections",
    ]
    with pytest.raises(ConfigError, match="the node publishes tag_detections twice as apriltag_ros/AprilTag"):
        endpoints(
            build(box("box", sensors=[{**one, "topic": "tag_detections"} for one in sensors]), rgbd_sensor=CAMERA)
        )


TAG = {"id": 7, "size": 0.1, "position": [0.0, 0.0, 0.1]}
CAMERA = {"name": "eye", "intrinsics": {"fov": 60.0}, "object_tf": {"tf_id": "eye_optical"}}


def tagged(build: Callable[..., World], *more: dict[str, Any], camera: dict[str, Any] = CAMERA, **keys: Any) -> World:
    """Returns a world with a box on the floor with a tag on top, 1 m under a camera."""
    sensor = {"type": "april_tags", "name": "tags", "hz": 100, "camera": "eye", "tags": [TAG], **keys}
    seen = box("box", basePosition=[0.2, 0.0, 0.1], sensors=[sensor])
    poses = [{"tf_id": "eye_optical", "position": [0.0, 0.0, 1.2], "orientation": LOOKS_DOWN}]
    return build(seen, *more, rgbd_sensor=camera, poses=poses)


def tags(world: World) -> list[Any]:
    """Returns the tags that are seen after some ticks."""
    for _ in range(10):
        samples = [one for one in world.step() if isinstance(one, AprilTagsSample)]
    return list(samples[-1].tags)


def test_a_tag_is_reported_in_the_optical_frame(build) -> None:
    (tag,) = tags(tagged(build))
    assert (tag.id, tag.size) == (7, 0.1)
    assert tag.pose.position == pytest.approx((0.2, 0.0, 1.0), abs=1e-3)
    upright = (1.0, 0.0, 0.0, 0.0)  # x to the right as the camera's, y up where the camera's is down
    assert math.hypot(*rotation_between(tag.pose.quat_xyzw, upright)) < 1e-3


@pytest.mark.parametrize(
    ("more", "keys"),
    [
        ((ball("lid", 0.03, basePosition=[0.13, 0.03, 0.6]),), {}),
        ((), {"tags": [{**TAG, "orientation": LOOKS_DOWN}]}),
        ((), {"camera": {**CAMERA, "intrinsics": {"fov": 15.0}}}),
        ((), {"min_side_px": 60.0}),
        ((), {"occlusion": {"share": 1.0}}),
        ((), {"tags": [{**TAG, "body": "nobody"}]}),
        ((), {"tags": [{**TAG, "link": "none"}]}),
    ],
    ids=["covered", "from behind", "outside the image", "too small", "by chance", "no body", "no link"],
)
def test_a_tag_that_cannot_be_seen_is_left_out(build, more, keys, caplog) -> None:
    world = tagged(build, *more, **keys)
    assert tags(world) == []
    named = {"nobody", "none"} & {str(keys.get("tags", [{}])[0].get(key)) for key in ("body", "link")}
    assert all(f"'{name}'" in caplog.text for name in named)


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ({"tags": []}, "sensors[0].tags: expected at least one tag"),
        ({"tags": [TAG, TAG]}, "sensors[0].tags[1].id: 7 is the id of another tag of this list"),
        ({"noise_m": -1.0}, "sensors[0].noise_m"),
        ({"occlusion": {"share": 2.0}}, "sensors[0].occlusion.share: must be <= 1, got 2"),
        ({"latency": 1.0}, "sensors[0].latency: unknown key 'latency'; did you mean 'latency_s'?"),
    ],
)
def test_faulty_keys_are_named(build, keys, told) -> None:
    with pytest.raises(ConfigError) as caught:
        tagged(build, **keys)
    assert told in str(caught.value)
