"""Markers and images of ROS become items and pixels of the live view."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Point
from PIL import Image as Picture
from sensor_msgs.msg import CompressedImage, Image
from visualization_msgs.msg import Marker

from rpbi.bodies.visual_shapes import ShapeKind
from rpbi_data.view import world_topics
from rpbi_data.view.moment import LinesItem, ShapeItem, SurfaceItem, TextItem
from rpbi_data.view.world_topics import MAX_IMAGE_PX, item_of, pixels_of


def marker(kind: int, points: int = 0, **fields: Any) -> Marker:
    made = Marker(ns="a", type=kind, points=[Point(i, 0.0, 0.0) for i in range(points)], **fields)
    made.scale.x, made.scale.y, made.scale.z = 1.0, 2.0, 3.0
    made.color.r, made.color.a = 2.0, 1.0
    return made


@pytest.mark.parametrize(
    ("kind", "expected"),
    [(Marker.CUBE, ShapeKind.BOX), (Marker.SPHERE, ShapeKind.SPHERE), (Marker.CYLINDER, ShapeKind.CYLINDER)],
)
def test_rigid_markers_become_shapes(kind: int, expected: ShapeKind) -> None:
    item = item_of(marker(kind), "world")
    assert isinstance(item, ShapeItem)
    assert (item.frame, item.shape.kind, item.shape.size) == ("world", expected, (1.0, 2.0, 3.0))
    assert item.shape.rgba == (1.0, 0.0, 0.0, 1.0) and item.pose.quat_xyzw == (0.0, 0.0, 0.0, 1.0)


def test_mesh_is_found_in_its_package() -> None:
    mesh = "package://rpbi_examples/configs/meshes/cube.obj"
    item = item_of(marker(Marker.MESH_RESOURCE, mesh_resource=mesh), "world")
    assert isinstance(item, ShapeItem) and item.shape.mesh_file.endswith("rpbi_examples/configs/meshes/cube.obj")


@pytest.mark.parametrize(
    ("kind", "points", "expected"),
    [
        (Marker.TRIANGLE_LIST, 6, SurfaceItem),
        (Marker.ARROW, 2, LinesItem),
        (Marker.ARROW, 0, LinesItem),
        (Marker.LINE_STRIP, 3, LinesItem),
        (Marker.LINE_LIST, 4, LinesItem),
        (Marker.TEXT_VIEW_FACING, 0, TextItem),
    ],
)
def test_other_markers_become_items(kind: int, points: int, expected: type) -> None:
    item = item_of(marker(kind, points), "world")
    assert type(item) is expected
    if isinstance(item, LinesItem):
        assert item.points.shape == (max(1, points // 2 if kind == Marker.LINE_LIST else points - 1), 2, 3)
    if isinstance(item, SurfaceItem):
        assert item.corners.shape == (6, 3)


@pytest.mark.parametrize(
    "wrong",
    [
        marker(99),
        marker(Marker.TRIANGLE_LIST, 4),
        marker(Marker.ARROW, 3),
        marker(Marker.MESH_RESOURCE, mesh_resource="http://example.org/a.stl"),
        marker(Marker.MESH_RESOURCE, mesh_resource="package://no_such_package/a.stl"),
        marker(Marker.MESH_RESOURCE, mesh_resource="file:///no/such/file.stl"),
    ],
)
def test_marker_that_cannot_be_shown_is_refused(wrong: Marker) -> None:
    with pytest.raises((ValueError, OSError)):
        item_of(wrong, "world")


def test_marker_without_finite_numbers_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    broken = marker(Marker.CUBE)
    broken.pose.position.x = float("nan")
    with pytest.raises(ValueError, match="not finite"):
        item_of(broken, "world")
    with pytest.raises(ValueError, match="finite points"):
        item_of(Marker(type=Marker.LINE_STRIP, points=[Point(float("inf"), 0, 0)] * 2), "world")
    monkeypatch.setattr(world_topics, "MAX_POINTS", 5)
    with pytest.raises(ValueError, match="at most 5"):
        item_of(marker(Marker.LINE_STRIP, 6), "world")


@pytest.mark.parametrize(("encoding", "kind", "channels"), [("rgb8", "u1", 3), ("bgr8", "u1", 3), ("mono8", "u1", 1)])
def test_raw_images_have_their_colours(encoding: str, kind: str, channels: int) -> None:
    values = np.arange(4 * 6 * channels, dtype=kind).reshape(4, 6, channels)
    padded = np.concatenate([values.reshape(4, -1), np.zeros((4, 2), kind)], axis=1)
    pixels = pixels_of(Image(height=4, width=6, encoding=encoding, step=padded.shape[1], data=padded.tobytes()))
    assert pixels is not None and pixels.shape == (4, 6, 3)
    assert np.array_equal(pixels, values[..., ::-1] if encoding == "bgr8" else np.broadcast_to(values, (4, 6, 3)))


def test_depth_is_grey_up_to_its_greatest_value() -> None:
    depth = np.array([[1.0, 2.0], [np.nan, 4.0]], "<f4")
    pixels = pixels_of(Image(height=2, width=2, encoding="32FC1", step=8, data=depth.tobytes()))
    assert pixels is not None and pixels[..., 0].tolist() == [[63, 127], [0, 255]]


def test_large_image_is_scaled_down() -> None:
    data = io.BytesIO()
    Picture.new("RGB", (4 * MAX_IMAGE_PX, MAX_IMAGE_PX), (200, 0, 0)).save(data, "JPEG")
    pixels = pixels_of(CompressedImage(data=data.getvalue()))
    assert pixels is not None and pixels.shape == (MAX_IMAGE_PX // 4, MAX_IMAGE_PX, 3)


@pytest.mark.parametrize(
    "message",
    [
        Image(height=4, width=4, encoding="rgb8", step=12, data=b"short"),
        Image(height=4, width=4, encoding="bayer_rggb8", step=4, data=bytes(16)),
        Image(encoding="rgb8"),
        CompressedImage(data=b"no picture"),
        CompressedImage(data=b"\xff\xd8\xff" + bytes(100)),
    ],
)
def test_image_that_cannot_be_read_is_left_out(message: Any) -> None:
    assert pixels_of(message) is None
