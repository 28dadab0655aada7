"""Labelled images: masks, boxes and poses are those of what is seen, and the same seed gives the same files."""

from __future__ import annotations

import errno
import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pybullet
import pytest
import yaml
from PIL import Image
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation
from worlds import BOX_FLOOR, box, iiwa, write_world

from custom_ros_tools.console.argument import UsageError
from custom_ros_tools.errors import InterfaceError, UnknownNameError
from rpbi.render.camera import Intrinsics
from rpbi.world import World
from rpbi_data.console.label_images import label_images
from rpbi_data.labels.arrangement import CLEAR_M, Arrangement
from rpbi_data.labels.bop import BopFolder
from rpbi_data.labels.dataset import write_labelled_images

CLUTTER = "{rpbi_examples}/configs/clutter/config.yaml"
IMAGES = 2
SPACING_MM = 1.0
"""Distance of the points on a model with which depths are compared."""
TOLERANCE_MM = 2.0


class Set(NamedTuple):
    """A data set that is read again."""

    folder: Path
    cameras: dict[str, Any]
    poses: dict[str, Any]
    infos: dict[str, Any]
    coco: dict[str, Any]
    images: int
    labels: int

    def read(self, name: str) -> np.ndarray:
        return np.array(Image.open(self.folder / "train/000000" / name))

    def seen(self, image: int, label: int, what: str = "mask_visib") -> np.ndarray:
        mask = self.read(f"{what}/{image:06d}_{label:06d}.png")
        assert set(np.unique(mask)) <= {0, 255}
        return mask > 0

    def each(self):
        """Yields image, label, pose and facts of all labels."""
        for image in range(self.images):
            rows = zip(self.poses[str(image)], self.infos[str(image)])
            yield from ((image, label, pose, info) for label, (pose, info) in enumerate(rows))


@pytest.fixture(scope="module")
def found(tmp_path_factory) -> Set:
    folder = tmp_path_factory.mktemp("labelled") / "clutter"
    written = write_labelled_images(CLUTTER, folder, IMAGES, seed=11)
    scene = folder / "train/000000"
    names = ("scene_camera", "scene_gt", "scene_gt_info", "scene_gt_coco")
    parts = [json.loads((scene / f"{name}.json").read_text()) for name in names]
    return Set(folder, *parts, written.images, written.labels)


def ply(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Returns points [mm] and triangles of an ASCII PLY file."""
    lines = path.read_text().splitlines()
    counts = [int(line.split()[-1]) for line in lines if line.startswith("element")]
    begin = lines.index("end_header") + 1
    points = np.loadtxt(lines[begin : begin + counts[0]])[:, :3]
    faces = np.loadtxt(lines[begin + counts[0] :], dtype=int)
    assert len(faces) == counts[1] and (faces[:, 0] == 3).all()
    return points, faces[:, 1:]


def surface(path: Path) -> cKDTree:
    """Returns points all over the surface of a model [mm]."""
    points, triangles = ply(path)
    samples = []
    for a, b, c in points[triangles]:
        steps = int(np.ceil(max(np.linalg.norm(b - a), np.linalg.norm(c - a), np.linalg.norm(c - b)) / SPACING_MM))
        s, t = (each.ravel() / steps for each in np.meshgrid(np.arange(steps + 1), np.arange(steps + 1)))
        inside = s + t <= 1.0 + 1e-9
        samples.append(a + s[inside, None] * (b - a) + t[inside, None] * (c - a))
    return cKDTree(np.concatenate(samples))


def distances(found: Set, image: int, label: int, pose: dict[str, Any], models: dict[int, cKDTree]) -> np.ndarray:
    """Returns the distances of the points that the camera sees of an object from its model at a pose [mm]."""
    camera = found.cameras[str(image)]
    depth = found.read(f"depth/{image:06d}.png") * camera["depth_scale"]
    rows, columns = np.nonzero(found.seen(image, label))
    z = depth[rows, columns]
    fx, _, cx, _, fy, cy, _, _, _ = camera["cam_K"]
    points = np.stack([(columns - cx) / fx * z, (rows - cy) / fy * z, z], axis=1)
    R = np.reshape(pose["cam_R_m2c"], (3, 3))
    return models[pose["obj_id"]].query((points - pose["cam_t_m2c"]) @ R)[0]


@pytest.fixture(scope="module")
def models(found) -> dict[int, cKDTree]:
    return {each["id"]: surface(found.folder / f"models/obj_{each['id']:06d}.ply") for each in found.coco["categories"]}


@pytest.mark.thorough
def test_depth_points_lie_on_the_models_at_their_poses(found, models):
    worst = 0.0
    for image, label, pose, _ in found.each():
        off = distances(found, image, label, pose, models)
        worst = max(worst, float(np.quantile(off, 0.98)))
        assert np.median(off) < 1.0, f"image {image}, object {pose['obj_id']}"
    assert worst < TOLERANCE_MM


@pytest.mark.thorough
@pytest.mark.parametrize(
    "wrong", ["moved", *(pytest.param(wrong, marks=pytest.mark.thorough) for wrong in ("turned", "inverse"))]
)
def test_wrong_poses_are_found_by_this(found, models, wrong):
    fooled = 0
    for image, label, pose, _ in found.each():
        R, t = np.reshape(pose["cam_R_m2c"], (3, 3)), np.array(pose["cam_t_m2c"])
        if wrong == "moved":
            t = t + [10.0, 0.0, 0.0]
        elif wrong == "turned":
            R = R @ Rotation.from_euler("xyz", [20.0, 20.0, 20.0], degrees=True).as_matrix()
        else:
            R, t = R.T, -R.T @ t
        off = distances(found, image, label, {**pose, "cam_R_m2c": R, "cam_t_m2c": t}, models)
        fooled += bool(np.quantile(off, 0.98) < TOLERANCE_MM)
    balls = 1 if wrong == "turned" else 0  # a ball that is turned looks the same
    assert fooled <= balls * IMAGES


def test_boxes_masks_and_counts_agree(found):
    annotations = {(each["image_id"], each["id"]): each for each in found.coco["annotations"]}
    in_order = [annotations[key] for key in sorted(annotations)]
    labels = list(found.each())
    assert len(labels) == len(in_order) == found.labels > 20 * IMAGES
    for (image, label, pose, info), annotation in zip(labels, in_order):
        seen, whole = found.seen(image, label), found.seen(image, label, "mask")
        rows, columns = np.nonzero(seen)
        assert not (seen & ~whole).any()
        counts = annotation["segmentation"]["counts"]
        runs = np.repeat(np.arange(len(counts)) % 2 == 1, counts).reshape(seen.shape, order="F")
        assert np.array_equal(runs, seen) and annotation["category_id"] == pose["obj_id"]
        left, top, width, height = annotation["bbox"]
        assert (left, left + width - 1, top, top + height - 1) == (*_ends(columns), *_ends(rows))
        assert info["bbox_visib"] == [left, top, width - 1, height - 1]
        assert info["px_count_visib"] == annotation["area"] == seen.sum()
        assert info["px_count_all"] >= whole.sum() >= info["px_count_valid"] >= info["px_count_visib"]
        assert info["visib_fract"] == pytest.approx(seen.sum() / info["px_count_all"], abs=1e-6)


def _ends(numbers: np.ndarray) -> tuple[int, int]:
    return int(numbers.min()), int(numbers.max())


def test_a_pixel_belongs_to_one_object_and_some_hide_others(found):
    for image in range(IMAGES):
        masks = [found.seen(image, label) for label in range(len(found.poses[str(image)]))]
        assert np.sum(masks, axis=0).max() == 1
    fractions = [info["visib_fract"] for *_, info in found.each()]
    assert min(fractions) < 0.7 and np.mean(fractions) > 0.7


def test_objects_lie_on_the_table_and_equal_ones_share_categories(found):
    names = {each["id"]: each["name"] for each in found.coco["categories"]}
    assert len(names) == 20
    for image in range(IMAGES):
        camera = found.cameras[str(image)]
        R, t = np.reshape(camera["cam_R_w2c"], (3, 3)), np.array(camera["cam_t_w2c"])
        poses = found.poses[str(image)]
        heights = [(R.T @ (np.array(pose["cam_t_m2c"]) - t))[2] for pose in poses]
        assert sum(390.0 < height < 650.0 for height in heights) >= 20, "on the table, 0.4 m high"
        assert sum(names[pose["obj_id"]] == "domino" for pose in poses) >= 3


def test_models_have_their_size(found):
    infos = json.loads((found.folder / "models/models_info.json").read_text())
    ids = {each["name"]: str(each["id"]) for each in found.coco["categories"]}
    box, ball = infos[ids["box"]], infos[ids["ball"]]
    assert [box[f"size_{axis}"] for axis in "xyz"] == [150.0, 100.0, 50.0] and box["min_z"] == -25.0
    assert box["diameter"] == pytest.approx(np.linalg.norm([150.0, 100.0, 50.0]), abs=1e-3)
    assert ball["diameter"] == pytest.approx(70.0, abs=0.5)


@pytest.fixture
def small(tmp_path):
    """A world with a ball and a box, and a small camera; the arguments are keys that differ."""

    def write(**changes: Any) -> Path:
        own = "{rpbi_examples}/configs/clutter"
        intrinsics = {"width": 96, "height": 72, "fov": 45, "range": [0.05, 6.0]}
        world = {
            "setGravity": {"gravZ": -9.81},
            "timeStep": 0.004,
            "collision_objects": [f"{own}/table.yaml"],
            "dynamic_objects": [
                {"file": f"{own}/ball.yaml", "basePosition": [0.0, 0.0, 0.5]},
                {"file": f"{own}/box.yaml", "basePosition": [0.1, 0.1, 0.5]},
            ],
            "rgbd_sensor": {"name": "eye", "intrinsics": intrinsics, "object_tf": {"tf_id": "eye"}},
        }
        file = tmp_path / "world.yaml"
        world |= changes
        file.write_text(yaml.safe_dump({key: value for key, value in world.items() if value is not None}))
        return file

    return write


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def test_an_image_depends_on_the_seed_and_its_number_alone(small, tmp_path):
    world = small()
    for name, count, seed in (("a", 2, 3), ("b", 2, 3), ("more", 3, 3), ("other", 1, 4)):
        (tmp_path / name).mkdir()
        write_labelled_images(world, tmp_path / name / "set", count, seed)
    a, b, more, other = (contents(tmp_path / name / "set") for name in ("a", "b", "more", "other"))
    assert a == b
    images = [name for name in a if name.endswith(".png")]
    assert len(images) > 8 and all(a[name] == more[name] for name in images)
    assert a["train/000000/rgb/000000.png"] != other["train/000000/rgb/000000.png"]


def test_running_world_and_camera_name_can_be_given(small, tmp_path):
    world = World.from_file(str(small()), connection_mode=pybullet.DIRECT)
    try:
        for _ in range(100):
            world.step()
        assert write_labelled_images(world, tmp_path / "own", 1, camera="eye").images == 1
        write_labelled_images(small(), tmp_path / "file" / "own", 1)
        assert contents(tmp_path / "own") == contents(tmp_path / "file" / "own")
        with pytest.raises(UnknownNameError, match="unknown camera 'ear': known are eye"):
            write_labelled_images(world, tmp_path / "none", 1, camera="ear")
    finally:
        world.close()


BAD = {
    "camera": ({"rgbd_sensor": None}, "the world has no camera"),
    "nothing": ({"dynamic_objects": []}, "there is nothing to label"),
    "far": (
        {"rgbd_sensor": {"name": "eye", "intrinsics": {"range": [0.01, 0.02]}, "object_tf": {"tf_id": "eye"}}},
        "'eye' sees no object from any of 20 views",
    ),
}


@pytest.mark.parametrize("what", BAD)
def test_unsuitable_world_is_refused_and_leaves_no_files(small, tmp_path, what):
    changes, message = BAD[what]
    place = tmp_path / "sets"
    with pytest.raises(InterfaceError, match=message):
        write_labelled_images(small(**changes), place / "set", 1)
    assert not list(place.iterdir())


def test_objects_that_never_rest_are_named(small, tmp_path, monkeypatch):
    monkeypatch.setattr("rpbi_data.labels.arrangement.PATIENCE_S", 0.2)
    with pytest.raises(InterfaceError, match="'(ball|box)' does not come to rest within 0.2 s, in 5 attempts"):
        write_labelled_images(small(), tmp_path / "set", 1)
    assert [path.name for path in tmp_path.iterdir()] == ["world.yaml"]


def test_a_folder_with_files_is_refused_and_kept(small, tmp_path):
    full = tmp_path / "full"
    full.mkdir()
    (full / "mine").touch()
    with pytest.raises(InterfaceError, match="expected a new or an empty folder"):
        write_labelled_images(small(), full, 1)
    assert [path.name for path in full.iterdir()] == ["mine"]
    (tmp_path / "empty").mkdir()
    write_labelled_images(small(), tmp_path / "empty", 1)
    assert (tmp_path / "empty/camera.json").exists()


def test_a_full_disk_leaves_nothing(small, tmp_path, monkeypatch):
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    place = tmp_path / "sets"
    monkeypatch.setattr(BopFolder, "close", full)
    with pytest.raises(InterfaceError, match="set: cannot be written: No space left on device"):
        write_labelled_images(small(), place / "set", 1)
    assert not list(place.iterdir())


def test_wrong_numbers_are_refused(tmp_path):
    with pytest.raises(UsageError, match="got 0 and 0"):
        label_images(images=0, out=tmp_path / "set")
    with pytest.raises(ValueError, match="got 1 and -1"):
        write_labelled_images(CLUTTER, tmp_path / "set", 1, seed=-1)
    assert not list(tmp_path.iterdir())


def test_the_camera_keeps_away_from_robots(tmp_path):
    boxes = tuple(box(f"box_{index}", basePosition=[0.6, 0.3 * index, 0.1]) for index in range(3))
    arm = iiwa(initial_joint_position={"lbr_iiwa_joint_2": 60.0, "lbr_iiwa_joint_4": -60.0})
    world = World.from_file(write_world(tmp_path, collision=(BOX_FLOOR,), dynamic=boxes, robots=(arm,)))
    arrangement, random = Arrangement(world), np.random.default_rng(5)
    body, intrinsics = world.bodies["iiwa"], Intrinsics(width_px=64, height_px=48, near_m=0.01, far_m=10.0)
    links = [world.pb.getAABB(body.body_id, link) for link in (-1, *body.joint_indices)]
    for _ in range(100):
        eye = np.array(arrangement.view(random, intrinsics).position)
        assert min(np.linalg.norm(eye - np.clip(eye, *each)) for each in links) >= CLEAR_M
    eye = np.mean(links[5], axis=0)
    assert not arrangement._is_clear(eye, arrangement.middle)
    world.close()
