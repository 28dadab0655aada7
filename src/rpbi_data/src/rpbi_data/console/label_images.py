"""The command `label_images`."""

import sys
import time
from pathlib import Path
from typing import Annotated

from tqdm import tqdm

from custom_ros_tools.console.argument import Argument, UsageError
from rpbi_data.labels.dataset import write_labelled_images


def label_images(
    world: Annotated[str, Argument("WORLD.yaml", files="*.yaml")] = "{rpbi_examples}/configs/clutter/config.yaml",
    *,
    images: Annotated[int, Argument("N", parse=int)] = 100,
    out: Annotated[Path, Argument("DIR", parse=Path)] = Path("labelled_images"),
    seed: Annotated[int, Argument("N", parse=int)] = 0,
    camera: Annotated[str, Argument("NAME")] = "",
) -> str:
    """Makes a data set of labelled images of a world's objects: masks, boxes, poses and models.

        ./rpbi label_images --images 100 --out clutter

    No ROS master is needed. For each image, the objects of the world fall from random poses. When the objects are at
    rest, a camera takes the image from a random place. The data set is in the BOP format, with a COCO file; see
    docs/datasets.md.

    Args:
        WORLD.yaml: main file of a world with a camera and objects; default: the world of the example `clutter`
        images: number of images; default: 100
        out: a new or empty folder for the data set; default: labelled_images
        seed: seed of the random numbers; image n depends only on the world, the seed and n; default: 0
        camera: name of the camera; default: the first camera of the world
    """
    if images < 1 or seed < 0:
        raise UsageError(f"--images and --seed: expected at least 1 and 0, got {images} and {seed}")
    begin_s = time.monotonic()
    period_s = 0.1 if sys.stderr.isatty() else 10.0
    with tqdm(total=images, unit=" images", leave=False, mininterval=period_s, delay=1.0) as bar:
        found = write_labelled_images(world, out, images, seed, camera=camera, report=bar.update)
    return (
        f"{out}: {found.images} images, {found.labels} labels, kinds of objects: {found.kinds}, "
        f"visible of an object: {100.0 * found.visible_fraction:.0f} % on average, {time.monotonic() - begin_s:.0f} s"
    )
