"""Images of a bag as arrays, files and video, and one table of all its topics."""

from __future__ import annotations

import io
import resource
import subprocess
from collections.abc import Callable
from pathlib import Path

import genpy
import numpy as np
import pandas as pd
import PIL.Image
import pytest
import rosbag_pandas
from sensor_msgs.msg import CompressedImage, Image, JointState
from std_msgs.msg import Float64, Header

from custom_ros_tools.errors import UnknownNameError
from rpbi_data import bag_to_dataframe, bag_to_images, write_images, write_video
from rpbi_data.bags.limits import BagError

WriteBag = Callable[..., Path]
RANDOM = np.random.default_rng(3)


def _header(time_s: float) -> Header:
    return Header(stamp=genpy.Time.from_sec(time_s))


def _image(pixels: np.ndarray, encoding: str, time_s: float = 1.0, padding: int = 0) -> Image:
    height, width = pixels.shape[:2]
    rows = np.ascontiguousarray(pixels).view(np.uint8).reshape(height, -1)
    rows = np.pad(rows, ((0, 0), (0, padding)))
    is_bigendian = pixels.dtype.byteorder == ">"
    return Image(_header(time_s), height, width, encoding, is_bigendian, rows.shape[1], rows.tobytes())


def test_pixels_of_every_encoding_come_out_as_they_went_in(write_bag: WriteBag) -> None:
    colour = RANDOM.integers(0, 256, (4, 5, 3), np.uint8)
    with_alpha = RANDOM.integers(0, 256, (4, 5, 4), np.uint8)
    depth = RANDOM.random((4, 5)).astype(np.float32)
    millimetres = RANDOM.integers(0, 2**16, (4, 5), np.uint16)
    png = io.BytesIO()
    PIL.Image.fromarray(colour).save(png, "PNG")
    cases = {
        "/rgb": (_image(colour, "rgb8"), colour),
        "/bgr": (_image(colour[..., ::-1], "bgr8"), colour),
        "/bgra": (_image(with_alpha[..., [2, 1, 0, 3]], "bgra8"), with_alpha),
        "/grey": (_image(colour[..., 0], "mono8", padding=3), colour[..., 0]),
        "/depth": (_image(depth, "32FC1", padding=4), depth),
        "/big": (_image(millimetres.astype(">u2"), "16UC1"), millimetres),
        "/png": (CompressedImage(_header(1.0), "png", png.getvalue()), colour),
    }
    bag = write_bag([(topic, message) for topic, (message, _) in cases.items()])
    for topic, (_, pixels) in cases.items():
        ((time_s, found),) = bag_to_images(bag, topic)
        np.testing.assert_array_equal(found, pixels, err_msg=topic)
        assert found.dtype == pixels.dtype.newbyteorder("=")
        assert time_s == 1.0


@pytest.mark.parametrize(
    ("message", "words"),
    [
        (
            Image(_header(1.0), 2, 2, "rgb8", 0, 6, bytes(11)),
            "/topic: message 0: expected 2 rows of at least 6 b.* got 11",
        ),
        (Image(_header(1.0), 2, 2**31, "rgb8", 0, 6, bytes(12)), "expected 2 rows of at least 6442450944 bytes"),
        (Image(_header(1.0), 1, 1, "yuv422", 0, 2, bytes(2)), "got 'yuv422'"),
        (CompressedImage(_header(1.0), "png", b"no picture"), "expected a JPEG or PNG"),
        (Float64(), "expected sensor_msgs/Image or sensor_msgs/CompressedImage, got std_msgs/Float64"),
    ],
)
def test_an_image_that_is_none_is_named(write_bag: WriteBag, message: object, words: str) -> None:
    with pytest.raises(BagError, match=words):
        list(bag_to_images(write_bag([("/topic", message)]), "/topic"))


def test_files(write_bag: WriteBag, tmp_path: Path) -> None:
    colour, depth = RANDOM.integers(0, 256, (4, 5, 3), np.uint8), RANDOM.random((4, 5)).astype(np.float32)
    bag = write_bag([("/rgb", _image(colour, "rgb8", 1.1)), ("/depth", _image(depth, "32FC1", 1.1))])
    (png,), (npy,) = write_images(bag, "/rgb", tmp_path / "rgb"), write_images(bag, "/depth", tmp_path / "depth")
    np.testing.assert_array_equal(PIL.Image.open(png), colour)
    np.testing.assert_array_equal(np.load(npy), depth)
    assert list(pd.read_csv(tmp_path / "rgb/times.csv")["time"]) == [1.1]


def test_on_a_full_disk_no_file_is_half_written(
    write_bag: WriteBag, tmp_path: Path, file_limit: Callable[[int], None]
) -> None:
    colour, depth = RANDOM.integers(0, 256, (64, 64, 3), np.uint8), RANDOM.random((64, 64)).astype(np.float32)
    bag = write_bag([("/rgb", _image(colour, "rgb8")), ("/depth", _image(depth, "32FC1"))])
    file_limit(5_000)
    for topic in ("/rgb", "/depth"):
        with pytest.raises(OSError, match="too large|requested and"):
            write_images(bag, topic, tmp_path / "images")
    file_limit(resource.RLIM_INFINITY)
    assert list((tmp_path / "images").iterdir()) == []


def test_a_video_shows_the_newest_image_at_each_time(write_bag: WriteBag, tmp_path: Path) -> None:
    """Three grey images at 0, 0.1 and 0.4 s, at 10 Hz: the second lasts for three frames."""
    greys = {0.0: 40, 0.1: 120, 0.4: 200}
    images = [_image(np.full((33, 47, 3), grey, np.uint8), "rgb8", 5 + time_s) for time_s, grey in greys.items()]
    video = tmp_path / "out/camera.mp4"
    assert write_video(write_bag([("/rgb", each) for each in images]), "/rgb", video, hz=10.0) == 5
    command = ["ffmpeg", "-loglevel", "error", "-i", video, "-f", "rawvideo", "-pix_fmt", "gray", "-"]
    frames = np.frombuffer(subprocess.run(command, capture_output=True, check=True).stdout, np.uint8)
    np.testing.assert_allclose(frames.reshape(5, 34, 48)[:, 10, 10], [40, 120, 120, 120, 200], atol=4)
    assert [path.name for path in video.parent.iterdir()] == ["camera.mp4"]


def test_a_video_that_fails_leaves_no_file(write_bag: WriteBag, tmp_path: Path) -> None:
    images = [_image(np.zeros((4, size, 3), np.uint8), "rgb8", size) for size in (4, 6)]
    bag = write_bag([*(("/rgb", each) for each in images), ("/depth", _image(np.zeros((4, 4), np.float32), "32FC1"))])
    with pytest.raises(BagError, match=r"images of one size, \(4, 4, 3\), got \(4, 6, 3\)"):
        write_video(bag, "/rgb", tmp_path / "out/camera.mp4")
    with pytest.raises(BagError, match="8 bits a channel, got float32"):
        write_video(bag, "/depth", tmp_path / "out/depth.mp4")
    with pytest.raises(UnknownNameError, match="topic"):
        write_video(bag, "/rbg", tmp_path / "out/camera.mp4")
    assert list((tmp_path / "out").iterdir()) == []


def test_one_table_of_all_topics_as_rosbag_pandas_has_it(write_bag: WriteBag) -> None:
    state = JointState(_header(1.5), ["b", "a"], [0.2, 0.1], [], [])
    bag = write_bag(
        [("/joints", state), ("/number", Float64(7.0)), ("/rgb", _image(np.zeros((1, 1), np.uint8), "mono8"))]
    )
    table = bag_to_dataframe(bag)
    assert list(table.index) == pytest.approx([100.0, 100.001])
    assert list(table["/joints/position/0"].dropna()) == [0.2]
    assert table["/joints/name/0"].iloc[0] == "b"
    assert table["/joints/header/stamp"].iloc[0] == 1.5
    assert np.isnan(table["/number/data"].iloc[0])
    assert table["/number/data"].iloc[1] == 7.0
    assert not any(name.startswith("/rgb") for name in table.columns)
    assert list(bag_to_dataframe(bag, include=["/number"]).columns) == ["/number/data"]
    assert list(rosbag_pandas.bag_to_dataframe(bag, ["/number"]).columns) == ["/number/data"]
    assert list(bag_to_dataframe(bag, include="/n.*|/j.*", exclude=["/joints"]).columns) == ["/number/data"]
    assert len(bag_to_dataframe(bag, include="/nothing")) == 0
    assert "/rgb/data" in bag_to_dataframe(bag, include="/rgb").columns
    with pytest.raises(UnknownNameError, match="topic"):
        bag_to_dataframe(bag, include=["/nmuber"])
    with pytest.raises(ValueError, match="regular expression, got '\\('"):
        bag_to_dataframe(bag, include="(")
