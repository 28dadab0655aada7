"""Decodes images of bags without ROS, and writes them as image files or as a video."""

from __future__ import annotations

import io
import shutil
import subprocess
from collections.abc import Generator, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from custom_ros_tools.errors import MissingDependency, UnknownNameError
from custom_ros_tools.files import atomic_file

from .bag_reader import BagReader
from .limits import BagError
from .message_layout import Layout, MessageType, lay_out
from .topic_report import message_time, topic_report

Array = NDArray[Any]

RAW_TYPE, COMPRESSED_TYPE = "sensor_msgs/Image", "sensor_msgs/CompressedImage"


class _Encoding(NamedTuple):
    """Layout of a pixel in a serialised image.

    Attributes:
        dtype: NumPy type of a channel.
        channels: Index within a pixel of each returned channel: red, green, blue (and alpha), or a single channel.
    """

    dtype: str
    channels: tuple[int, ...] = (0,)


ENCODINGS = {
    "mono8": _Encoding("u1"), "8UC1": _Encoding("u1"), "mono16": _Encoding("u2"), "16UC1": _Encoding("u2"),
    "32SC1": _Encoding("i4"), "32FC1": _Encoding("f4"), "64FC1": _Encoding("f8"),
    "rgb8": _Encoding("u1", (0, 1, 2)), "bgr8": _Encoding("u1", (2, 1, 0)), "8UC3": _Encoding("u1", (0, 1, 2)),
    "rgba8": _Encoding("u1", (0, 1, 2, 3)), "bgra8": _Encoding("u1", (2, 1, 0, 3)),
}  # fmt: skip
"""Supported encodings of `sensor_msgs/Image`, indexed by name."""


def decode_image(message_type: MessageType, raw: bytes) -> Array:
    """Returns the pixels of a serialised `sensor_msgs/Image` or `sensor_msgs/CompressedImage`.

    Returns:
        Pixels of the shape (height, width), or (height, width, 3 or 4) with the channels red, green, blue, alpha. The
        number type is the type of the encoding, in native byte order.

    Raises:
        ValueError: If the message has another type, its sizes contradict each other, or its encoding is unknown.
    """
    if message_type.name not in (RAW_TYPE, COMPRESSED_TYPE):
        raise ValueError(f"expected {RAW_TYPE} or {COMPRESSED_TYPE}, got {message_type.name}")
    layout = lay_out(message_type, raw)
    start, stop = layout.leaves["data"].span
    if message_type.name == COMPRESSED_TYPE:
        return _decompress(raw[start:stop])
    name = layout.leaves["encoding"].text(raw)
    if name not in ENCODINGS:
        raise ValueError(f"expected one of the encodings {', '.join(ENCODINGS)}, got '{name:.60}'")
    height, width, step = (_number(layout, raw, field, "<u4") for field in ("height", "width", "step"))
    dtype = np.dtype(ENCODINGS[name].dtype).newbyteorder(">" if _number(layout, raw, "is_bigendian", "u1") else "<")
    channels = ENCODINGS[name].channels
    row_bytes = width * len(channels) * dtype.itemsize
    if step < row_bytes or stop - start != step * height:
        raise ValueError(
            f"expected {height} rows of at least {row_bytes} bytes, got {stop - start} bytes in rows of {step}"
        )
    rows = np.frombuffer(raw, np.uint8, step * height, start).reshape(height, step)[:, :row_bytes]
    pixels = np.ascontiguousarray(rows).view(dtype).astype(dtype.newbyteorder("="), copy=False)
    if len(channels) == 1:
        return pixels
    pixels = pixels.reshape(height, width, len(channels))
    is_in_order = channels == tuple(range(len(channels)))
    return pixels.copy() if is_in_order else np.take(pixels, channels, axis=2)


def _number(layout: Layout, raw: bytes, field: str, dtype: str) -> int:
    return int(np.frombuffer(raw, dtype, 1, layout.leaves[field].start)[0])


def _decompress(data: bytes) -> Array:
    from PIL import Image  # slow to load, and not needed for most images

    try:
        with Image.open(io.BytesIO(data), formats=("JPEG", "PNG")) as image:
            return np.asarray(image)
    except (OSError, Image.DecompressionBombError) as error:
        raise ValueError(f"expected a JPEG or PNG: {error}") from error


def bag_to_images(
    path: str | Path, topic: str, *, any_size: bool = False
) -> Generator[tuple[float, Array], None, None]:
    """Yields the images of a topic in the order of recording.

    Args:
        path: A `.bag` file.
        topic: A topic of `sensor_msgs/Image` or `sensor_msgs/CompressedImage`.
        any_size: See `bag_to_dataframes`.

    Yields:
        The stamp [s] and the pixels of each image, as from `rpbi_data.bags.images.decode_image`.

    Raises:
        BagError: If the bag, or an image in the bag, cannot be read.
        UnknownNameError: If the bag does not have the topic.
    """
    with BagReader(path, any_size) as bag:
        if topic not in bag.types:
            raise UnknownNameError("topic", topic, bag.types)
        for number, message in enumerate(bag.messages([topic])):
            try:
                pixels = decode_image(message.type, message.raw)
            except ValueError as error:
                raise BagError(bag.path, f"{topic}: message {number}: {error}") from error
            yield message_time(message), pixels


def write_images(path: str | Path, topic: str, folder: str | Path, *, any_size: bool = False) -> list[Path]:
    """Writes the images of a topic as `000000.png`, `000001.png` ..., and their stamps [s] as `times.csv`.

    Floating-point images, such as depths [m], are written as `.npy` files without loss. `times.csv` is written last.

    Raises:
        BagError, UnknownNameError: See `bag_to_images`.
        OSError: If a file cannot be written.
    """
    from PIL import Image

    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    written, times = [], []
    for number, (time_s, pixels) in enumerate(bag_to_images(path, topic, any_size=any_size)):
        file = folder / f"{number:06}{'.npy' if pixels.dtype.kind == 'f' else '.png'}"
        with atomic_file(file) as part:
            if part.suffix == ".npy":
                np.save(part, pixels)
            else:
                Image.fromarray(pixels).save(part)
        written.append(file)
        times.append(f"{file.name},{time_s!r}\n")
    with atomic_file(folder / "times.csv") as part:
        part.write_text("file,time\n" + "".join(times))
    return written


def write_video(
    path: str | Path, topic: str, video: str | Path, *, hz: float | None = None, any_size: bool = False
) -> int:
    """Writes the 8-bit images of a topic as an H.264 video; each frame shows the newest image at the frame's time.

    Args:
        path: A `.bag` file.
        topic: See `bag_to_images`.
        video: Path of the video, such as `camera.mp4`; not written if an error occurs.
        hz: Frames per second; by default the mean rate of the topic.
        any_size: See `bag_to_dataframes`.

    Returns:
        The number of frames.

    Raises:
        BagError: If the images cannot be read, change their size, or are not of 8 bits.
        UnknownNameError: If the bag does not have the topic.
        MissingDependency: If ffmpeg is not installed.
        OSError: If the file cannot be written.
    """
    if shutil.which("ffmpeg") is None:
        raise MissingDependency("ffmpeg", "apt install ffmpeg")
    if hz is None:
        report = topic_report(path, any_size)
        if topic not in report.index:
            raise UnknownNameError("topic", topic, report.index)
        hz = float(report.rate_hz[topic])
        hz = hz if np.isfinite(hz) else 1.0
    video = Path(video)
    video.parent.mkdir(parents=True, exist_ok=True)
    with atomic_file(video) as part, closing(bag_to_images(path, topic, any_size=any_size)) as images:
        return _encode(Path(path), topic, images, hz, part)


def _encode(path: Path, topic: str, images: Iterator[tuple[float, Array]], hz: float, video: Path) -> int:
    """Pipes images into ffmpeg at a constant rate; returns the number of frames."""
    first_time_s, newest = next(images)
    shape = newest.shape
    if newest.dtype != np.uint8:
        raise BagError(path, f"{topic}: expected images of 8 bits a channel, got {newest.dtype}; see write_images")
    pixel_format = {2: "gray", 3: "rgb24" if shape[-1] == 3 else "rgba"}[newest.ndim]
    command = ["ffmpeg", "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", pixel_format]
    command += ["-video_size", f"{shape[1]}x{shape[0]}", "-framerate", f"{hz:.9g}", "-i", "-", "-c:v", "libx264"]
    command += ["-pix_fmt", "yuv420p", "-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-movflags", "+faststart", str(video)]
    encoder = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE)
    assert encoder.stdin is not None
    frames = 0
    try:
        for time_s, pixels in images:
            if pixels.shape != shape or pixels.dtype != np.uint8:
                raise BagError(path, f"{topic}: expected images of one size, {shape}, got {pixels.shape}")
            while frames < round((time_s - first_time_s) * hz):
                encoder.stdin.write(newest.tobytes())
                frames += 1
            newest = pixels
        encoder.stdin.write(newest.tobytes())
    except BrokenPipeError:
        pass  # the message of ffmpeg is read below
    except BaseException:
        encoder.kill()
        encoder.wait()
        raise
    _, errors = encoder.communicate()
    if encoder.returncode:
        raise OSError(f"ffmpeg cannot write {video}: {errors.decode(errors='replace').strip()}")
    return frames + 1
