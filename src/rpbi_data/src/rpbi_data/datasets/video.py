"""Writes and reads videos of cameras with PyAV."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from custom_ros_tools.errors import MissingDependency

try:
    import av
except ImportError:
    raise MissingDependency("av", "./rpbi setup data") from None

Array = NDArray[Any]

ENCODER = "libx264"
"""Encoder for H.264. The AV1 encoder SVT-AV1 would give the calling thread, if root, the highest real-time priority."""
PIXEL_FORMAT = "yuv420p"
MAX_PIXELS = 7680 * 4320
"""Largest number of pixels of a frame that is read."""
KEY_FRAME_EVERY = 2
"""Number of frames from one key frame to the next; a reader that jumps to a frame decodes at most this many."""


class VideoWriter:
    """Writes a video with a constant frame rate. Used as a context manager, which completes and closes the file.

    Args:
        path: The video file.
        fps: Frames per second.
        height: Number of pixel rows.
        width: Number of pixel columns.
        preset: Preset of the encoder, such as `ultrafast`.
        crf: Constant rate factor of x264. Lower values give better images and a larger file.

    Raises:
        OSError: If the file cannot be written. All methods may raise this error.
    """

    def __init__(self, path: Path, fps: int, height: int, width: int, preset: str, crf: int) -> None:
        self._container = av.open(str(path), "w", options={"movflags": "+faststart"})
        options = {"preset": preset, "crf": str(crf), "g": str(KEY_FRAME_EVERY)}
        stream: Any = self._container.add_stream(ENCODER, rate=fps, options=options)
        stream.width, stream.height, stream.pix_fmt = width, height, PIXEL_FORMAT
        stream.codec_context.thread_count = 1
        stream.time_base = Fraction(1, fps)
        self._stream = stream

    def __enter__(self) -> VideoWriter:
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        try:
            if kind is None:
                self._container.mux(self._stream.encode(None))
        finally:
            self._container.close()

    def add(self, pixels: Array) -> None:
        """Adds an image, shape (height, width, 3), uint8."""
        frame = av.VideoFrame.from_ndarray(pixels, format="rgb24")
        self._container.mux(self._stream.encode(frame))


class VideoFacts:
    """Reads the frame rate, the image size and the codec of a video file.

    Args:
        path: The video file, an MP4.

    Raises:
        ValueError: If the file cannot be read, or is not a video.
    """

    def __init__(self, path: Path) -> None:
        with _opened(path) as container:
            stream = container.streams.video[0]
            self.fps = float(stream.average_rate or 0)
            self.height, self.width = int(stream.height), int(stream.width)
            self.codec = str(stream.codec_context.name)


def read_video(path: Path) -> Iterator[tuple[float, Array]]:
    """Yields the time [s] and the pixels, shape (height, width, 3), uint8, of each frame of a video.

    Raises:
        ValueError: If the file cannot be read. Frames before a damaged frame are yielded before the error is raised.
    """
    count = 0
    with _opened(path) as container:
        try:
            for frame in container.decode(video=0):
                yield float(frame.time or 0.0), frame.to_ndarray(format="rgb24")
                count += 1
        except (av.FFmpegError, OSError) as error:
            raise ValueError(f"cannot be decoded after {count} frames: {_words(error)}") from error


def _opened(path: Path) -> Any:
    try:
        container = av.open(str(path), format="mp4")  # other formats may name further files and addresses
    except (av.FFmpegError, OSError) as error:
        raise ValueError(f"cannot be read: {_words(error)}") from error
    if not container.streams.video:
        container.close()
        raise ValueError("has no video in it")
    stream = container.streams.video[0]
    if stream.width * stream.height > MAX_PIXELS:
        container.close()
        raise ValueError(f"has frames of {stream.width} x {stream.height} pixels, expected at most {MAX_PIXELS:,}")
    return container


def _words(error: Exception) -> str:
    return getattr(error, "strerror", None) or " ".join(str(error).split())
