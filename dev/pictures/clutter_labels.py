"""Picture of docs/datasets.md: an image of the data set of `./rpbi label_images` with its labels."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from files import write_png
from PIL import Image, ImageDraw
from render import font

from rpbi.world import World
from rpbi.world.loading import load_world
from rpbi_data.labels.bop import SCENE
from rpbi_data.labels.dataset import write_labelled_images

WORLD = "{rpbi_examples}/configs/clutter/config.yaml"
SEED = 0
"""Seed of an image that shows all 25 objects."""
FINE = 2
"""Rows and columns of the image for each of the picture."""
WIDTH, HEIGHT = 1260, 945
MARGIN = 40 * FINE
"""Width of the margin around all objects, in pixels of the image."""
AXIS_M = 0.05
"""Length of the axes of a pose [m]."""
AXES = ("#e02020", "#18a018", "#2050f0")
COLOURS = ("#e41a1c", "#377eb8", "#4daf4a", "#984ea3", "#ff7f00", "#a65628", "#f781bf", "#17becf", "#bcbd22")


def draw_clutter_labels(path: Path) -> None:
    """Draws masks, boxes, names and poses over an image, as the files of the data set have them."""
    with tempfile.TemporaryDirectory(prefix="rpbi-") as folder:
        out = Path(folder) / "clutter"
        world = World(load_world(WORLD, overrides=_larger_images()))
        write_labelled_images(world, out, 1, SEED)
        world.close()
        write_png(path, _drawn(out))


def _larger_images() -> dict[str, Any]:
    camera = load_world(WORLD).config.rgbd_sensor
    assert camera is not None
    lens = {"width": FINE * WIDTH, "height": FINE * HEIGHT, "fov": 45.0, "range": list(camera.intrinsics.range)}
    return {"rgbd_sensor": {"name": camera.name, "hz": 1.0, "intrinsics": lens, "object_tf": {"tf_id": "rpbi/camera"}}}


def _drawn(folder: Path) -> Image.Image:
    scene = folder / SCENE
    coco = json.loads((scene / "scene_gt_coco.json").read_text())
    names = {each["id"]: each["name"] for each in coco["categories"]}
    labels = coco["annotations"]
    picture = Image.open(scene / "rgb/000000.png").convert("RGB")
    for index in range(len(labels)):
        mask = Image.open(scene / f"mask_visib/000000_{index:06d}.png").convert("L").point(lambda value: 0.35 * value)
        picture.paste(COLOURS[index % len(COLOURS)], mask=mask)
    draw = ImageDraw.Draw(picture)
    K = np.reshape(json.loads((scene / "scene_camera.json").read_text())["0"]["cam_K"], (3, 3))
    poses = json.loads((scene / "scene_gt.json").read_text())["0"]
    for index, (label, pose) in enumerate(zip(labels, poses)):
        x, y, width, height = label["bbox"]
        draw.rectangle((x, y, x + width, y + height), outline=COLOURS[index % len(COLOURS)], width=2 * FINE)
        _draw_axes(draw, K, pose)
    for index, label in enumerate(labels):
        _write_name(draw, label["bbox"], names[label["category_id"]], COLOURS[index % len(COLOURS)])
    edges = np.array([(x, y, x + width, y + height) for x, y, width, height in (each["bbox"] for each in labels)])
    left, top = edges[:, :2].min(axis=0) - MARGIN
    right, bottom = edges[:, 2:].max(axis=0) + MARGIN
    width, height = picture.size
    return picture.crop((max(left, 0), max(top, 0), min(right, width), min(bottom, height))).reduce(FINE)


def _draw_axes(draw: ImageDraw.ImageDraw, K: np.ndarray, pose: dict[str, Any]) -> None:
    rotation, place = np.reshape(pose["cam_R_m2c"], (3, 3)), np.array(pose["cam_t_m2c"]) / 1e3
    ends = [K @ point for point in (place, *(place + AXIS_M * column for column in rotation.T))]
    origin, *tips = ((float(x / z), float(y / z)) for x, y, z in ends)
    for tip, colour in zip(tips, AXES):
        draw.line((*origin, *tip), colour, 3 * FINE)


def _write_name(draw: ImageDraw.ImageDraw, box: tuple[float, float, float, float], name: str, colour: str) -> None:
    letters = font(13 * FINE, bold=True)
    corner = box[0], box[1] - 16 * FINE
    left, top, right, bottom = draw.textbbox(corner, name, font=letters)
    draw.rectangle((left - FINE, top - FINE, right + FINE, bottom + FINE), colour)
    draw.text(corner, name, "white", letters)
