"""Rows of data sets have the samples of their own time, judged by integer arithmetic over the stamps of the bag."""

from __future__ import annotations

import bisect
import random

import genpy
import numpy as np
import pytest
import rosbag
from pyarrow import parquet
from sensor_msgs.msg import Image, JointState
from written_episodes import CAMERA, STATES, TARGETS

from rpbi_data import EpisodeFolder
from rpbi_data.datasets.video import read_video
from rpbi_data.episodes.bags import measure_topics
from rpbi_data.episodes.folder import BAG

COUNT = 40
SIDE = 16
BEGINS = (1_002_000_000, 1_700_000_000_123_456_789)
"""Times of the first rows: of a simulation, and of a wall clock [ns]."""


def time_of(stamp_ns: int) -> genpy.Time:
    return genpy.Time(stamp_ns // 10**9, stamp_ns % 10**9)


def rows_of(begin: int, fps: int, count: int = COUNT) -> list[int]:
    return [begin + (2 * k * 10**9 + fps) // (2 * fps) for k in range(count)]


def write_random_episode(folder: EpisodeFolder, seed: int, fps: int, begin: int) -> None:
    """Writes targets and images at the times of rows or near them, which arrive late and out of order."""
    chance = random.Random(seed)
    episode, part = folder.begin(seeds="")
    rows, period = rows_of(begin, fps), 10**9 // fps
    ends = ((rows[0], 0.0), (rows[-1], 1.0))
    messages = [(STATES, JointState(name=["a"], position=[angle]), stamp) for stamp, angle in ends]
    for number, row in enumerate(rows):
        pixels = bytes([5 * number]) * (3 * SIDE * SIDE)
        picture = Image(height=SIDE, width=SIDE, encoding="rgb8", step=3 * SIDE, data=pixels)
        for topic, message in ((TARGETS, JointState(name=["a"], position=[float(number)])), (CAMERA, picture)):
            if number == 0 or chance.random() < 0.6:
                shift = chance.choice((0, 0, 0, 1, -1, chance.randrange(period))) if number else 0
                messages.append((topic, message, row + shift))
    with rosbag.Bag(str(part / BAG), "w") as bag:
        for topic, message, stamp in messages:
            message.header.stamp = time_of(stamp)
            bag.write(topic, message, time_of(stamp + chance.randrange(3 * period)))
    episode.state, episode.topics = "complete", measure_topics(part / BAG)
    folder.complete(part, episode)


@pytest.mark.parametrize("fps", [25, 30, 60])
@pytest.mark.parametrize("timing", ["next", "previous"])
def test_rows_have_the_newest_images_and_actions_of_their_time(tmp_path, run, fps, timing):
    """Images, and previous actions, are at or before the row; next ones are before the next row."""
    folder = EpisodeFolder(tmp_path / "demos")
    for seed in range(4):
        write_random_episode(folder, seed, fps, BEGINS[seed % 2])
    code, text = run(
        "export", folder.path, "--fps", fps, "--out", tmp_path / "out", "--action", timing, "--option", "crf=5"
    )
    assert code == 0, text
    table = parquet.read_table(tmp_path / "out/data/chunk-000/file-000.parquet")
    rows = {key: np.array(table.column(key).to_pylist()) for key in table.column_names}
    ties = 0
    for index in range(4):
        own = rows["episode_index"] == index
        times = [second * 10**9 + rest for second, rest in rows["source.stamp"][own].tolist()]
        assert times == rows_of(BEGINS[index % 2], fps)
        sent: dict[str, list[tuple[int, int]]] = {TARGETS: [], CAMERA: []}
        with rosbag.Bag(str(folder.folder_of(index) / BAG)) as bag:
            for topic, message, _ in bag.read_messages([TARGETS, CAMERA]):
                number = round(message.position[0]) if topic == TARGETS else message.data[0] // 5
                sent[topic].append((message.header.stamp.to_nsec(), number))
        newest = {}
        ends = [begin - 1 for begin in rows_of(BEGINS[index % 2], fps, COUNT + 1)[1:]]
        for topic, samples in sent.items():
            samples.sort()
            stamps = [stamp for stamp, _ in samples]
            ties += len({*stamps} & {*times})
            at = ends if (topic, timing) == (TARGETS, "next") else times
            newest[topic] = [samples[bisect.bisect_right(stamps, until) - 1] for until in at]
        assert rows["action"][own].ravel().tolist() == [number for _, number in newest[TARGETS]]
        errors = [abs(row - stamp) / 1e9 for row, (stamp, _) in zip(times, newest[TARGETS])]
        assert rows["source.time_error"][own][:, -2] == pytest.approx(errors, abs=1e-9, rel=1e-6)
        ages = [(row - stamp) / 1e9 for row, (stamp, _) in zip(times, newest[CAMERA])]
        assert rows["source.time_error"][own][:, -1] == pytest.approx(ages, abs=1e-9, rel=1e-6)
        film = read_video(tmp_path / f"out/videos/observation.images.camera_colour/chunk-000/file-{index:03}.mp4")
        shown = [pixels.mean() / 5 for _, pixels in film]
        assert shown == pytest.approx([number for _, number in newest[CAMERA]], abs=0.4)
    assert ties > 80
