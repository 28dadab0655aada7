"""AprilTags in images that the simulator draws: who they are, and where, against the truth."""

from __future__ import annotations

import math
import os
import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from worlds import write_world

from robot_model.geometry import Pose, rotation_between
from rpbi.images import CameraImages
from rpbi.world import World
from rpbi_utils.tracking.tags import DetectedTag, TagDetector, tag_image, tag_pose, tag_poses, write_tag
from rpbi_utils.tracking.tags import main as make_april_tag

POSES = int(os.environ.get("APRIL_TAG_POSES", "12"))
"""How many poses are tried; docs/tracking.md has the figures of 500."""
SIZE = 0.1
IDS = (0, 7)
FOV_DEG, WIDTH, HEIGHT = 50.0, 640, 480
FOCAL_PX = HEIGHT / 2.0 / math.tan(math.radians(FOV_DEG) / 2.0)
CAMERA_MATRIX = np.array([[FOCAL_PX, 0.0, (WIDTH - 1) / 2.0], [0.0, FOCAL_PX, (HEIGHT - 1) / 2.0], [0.0, 0.0, 1.0]])
FIRST_ROWS = 0xD5D628584
"""Code of tag 0 in the family's table, 6 x 6 cells from top left, 1 is white."""


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[World, CameraImages]]:
    """A camera at the origin that looks along z, and two tags that follow TF."""
    folder = tmp_path_factory.mktemp("lab")
    tags: list[dict[str, Any]] = [
        {
            "name": f"tag_{number}",
            "createVisualShape": {"shapeType": "GEOM_MESH", "fileName": str(write_tag(number, SIZE, folder))},
            "object_tf": {"tf_id": f"tag_{number}"},
        }
        for number in IDS
    ]
    camera = {
        "name": "camera",
        "intrinsics": {"width": WIDTH, "height": HEIGHT, "fov": FOV_DEG},
        "object_tf": {"tf_id": "camera"},
    }
    world = World.from_file(write_world(folder, visual=tuple(tags), rgbd_sensor=camera, poses=[{"tf_id": "camera"}]))
    images = CameraImages(world)
    yield world, images
    images.close()
    world.close()


def seen(lab: tuple[World, CameraImages], *poses: Pose) -> dict[int, Pose]:
    """Returns the tags that are found when they are at poses, the rest far behind the camera."""
    world, images = lab
    for number, pose in zip(IDS, (*poses, *[Pose((0.0, 0.0, -9.0))] * 2)):
        world.put(f"tag_{number}/pose", pose)
    colour = images.frame("camera").colour
    grey = (colour[:, :, :3] @ np.array([0.299, 0.587, 0.114])).round().astype(np.uint8)
    return dict(tag_poses(TagDetector(), grey, CAMERA_MATRIX, dict.fromkeys(IDS, SIZE)))


def errors(found: Pose, truth: Pose) -> tuple[float, float]:
    """Returns how far and how much turned a pose is from another [m, rad]."""
    return math.dist(found.position, truth.position), math.hypot(*rotation_between(found.quat_xyzw, truth.quat_xyzw))


@pytest.mark.parametrize("position", [(0.0, 0.0, 0.55), (0.07, 0.19, 0.55), (-0.09, 0.1, 0.55)])
def test_pose_of_a_tag_parallel_to_the_image_is_found(position):
    truth, half = Pose(position, (1.0, 0.0, 0.0, 0.0)), SIZE / 2.0
    corners = np.array(position) + [[-half, half, 0.0], [half, half, 0.0], [half, -half, 0.0], [-half, -half, 0.0]]
    pixels = corners @ CAMERA_MATRIX.T
    found = tag_pose(DetectedTag(7, pixels[:, :2] / pixels[:, 2:]), SIZE, CAMERA_MATRIX)
    assert found is not None and max(errors(found, truth)) < 1e-4


def facing(draw: random.Random) -> Pose:
    """Returns the pose of a tag between 0.4 and 1.2 m that is seen under at most 60 degrees."""
    z = draw.uniform(0.4, 1.2)
    x, y = (0.3 * z * draw.uniform(-1.0, 1.0) for _ in range(2))
    tilt, about, roll = draw.uniform(0.0, math.radians(60.0)), draw.uniform(-math.pi, math.pi), draw.uniform(-3.0, 3.0)
    towards = Pose((x, y, z), (1.0, 0.0, 0.0, 0.0))
    half = math.sin(tilt / 2.0)
    tilted = Pose((0.0, 0.0, 0.0), (half * math.cos(about), half * math.sin(about), 0.0, math.cos(tilt / 2.0)))
    return towards @ tilted @ Pose((0.0, 0.0, 0.0), (0.0, 0.0, math.sin(roll / 2.0), math.cos(roll / 2.0)))


def test_tags_are_drawn_as_the_family_has_them() -> None:
    cells = (tag_image(0) > 0).astype(int)
    assert cells.shape == (10, 10) and cells[0].all() and not cells[1, 1:-1].any()
    assert "".join(map(str, cells[2:8, 2:8].ravel())) == f"{FIRST_ROWS:036b}"


def test_poses_are_those_of_the_world(lab) -> None:
    draw = random.Random(1)
    found = []
    for _ in range(POSES):
        truth = facing(draw)
        tags = seen(lab, truth)
        assert set(tags) <= {0}
        found += [errors(tags[0], truth)] if tags else []
    distance, angle = np.array(found).T
    if POSES > 12:
        for name, numbers, unit in (("position", 1e3 * distance, "mm"), ("rotation", np.degrees(angle), "deg")):
            shown = ", ".join(f"{np.percentile(numbers, share):.2f}" for share in (50, 95, 100))
            print(f"{name} error: median, 95 %, most: {shown} {unit}")
        print(f"found {len(found)} of {POSES}")
    assert len(found) >= 0.95 * POSES
    assert np.median(distance) < 0.001 and np.median(angle) < math.radians(0.5)


def test_two_tags_are_distinguished_and_one_from_behind_is_ignored(lab) -> None:
    left, right = (Pose((x, 0.0, 0.7), (1.0, 0.0, 0.0, 0.0)) for x in (-0.12, 0.12))
    tags = seen(lab, left, right)
    for number, truth in ((0, left), (7, right)):
        assert errors(tags[number], truth)[0] < 0.008, "edges along rows are a pixel wide, since they are not smoothed"
    assert set(seen(lab, Pose((0.0, 0.0, 0.7)))) == set()


def test_the_command_makes_the_same_files(tmp_path: Path, monkeypatch, capsys) -> None:
    monkeypatch.setattr("sys.argv", ["make_april_tag", "7", "0.1", str(tmp_path / "new")])
    make_april_tag()
    assert capsys.readouterr().out == f"{tmp_path / 'new' / 'tag36h11_7.obj'}\n"
    assert sorted(path.suffix for path in (tmp_path / "new").iterdir()) == [".mtl", ".obj", ".png"]
    monkeypatch.setattr("sys.argv", ["make_april_tag", "587", "0.1"])
    with pytest.raises(SystemExit):
        make_april_tag()
    assert "tag36h11 has ids from 0 to 586, got 587" in capsys.readouterr().err
