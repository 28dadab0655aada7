"""Reads rosbag2 recordings of `./rpbi export` with the packages of MCAP, and compares all messages with their bags.

Started by `dev/tools/mcap/check.sh DIR`, in an environment that has them.
"""

import math
import sys
from pathlib import Path

import genpy
import rosbag
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "src/custom_ros_tools/src"))
sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "src/episodes/src"))
from rpbi_data.datasets.provenance import read_episode, read_export


def main(folder: Path) -> int:
    """Prints what differs, and returns the exit code."""
    faults, count = [], 0
    recordings = sorted(folder.glob("*/*.mcap"))
    for index, recording in enumerate(recordings):
        source = read_episode(folder, index)["source"]
        bag = Path(source["folder"]) / f"episode_{source['episode']:06d}" / "episode.bag"
        with recording.open("rb") as stream:
            reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
            found = {}
            for _, channel, message, content in reader.iter_decoded_messages():
                found.setdefault(channel.topic, []).append((message.log_time, content))
        recorded = {}
        with rosbag.Bag(str(bag)) as opened:
            for topic, message, time in opened.read_messages():
                recorded.setdefault(topic, []).append((time.to_nsec(), message))
        for topic in sorted(found.keys() | recorded.keys()):
            ours, theirs = recorded.get(topic, []), found.get(topic, [])
            count += len(theirs)
            different = sum(
                before_ns != after_ns or not is_same(before, after)
                for (before_ns, before), (after_ns, after) in zip(ours, theirs)
            )
            if different or len(ours) != len(theirs):
                faults.append(
                    f"{recording.parent.name}: {topic}: {len(ours)} messages, {len(theirs)} found, {different} differ"
                )
    print("\n".join(faults))
    episodes = len(read_export(folder)["episodes"])
    print(f"mcap read {len(recordings)} of {episodes} episodes, {count} messages: {len(faults)} topics differ")
    return 1 if faults or len(recordings) != episodes else 0


def is_same(before: object, after: object) -> bool:
    """Returns whether a value of ROS 1 and one of ROS 2 are the same; headers of ROS 2 have no `seq`."""
    if isinstance(before, genpy.TVal):
        return (before.secs, before.nsecs) == (after.sec, after.nanosec)
    if isinstance(before, genpy.Message):
        names = [name for name in before.__slots__ if (before._type, name) != ("std_msgs/Header", "seq")]
        fields = {name.lower(): name for name in after.__slots__}
        return all(is_same(getattr(before, name), getattr(after, fields[name.lower()])) for name in names)
    if isinstance(before, str):
        return before == after
    if isinstance(before, bytes | list | tuple):
        return len(before) == len(after) and (
            bytes(before) == bytes(after)
            if isinstance(before, bytes)
            else all(is_same(one, other) for one, other in zip(before, after))
        )
    return before == after or math.isnan(before) and math.isnan(after)


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
