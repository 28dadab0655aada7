"""Writes the folder of a data set in the BOP format.

BOP is the Benchmark for 6D Object Pose Estimation (Hodan et al., ECCV 2018). The format is described in
`docs/bop_datasets_format.md` of https://github.com/thodan/bop_toolkit. Labels for object detectors are in
`scene_gt_coco.json`, in the COCO format, as the BOP toolkit writes them.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from PIL import Image

from rpbi.render.camera import Intrinsics

from .models import MM, ObjectModel
from .silhouettes import Bounds, Mask, Silhouette, bounds

DEPTH_SCALE_MM = 0.1
"""Depth that a pixel value of 1 in a depth image stands for [mm]."""
SCENE = Path("train/000000")
"""Folder of the images, relative to the folder of the data set."""
QUICK, USUAL = 1, 3
"""PNG compression levels for masks and for images."""

Array = npt.NDArray[np.float64]


class Label(NamedTuple):
    """Label of one object in an image.

    Attributes:
        model: Model of the object.
        T: Pose of the object's base link in the camera's optical frame, shape (4, 4) [m].
        visible: Mask of the pixels in which the object is visible, shape (height, width).
        whole: Silhouette that the object would have without occlusion.
    """

    model: ObjectModel
    T: Array
    visible: Mask
    whole: Silhouette

    @property
    def visible_fraction(self) -> float:
        """Visible fraction of the object's silhouette. Parts outside the image count as not visible."""
        return float(self.visible.sum()) / self.whole.pixels


class LabelledImage(NamedTuple):
    """An image and its labels.

    Attributes:
        colour: Red, green and blue, uint8, shape (height, width, 3).
        depth: Distances along the optical axis, shape (height, width) [m]; 0 in pixels without depth.
        camera: Pose of the world frame in the camera's optical frame, shape (4, 4) [m].
        labels: Labels of the objects that are visible in at least one pixel.
    """

    colour: npt.NDArray[np.uint8]
    depth: npt.NDArray[np.float32]
    camera: Array
    labels: tuple[Label, ...]


class BopFolder:
    """Writes a BOP data set, to which images are added one by one.

    Args:
        path: Folder of the data set, which must exist and be empty.
        name: Name of the data set.
        models: Models of the labelled objects.
        intrinsics: Intrinsics of the camera that takes all images.

    Raises:
        OSError: If the models cannot be written.
    """

    def __init__(self, path: Path, name: str, models: Iterable[ObjectModel], intrinsics: Intrinsics) -> None:
        self._path, self._name, self._intrinsics = path, name, intrinsics
        self._models = {model.obj_id: model for model in models}
        self._cameras: list[dict[str, Any]] = []
        self._poses: list[list[dict[str, Any]]] = []
        self._infos: list[list[dict[str, Any]]] = []
        self._annotations: list[dict[str, Any]] = []
        (path / "models").mkdir()
        for part in ("rgb", "depth", "mask", "mask_visib"):
            (path / SCENE / part).mkdir(parents=True)
        for obj_id, model in self._models.items():
            (path / f"models/obj_{obj_id:06d}.ply").write_text(model.as_ply())
        infos = {str(obj_id): model.info() for obj_id, model in self._models.items()}
        (path / "models/models_info.json").write_text(_lines(infos))
        (path / "camera.json").write_text(json.dumps(self._camera()) + "\n")

    def add(self, image: LabelledImage) -> None:
        """Writes an image, a depth image and masks. The labels are kept in memory until `close`.

        Raises:
            OSError: If a file cannot be written.
        """
        number = len(self._cameras)
        depth = np.rint(image.depth * (MM / DEPTH_SCALE_MM))
        depth[depth > np.iinfo(np.uint16).max] = 0
        self._write(image.colour, f"rgb/{number:06d}.png", USUAL)
        self._write(depth.astype(np.uint16), f"depth/{number:06d}.png", USUAL)
        self._cameras.append(
            {
                "cam_K": _rounded(self._intrinsics.K),
                "depth_scale": DEPTH_SCALE_MM,
                "cam_R_w2c": _rounded(image.camera[:3, :3]),
                "cam_t_w2c": _rounded(MM * image.camera[:3, 3]),
            }
        )
        self._poses.append([])
        self._infos.append([])
        for index, label in enumerate(image.labels):
            obj_id = label.model.obj_id
            rotation, translation = _rounded(label.T[:3, :3]), _rounded(MM * label.T[:3, 3])
            self._poses[-1].append({"cam_R_m2c": rotation, "cam_t_m2c": translation, "obj_id": obj_id})
            self._infos[-1].append(_info(label, depth))
            self._annotations.append(self._annotation(number, label))
            mask = f"{number:06d}_{index:06d}.png"
            self._write(255 * label.whole.mask.astype(np.uint8), f"mask/{mask}", QUICK)
            self._write(255 * label.visible.astype(np.uint8), f"mask_visib/{mask}", QUICK)

    def close(self, description: str) -> None:
        """Writes the labels and a description of the data set.

        Args:
            description: Description of the data set, in Markdown.

        Raises:
            OSError: If a file cannot be written.
        """
        scene = self._path / SCENE
        for name, rows in (
            ("scene_camera", self._cameras),
            ("scene_gt", self._poses),
            ("scene_gt_info", self._infos),
        ):
            (scene / f"{name}.json").write_text(_lines({str(number): row for number, row in enumerate(rows)}))
        (scene / "scene_gt_coco.json").write_text(json.dumps(self._coco()) + "\n")
        kinds = "\n".join(f"| {obj_id} | {model.name} |" for obj_id, model in self._models.items())
        table = f"| `obj_id` | object |\n|---|---|\n{kinds}\n"
        (self._path / "dataset_info.md").write_text(f"# {self._name}\n\n{description}\n\n{table}")

    def _write(self, pixels: npt.NDArray[Any], name: str, level: int) -> None:
        Image.fromarray(pixels).save(self._path / SCENE / name, compress_level=level)

    def _camera(self) -> dict[str, float]:
        K, size = self._intrinsics.K, {"width": self._intrinsics.width_px, "height": self._intrinsics.height_px}
        focal = {"fx": K[0, 0], "fy": K[1, 1], "cx": K[0, 2], "cy": K[1, 2]}
        return {**{key: round(float(value), 6) for key, value in focal.items()}, "depth_scale": DEPTH_SCALE_MM, **size}

    def _annotation(self, number: int, label: Label) -> dict[str, Any]:
        height, width = label.visible.shape
        left, right, top, bottom = bounds(label.visible)
        return {
            "id": len(self._annotations) + 1,
            "image_id": number,
            "category_id": label.model.obj_id,
            "iscrowd": 0,
            "ignore": False,
            "area": int(label.visible.sum()),
            "bbox": [left, top, right - left + 1, bottom - top + 1],
            "segmentation": {"counts": run_lengths(label.visible), "size": [height, width]},
            "width": width,
            "height": height,
        }

    def _coco(self) -> dict[str, Any]:
        size = {"width": self._intrinsics.width_px, "height": self._intrinsics.height_px}
        images = [{"id": i, "file_name": f"rgb/{i:06d}.png", **size} for i in range(len(self._cameras))]
        kinds = self._models.items()
        categories = [{"id": i, "name": model.name, "supercategory": self._name} for i, model in kinds]
        return {
            "info": {"description": self._name},
            "licenses": [],
            "categories": categories,
            "images": images,
            "annotations": self._annotations,
        }


def run_lengths(mask: Mask) -> list[int]:
    """Returns the lengths of runs of equal pixels in a mask, column by column, as in COCO's uncompressed format.

    The first run contains pixels outside the mask, and may have the length 0.
    """
    pixels = mask.ravel(order="F")
    changes = np.flatnonzero(np.diff(pixels)) + 1
    lengths = np.diff([0, *changes, pixels.size]).tolist()
    return [0, *lengths] if pixels[0] else lengths


def _info(label: Label, depth: npt.NDArray[Any]) -> dict[str, Any]:
    """Returns the entry of a label in `scene_gt_info.json`.

    The side lengths of boxes are differences of pixel indices, as in the BOP toolkit.
    """
    return {
        "bbox_obj": _corner_and_sides(label.whole.box),
        "bbox_visib": _corner_and_sides(bounds(label.visible)),
        "px_count_all": label.whole.pixels,
        "px_count_valid": int((depth[label.whole.mask] > 0).sum()),
        "px_count_visib": int(label.visible.sum()),
        "visib_fract": round(label.visible_fraction, 6),
    }


def _corner_and_sides(box: Bounds) -> list[int]:
    left, right, top, bottom = box
    return [left, top, right - left, bottom - top]


def _rounded(matrix: Array) -> list[float]:
    return [round(float(number), 8) for number in matrix.ravel()]


def _lines(entries: dict[str, Any]) -> str:
    """Converts a dictionary to JSON text with one entry per line."""
    return "{\n" + ",\n".join(f"  {json.dumps(key)}: {json.dumps(value)}" for key, value in entries.items()) + "\n}\n"
