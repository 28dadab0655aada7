"""Detects AprilTags (family tag36h11) in images with OpenCV, and writes textured meshes of tags for a world."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import PIL.Image
from scipy.spatial.transform import Rotation

from custom_ros_tools.errors import InterfaceError, MissingDependency
from robot_model.geometry import Pose

from .config import FAMILY_SIZE

CELLS = 8
"""Number of cells along a side of a tag's black square."""
PIXEL_CENTRE = 0.5
"""Coordinate of the centre of pixel 0 in the corners refined by OpenCV's CORNER_REFINE_APRILTAG [px]."""
Image = npt.NDArray[np.uint8]


class DetectedTag(NamedTuple):
    """A tag in an image.

    Attributes:
        id: Id of the tag in the family.
        corners: Corners of the black square [px], shape (4, 2), in the order bottom left, bottom right, top right, top
            left of the upright tag. Pixel centres are at whole numbers.
    """

    id: int
    corners: npt.NDArray[np.float64]


def _opencv() -> Any:
    """Returns the module `cv2`. Raises MissingDependency if OpenCV is not installed."""
    try:
        return import_module("cv2")
    except ImportError as error:
        raise MissingDependency("OpenCV", "./rpbi setup tags") from error


def _dictionary(cv2: Any) -> Any:
    return cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)


def tag_image(number: int) -> Image:
    """Returns the picture of a tag with a white margin of one cell, one pixel per cell, with values 0 or 255.

    The tag is upright, as drawn by the family's authors. OpenCV's pictures of these tags are upside down.
    """
    cv2 = _opencv()
    draw = getattr(cv2.aruco, "generateImageMarker", None) or cv2.aruco.drawMarker
    upright = np.rot90(draw(_dictionary(cv2), number, CELLS), 2)
    return np.pad(upright, 1, constant_values=255)


class TagDetector:
    """Finds tags in grey images, with corners at sub-pixel precision.

    Raises:
        MissingDependency: If OpenCV is not installed.
    """

    def __init__(self) -> None:
        cv2 = _opencv()
        aruco, dictionary = cv2.aruco, _dictionary(cv2)
        is_new = hasattr(aruco, "ArucoDetector")  # from OpenCV 4.7 on
        parameters = aruco.DetectorParameters() if is_new else aruco.DetectorParameters_create()
        parameters.cornerRefinementMethod = aruco.CORNER_REFINE_APRILTAG
        self._find = (
            aruco.ArucoDetector(dictionary, parameters).detectMarkers
            if is_new
            else partial(aruco.detectMarkers, dictionary=dictionary, parameters=parameters)
        )

    def detect(self, grey: Image) -> list[DetectedTag]:
        """Returns the tags in an image of shape (rows, columns), sorted by id. Omits ids that are found twice."""
        corners, ids, _ = self._find(grey)
        numbers = [] if ids is None else ids.ravel().tolist()
        # OpenCV starts at the bottom right of the upright tag, and continues clockwise
        found = (
            DetectedTag(number, found.reshape(4, 2)[[1, 0, 3, 2]].astype(float) - PIXEL_CENTRE)
            for number, found in zip(numbers, corners)
            if numbers.count(number) == 1
        )
        return sorted(found, key=lambda tag: tag.id)


def tag_pose(tag: DetectedTag, size: float, camera_matrix: npt.NDArray[np.float64]) -> Pose | None:
    """Returns the pose of a tag in the camera's optical frame; None if no solution is in front of the camera.

    The tag's frame has x to the right, y up and z out of the tag.

    Args:
        tag: Tag in a rectified image.
        size: Side of the black square [m].
        camera_matrix: Camera matrix of the rectified image [px], shape (3, 3).
    """
    cv2 = _opencv()
    half = size / 2.0
    # Order required by SOLVEPNP_IPPE_SQUARE: top left, top right, bottom right, bottom left
    square = np.array([[-half, half, 0.0], [half, half, 0.0], [half, -half, 0.0], [-half, -half, 0.0]])
    pixels = tag.corners[[3, 2, 1, 0]]
    # IPPE_SQUARE finds both candidate poses of a tag, but fails for tags that are parallel to the image
    solutions = [
        (float(error), rotation, translation)
        for method in (cv2.SOLVEPNP_IPPE_SQUARE, cv2.SOLVEPNP_ITERATIVE)
        for rotation, translation, (error,) in zip(
            *cv2.solvePnPGeneric(square, pixels, camera_matrix, None, flags=method)[1:]
        )
        if np.isfinite(error) and translation[2, 0] > 0.0
    ]
    if not solutions:
        return None
    _, rotation, translation = min(solutions, key=lambda solution: solution[0])
    x, y, z = translation.ravel().tolist()
    qx, qy, qz, qw = Rotation.from_rotvec(rotation.ravel()).as_quat().tolist()
    return Pose((x, y, z), (qx, qy, qz, qw))


def tag_poses(
    detector: TagDetector, grey: Image, camera_matrix: npt.NDArray[np.float64], sizes: Mapping[int, float]
) -> Iterator[tuple[int, Pose]]:
    """Yields the id and the pose of each tag in an image, except tags whose id is missing in `sizes`.

    `sizes` has the side of the black square [m], keyed by id.
    """
    for tag in detector.detect(grey):
        if tag.id in sizes and (pose := tag_pose(tag, sizes[tag.id], camera_matrix)) is not None:
            yield tag.id, pose


PIXELS_A_CELL = 32
OBJ = """\
# Square with tag36h11 {number}; the side of its black square is {size:g} m. x to the right, y up, z out of the tag.
mtllib {name}.mtl
usemtl tag
v {low:.9g} {low:.9g} 0
v {high:.9g} {low:.9g} 0
v {high:.9g} {high:.9g} 0
v {low:.9g} {high:.9g} 0
vt 0 0
vt 1 0
vt 1 1
vt 0 1
vn 0 0 1
f 1/1/1 2/2/1 3/3/1
f 1/1/1 3/3/1 4/4/1
"""
MTL = """\
newmtl tag
Ka 1 1 1
Kd 1 1 1
Ks 0 0 0
map_Kd {name}.png
"""


def write_tag(number: int, size: float, folder: Path) -> Path:
    """Writes the mesh of a tag, with material and picture, and returns the path of the mesh.

    Args:
        number: Id of the tag.
        size: Side of the black square [m]. A white margin adds one eighth of the side at each edge.
        folder: Target folder. It is created if missing.
    """
    picture = np.kron(tag_image(number), np.ones((PIXELS_A_CELL, PIXELS_A_CELL), np.uint8))
    folder.mkdir(parents=True, exist_ok=True)
    name = f"tag36h11_{number}"
    PIL.Image.fromarray(picture).convert("RGB").save(folder / f"{name}.png")
    half = size / 2.0 * (CELLS + 2) / CELLS
    (folder / f"{name}.mtl").write_text(MTL.format(name=name))
    mesh = folder / f"{name}.obj"
    mesh.write_text(OBJ.format(name=name, number=number, size=size, low=-half, high=half))
    return mesh


def main() -> None:
    """Runs the program `make_april_tag`, which writes the mesh of a tag."""
    parser = argparse.ArgumentParser(
        prog="make_april_tag", description="Makes a mesh of an AprilTag (tag36h11) for `createVisualShape`."
    )
    parser.add_argument("id", type=int, help=f"number of the tag, below {FAMILY_SIZE}")
    parser.add_argument("size", type=float, help="side of its black square [m]")
    parser.add_argument("folder", type=Path, nargs="?", default=Path(), help="where to put it; here by default")
    given = parser.parse_args()
    if not 0 <= given.id < FAMILY_SIZE:
        parser.error(f"id: tag36h11 has ids from 0 to {FAMILY_SIZE - 1}, got {given.id}")
    if not 0.0 < given.size < 1e3:
        parser.error(f"size: expected more than 0 and less than 1000 m, got {given.size:g}")
    try:
        print(write_tag(given.id, given.size, given.folder))
    except (InterfaceError, OSError) as error:
        parser.exit(1, f"{parser.prog}: {error}\n")
