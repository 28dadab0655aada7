"""Serialised images to arrays, without ROS."""

from __future__ import annotations

import io
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .message_layout import Layout, MessageType, lay_out

Array = NDArray[Any]

RAW_TYPE, COMPRESSED_TYPE = "sensor_msgs/Image", "sensor_msgs/CompressedImage"


class _Encoding(NamedTuple):
    """Layout of a pixel.

    Attributes:
        dtype: Type of a channel.
        channels: Channels in the order in which they are returned: RGB, RGBA, or one.
    """

    dtype: str
    channels: tuple[int, ...] = (0,)


ENCODINGS = {
    "mono8": _Encoding("u1"), "8UC1": _Encoding("u1"), "mono16": _Encoding("u2"), "16UC1": _Encoding("u2"),
    "32SC1": _Encoding("i4"), "32FC1": _Encoding("f4"), "64FC1": _Encoding("f8"),
    "rgb8": _Encoding("u1", (0, 1, 2)), "bgr8": _Encoding("u1", (2, 1, 0)), "8UC3": _Encoding("u1", (0, 1, 2)),
    "rgba8": _Encoding("u1", (0, 1, 2, 3)), "bgra8": _Encoding("u1", (2, 1, 0, 3)),
}  # fmt: skip
"""Encodings of `sensor_msgs/Image` by name; others are refused."""


def decode_image(message_type: MessageType, raw: bytes) -> Array:
    """Returns the pixels of a serialised `sensor_msgs/Image` or `sensor_msgs/CompressedImage`.

    Returns:
        Shape (height, width), or (height, width, 3 or 4) with the channels red, green, blue, alpha; the type is that
        of the encoding, in the byte order of this machine.

    Raises:
        ValueError: If it is another type, its sizes disagree, or its encoding is unknown.
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
