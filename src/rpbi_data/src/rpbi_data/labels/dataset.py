"""Writes a data set of labelled images of a world."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from contextlib import closing, nullcontext
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from custom_ros_tools.errors import InterfaceError, UnknownNameError
from custom_ros_tools.transforms import matrix_of
from robot_model.geometry import Pose
from rpbi.images import CameraImages
from rpbi.render.frame import Camera
from rpbi.world import World

from .arrangement import Arrangement
from .bop import BopFolder, Label, LabelledImage
from .silhouettes import Silhouettes

VIEWS = 20
"""Maximum number of views of an arrangement that are tried until an object is visible."""


class Written(NamedTuple):
    """Summary of a written data set.

    Attributes:
        images: Number of images.
        kinds: Number of different object models.
        labels: Number of labels in all images.
        visible_fraction: Mean of the visible fractions of the labelled objects.
    """

    images: int
    kinds: int
    labels: int
    visible_fraction: float


def write_labelled_images(
    world: World | str | Path,
    out: str | Path,
    count: int = 100,
    seed: int = 0,
    *,
    camera: str = "",
    report: Callable[[], object] = lambda: None,
) -> Written:
    """Writes images of random arrangements of a world's objects, each from a random view, in the BOP format.

    For each image, the world is reset, and its objects fall from random poses. When the objects are at rest, the camera
    takes the image from a random place above the objects. Image n depends only on the world, the seed and n. The data
    set is written to a temporary folder, which is renamed to `out` when the data set is complete.

    Args:
        world: The world, or its main YAML file. The world is reset, which removes objects that were added at run time.
        out: Folder of the data set, which must be empty or not exist.
        count: Number of images, at least 1.
        seed: Seed of the random numbers, at least 0.
        camera: Name of the camera; by default, the first camera of the world is used.
        report: Function that is called after each image.

    Raises:
        ConfigError: If the main file, or a file that the main file names, is wrong.
        UnknownNameError: If the world has no camera with the name `camera`.
        InterfaceError: If the world has no camera or no object to label, objects do not come to rest or are not
            visible from any view, or the data set cannot be written. The temporary folder is then removed.
        ValueError: If `count` or `seed` is out of range.
    """
    if count < 1 or seed < 0:
        raise ValueError(f"count and seed: expected at least 1 and 0, got {count} and {seed}")
    target = Path(out)
    part = target.absolute().parent / f".{target.absolute().name}.part"
    if target.exists() and not (target.is_dir() and next(target.iterdir(), None) is None):
        raise InterfaceError(f"{target}: expected a new or an empty folder, got one with files in it")
    try:
        shutil.rmtree(part, ignore_errors=True)  # left by a killed call
        with nullcontext(world) if isinstance(world, World) else closing(_opened(world)) as given:
            part.mkdir(parents=True)
            written = _write(given, part, target.absolute().name, count, seed, camera, report)
            part.rename(target)
            return written
    except OSError as error:
        raise InterfaceError(f"{target}: cannot be written: {error.strerror or error}") from error
    finally:
        shutil.rmtree(part, ignore_errors=True)


def _opened(file: str | Path) -> World:
    import pybullet  # after rpbi, which suppresses the greeting of PyBullet

    return World.from_file(str(file), connection_mode=pybullet.DIRECT)


def _write(
    world: World, part: Path, name: str, count: int, seed: int, camera: str, report: Callable[[], object]
) -> Written:
    if not world.cameras:
        raise InterfaceError("the world has no camera: expected an `rgbd_sensor`")
    camera = camera or next(iter(world.cameras))
    if camera not in world.cameras:
        raise UnknownNameError("camera", camera, list(world.cameras))
    photographer = _Photographer(world, camera)
    try:
        folder = BopFolder(part, name, photographer.models, photographer.intrinsics)
        fractions = []
        for number in range(count):
            image = photographer.image(np.random.default_rng((seed, number)))
            folder.add(image)
            fractions += [label.visible_fraction for label in image.labels]
            report()
    finally:
        photographer.close()
    folder.close(
        f"{count} images of random arrangements of simulated objects, in the BOP format, by `./rpbi label_images` with "
        f"seed {seed}. Units are millimetres. The middle of the first pixel is (0, 0). Models are in the frames of the "
        "objects' base links; symmetries are not listed."
    )
    return Written(count, len(photographer.models), len(fractions), float(np.mean(fractions)))


class _Photographer:
    """Takes labelled images of a world's objects with one of the world's cameras.

    Raises:
        InterfaceError: If the world has no object to label.
    """

    def __init__(self, world: World, camera: str) -> None:
        world.reset()
        self._world, self._camera = world, camera
        self.intrinsics = Camera.of(world.cameras[camera].config).intrinsics
        self._arrangement = Arrangement(world)
        self._models = self._arrangement.models
        self.models = list({model.obj_id: model for model in self._models.values()}.values())
        self._images = CameraImages(world)
        self._silhouettes = Silhouettes(world, self._models)

    def image(self, random: np.random.Generator) -> LabelledImage:
        """Arranges the objects, takes an image from a random view, and returns the image with labels.

        Raises:
            InterfaceError: If objects do not come to rest, or no object is visible from any of `VIEWS` views.
        """
        self._arrangement.settle(random)
        for _ in range(VIEWS):
            view = self._arrangement.view(random, self.intrinsics)
            self._world.put(f"{self._camera}/pose", view)
            frame = self._images.frame(self._camera)
            colour, depth, seen = frame.colour, frame.depth, frame.segmentation
            assert colour is not None and depth is not None and seen is not None
            if labels := tuple(self._labels(seen, view)):
                depth[(seen < 0) | (depth >= self.intrinsics.far_m)] = 0.0
                return LabelledImage(colour, depth, matrix_of(*view.inverse()), labels)
        raise InterfaceError(f"'{self._camera}' sees no object from any of {VIEWS} views: is its `range` too short?")

    def _labels(self, seen: npt.NDArray[np.int32], view: Pose) -> Iterator[Label]:
        for name, model in self._models.items():
            body = self._world.bodies[name]
            visible = np.equal(seen, body.body_id)
            if not visible.any():
                continue
            T = matrix_of(*(view.inverse() @ Pose(*body.base_pose())))
            alone = self._silhouettes.draw(model, body.state(), T, view, self.intrinsics)
            yield Label(model, T, visible, alone.including(visible))

    def close(self) -> None:
        """Disconnects the PyBullet clients that draw images."""
        self._silhouettes.close()
        self._images.close()
