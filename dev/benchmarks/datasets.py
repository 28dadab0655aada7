"""Time that the export of an episode with two cameras takes, for each second of its length."""

from __future__ import annotations

import io
import tempfile
import time
from pathlib import Path

import genpy
import numpy as np
import rosbag
from PIL import Image as PilImage
from result import Result, Target
from sensor_msgs.msg import CompressedImage, Image, JointState

from rpbi_data.datasets.export import ExportOptions, export_folder
from rpbi_data.datasets.formats import FORMATS
from rpbi_data.episodes.bags import measure_topics
from rpbi_data.episodes.folder import BAG, EpisodeFolder

SECONDS = {"raw": 60.0, "JPEG": 600.0}
"""Lengths of the episodes [s]; raw images of a minute take 3 GB."""
QUICK_SECONDS = 5.0
FPS = 30
HEIGHT, WIDTH = 480, 640
PICTURES = 60
"""Number of different images, repeated in a cycle."""
JOINTS = [f"lwr_arm_{index}_joint" for index in range(7)]


def run(quick: bool) -> list[Result]:
    """Measures the processor time of exports to LeRobot, in seconds for a second of the recording.

    Args:
        quick: Whether to measure a few seconds only.
    """
    results = []
    for kind, length_s in SECONDS.items():
        seconds = QUICK_SECONDS if quick else length_s
        with tempfile.TemporaryDirectory(prefix="rpbi-bench-") as name:
            folder = EpisodeFolder(Path(name) / "demos")
            _write(folder, seconds, kind == "JPEG")
            format_class = FORMATS["lerobot"]
            format_ = format_class(format_class.Config.parse({}, "benchmark"))
            begin_s, begin_cpu_s = time.perf_counter(), time.process_time()
            export_folder(folder, Path(name) / "out", "lerobot", format_, ExportOptions(FPS, "test"), lambda _: None)
            wall_s, cpu_s = time.perf_counter() - begin_s, time.process_time() - begin_cpu_s
            figure = f"{seconds:g} s of two {kind} cameras of {WIDTH} x {HEIGHT} to LeRobot"
            results.append(Result("datasets", f"{figure}: processor", cpu_s / seconds, "s per s", None, Target(1.0)))
            results.append(Result("datasets", f"{figure}: wall time", wall_s / seconds, "s per s"))
    return results


def _write(folder: EpisodeFolder, seconds: float, is_jpeg: bool) -> None:
    """Writes an episode of an arm and two cameras."""
    episode, part = folder.begin()
    pictures = [_message(_picture(number), is_jpeg) for number in range(PICTURES)]
    with rosbag.Bag(str(part / BAG), "w") as bag:
        for index in range(round(seconds * 100)):
            stamp = genpy.Time.from_sec(1.0 + index / 100)
            state = JointState(name=JOINTS, position=np.sin(index / 100 + np.arange(len(JOINTS))).tolist())
            state.header.stamp = stamp
            bag.write("/rpbi/arm/joint_states", state, stamp)
            bag.write("/rpbi/arm/joint_states/target", state, stamp)
        for index in range(round(seconds * FPS)):
            stamp = genpy.Time.from_sec(1.0 + index / FPS)
            for camera in ("front", "side"):
                message = pictures[index % PICTURES]
                message.header.stamp = stamp
                bag.write(f"/rpbi/{camera}/colour/image{'/compressed' * is_jpeg}", message, stamp)
    episode.state, episode.topics = "complete", measure_topics(part / BAG)
    folder.complete(part, episode)


def _picture(number: int) -> np.ndarray:
    """Returns a textured picture with a moving part."""
    rows, columns = np.mgrid[:HEIGHT, :WIDTH]
    texture = np.random.default_rng(0).integers(0, 12, (HEIGHT, WIDTH, 1))
    pixels = np.stack([columns / 3, rows / 2, (rows + columns) / 5], axis=2) + texture
    left = 500 * number // PICTURES
    pixels[200:320, left : left + 120] = (200, 60, 40)
    return pixels.astype(np.uint8)


def _message(pixels: np.ndarray, is_jpeg: bool) -> Image | CompressedImage:
    if not is_jpeg:
        return Image(height=HEIGHT, width=WIDTH, encoding="rgb8", step=3 * WIDTH, data=pixels.tobytes())
    data = io.BytesIO()
    PilImage.fromarray(pixels).save(data, "jpeg", quality=80)
    return CompressedImage(format="jpeg", data=data.getvalue())
