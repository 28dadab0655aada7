"""Recordings lose nothing at either end, and say so when they failed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from xmlrpc.client import Marshaller

import pytest
import rosbag
import rosgraph
import rospy
from ros_system import stop_group, wait_until
from rosgraph_msgs.msg import Clock
from second_master import SecondMaster
from std_msgs.msg import Float64, Int64

from custom_ros_tools.ros.lifecycle.timed_master import allow_large_integers
from rpbi_data import Recorder, bag_to_dataframes
from rpbi_data.bags import bag_writer_node
from rpbi_data.bags import recorded_topics as recorder_module
from rpbi_data.bags.bag_writer_node import BagWriter
from rpbi_data.bags.connected_topics import count_received
from rpbi_data.bags.limits import RecordingError

TALKER = """
import rospy, sys
from std_msgs.msg import Float64, Int64
rospy.init_node("talker", anonymous=True, disable_rostime=True)
publisher = rospy.Publisher(sys.argv[1], Float64, queue_size=10)
while not rospy.is_shutdown():
    publisher.publish(1.0)
    rospy.rostime.wallsleep(0.01)
"""

SCRIPT = """
import sys, time
from rpbi_data import Recorder
with Recorder(sys.argv[1], ["/a"]):
    print("recording")
    time.sleep(60)
"""


def _recorders() -> list[str]:
    """Returns the command lines of this process's recorders that still run."""
    listing = subprocess.run(["ps", "--ppid", str(os.getpid()), "-o", "args="], capture_output=True, text=True)
    return [line for line in listing.stdout.splitlines() if "bag_writer" in line]


@pytest.fixture(autouse=True)
def _no_recorder_is_left() -> Iterator[None]:
    yield
    assert _recorders() == []


PERIOD_S = 0.02


class Counter:
    """Publishes 0, 1, 2, ... on several topics, and knows what it published last."""

    def __init__(self, topics: list[str]) -> None:
        self.publishers = [rospy.Publisher(topic, Float64, queue_size=1000) for topic in topics]
        self.last = -1
        self._is_ended = threading.Event()
        self._thread = threading.Thread(target=self._run)

    def __enter__(self) -> Counter:
        self._thread.start()
        return self

    def __exit__(self, *_: Any) -> None:
        self._is_ended.set()
        self._thread.join()
        for publisher in self.publishers:
            publisher.unregister()

    def _run(self) -> None:
        while not self._is_ended.wait(PERIOD_S):
            for publisher in self.publishers:
                publisher.publish(self.last + 1)
            self.last += 1


@pytest.mark.quick
def test_bag_contains_all_messages_published_inside_on_every_topic(ros: Any, tmp_path: Path) -> None:
    topics = [f"/counted_{index}" for index in range(5)]
    with Counter(topics) as counter:
        wait_until(lambda: counter.last > 0, "something is published")
        for attempt in range(3):
            with Recorder(tmp_path / "out" / f"{attempt}.bag", topics) as recorder:
                first = counter.last + 1
                wait_until(lambda first=first: counter.last > first + 10, "10 messages are published")
                last = counter.last
            tables = bag_to_dataframes(recorder.path)
            assert list(tables) == topics
            for table in tables.values():
                assert set(range(first, last + 1)) <= set(table["data"])
                assert (table["data"].diff().dropna() == 1).all()


def test_messages_published_at_the_very_end_are_recorded(ros: Any, tmp_path: Path) -> None:
    publisher = rospy.Publisher("/burst", Float64, queue_size=100)
    for _ in range(3):
        with Recorder(tmp_path / "a.bag", ["/burst"]):
            for number in range(50):
                publisher.publish(number)
        assert list(bag_to_dataframes(tmp_path / "a.bag")["/burst"]["data"]) == list(range(50))
    publisher.unregister()


def test_recorder_paused_for_a_while_misses_nothing(ros: Any, tmp_path: Path) -> None:
    """As many messages come meanwhile as of 3 s at 1 kHz; it still stands still when the recording is to end."""
    numbers = range(3000)
    publisher = rospy.Publisher("/burst", Float64, queue_size=len(numbers))
    with Recorder(tmp_path / "a.bag", ["/burst"]) as recorder:
        recorder._process.send_signal(signal.SIGSTOP)
        for number in numbers:
            publisher.publish(number)
        going_on = threading.Timer(0.5, recorder._process.send_signal, [signal.SIGCONT])
        going_on.start()
    going_on.join()
    publisher.unregister()
    assert list(bag_to_dataframes(tmp_path / "a.bag")["/burst"]["data"]) == list(numbers)


@pytest.mark.thorough
def test_recorder_paused_for_long_loses_no_messages(ros: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As on a slow disk: at the end its process answers nothing for longer than the usual grace."""
    monkeypatch.setattr(recorder_module, "_MOST_GRACE_S", 0.2)
    publisher = rospy.Publisher("/burst", Float64, queue_size=2000)
    with Recorder(tmp_path / "a.bag", ["/burst"]) as recorder:
        end, arrived = recorder._end, []
        monkeypatch.setattr(recorder, "_end", lambda: [arrived.append(count_received(recorder._node)), end()][1])
        recorder._process.send_signal(signal.SIGSTOP)
        for number in range(2000):
            publisher.publish(number)
        going_on = threading.Timer(2.5, recorder._process.send_signal, [signal.SIGCONT])
        going_on.start()
    going_on.join()
    assert arrived == [{"/burst": 2000}], "it is not asked to end before it has read all"
    assert len(bag_to_dataframes(tmp_path / "a.bag")["/burst"]) == 2000
    with Recorder(tmp_path / "a.bag", ["/burst"]) as recorder:
        monkeypatch.setattr(recorder, "_timeout_s", 0.0)
        recorder._process.send_signal(signal.SIGSTOP)
        publisher.publish(0)
        recorder._wait_until_received()
        assert recorder.missing == 1
        recorder._process.send_signal(signal.SIGCONT)
        monkeypatch.undo()
    publisher.unregister()


def test_a_topic_that_changes_its_type_is_recorded_with_both(ros: Any, tmp_path: Path) -> None:
    with Recorder(tmp_path / "a.bag", ["/odd"]):
        for kind, value in ((Float64, 1.5), (Int64, 7)):
            publisher = rospy.Publisher("/odd", kind, queue_size=10, latch=True)
            publisher.publish(value)
            wait_until(publisher.get_num_connections, "the recorder connects")
            publisher.unregister()
    with rosbag.Bag(str(tmp_path / "a.bag")) as bag:
        assert [(each.message._type, each.message.data) for each in bag.read_messages()] == [
            ("std_msgs/Float64", 1.5),
            ("std_msgs/Int64", 7),
        ]


def test_topic_published_later_is_recorded_from_its_first_message(ros: Any, tmp_path: Path) -> None:
    with Recorder(tmp_path / "a.bag", ["/late"]):
        publisher = rospy.Publisher("/late", Float64, queue_size=10, latch=True)
        publisher.publish(7.0)
        wait_until(publisher.get_num_connections, "the recorder connects")
    publisher.unregister()
    assert list(bag_to_dataframes(tmp_path / "a.bag")["/late"]["data"]) == [7.0]


def test_messages_of_a_node_in_cpp_are_counted(ros: Any, tmp_path: Path) -> None:
    """As of robot_state_publisher beside the Panda; roscpp has another answer than rospy."""
    links = '<link name="a"/><link name="b"/>'
    joint = '<joint name="j" type="fixed"><parent link="a"/><child link="b"/></joint>'
    rospy.set_param("/two_links/robot_description", f'<robot name="two">{links}{joint}</robot>')
    ros.start(
        ["rosrun", "robot_state_publisher", "robot_state_publisher", "__ns:=two_links", "/tf_static:=/two_links/tf"]
    )
    with Recorder(tmp_path / "cpp.bag", ["/two_links/tf"]) as recorder:
        wait_until(lambda: recorder.published() == {"/two_links/tf": 1}, "it is counted", 30.0)


def test_messages_are_counted_after_more_bytes_than_32_bits_count(
    ros: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As after some minutes of a camera; a node that does not allow it is left out."""
    dispatch: Any = Marshaller.dispatch
    monkeypatch.setitem(dispatch, int, dispatch[int])  # which is put back after the test
    publisher = rospy.Publisher("/much", Float64, queue_size=10, latch=True)
    publisher.publish(7.0)
    publisher.impl.message_data_sent += 1 << 33
    with Recorder(tmp_path / "a.bag", ["/much"]) as recorder:
        wait_until(publisher.get_num_connections, "the recorder connects")
        assert recorder.published() == {}
        allow_large_integers()
        wait_until(lambda: recorder.published() == {"/much": 1}, "it is counted", 30.0)
    publisher.unregister()


def test_the_bag_before_is_replaced_and_nothing_else_is_left(ros: Any, tmp_path: Path) -> None:
    path = tmp_path / "a.bag"
    for topic in ("/first", "/second"):
        with Counter([topic]) as counter, Recorder(path, [topic]):
            start = counter.last
            wait_until(lambda counter=counter, start=start: counter.last > start + 5, "something is published")
        assert list(bag_to_dataframes(path)) == [topic]
        assert os.listdir(tmp_path) == ["a.bag"]


def test_relative_topics_are_those_of_the_namespace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_NAMESPACE", "left")
    assert Recorder(tmp_path / "a.bag", ["tf", "/tf", "/left/tf"]).topics == ["/left/tf", "/tf"]


@pytest.mark.parametrize(("name", "topics"), [("a", ["/tf"]), ("a.bag", []), ("a.bag", "/tf")])
def test_impossible_recordings_are_refused_at_once(tmp_path: Path, name: str, topics: Any) -> None:
    with pytest.raises(ValueError):
        Recorder(tmp_path / name, topics)


def test_a_full_disk_is_an_error(ros: Any, tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="not recording: expected at least 1e[+]12 MB of free space, got"):
        with Recorder(tmp_path / "a.bag", ["/a"], min_space_mb=1e12):
            pass


def test_a_folder_that_cannot_be_written_is_an_error(ros: Any) -> None:
    with pytest.raises(RecordingError, match="not recording: "):
        with Recorder("/proc/a.bag", ["/a"]):
            pass


@pytest.mark.parametrize("path", ["/proc/missing/a.bag", "file/a.bag", "file/below/a.bag", "folder.bag"])
def test_a_path_where_no_bag_can_be_is_an_error(ros: Any, tmp_path: Path, path: str) -> None:
    (tmp_path / "file").touch()
    (tmp_path / "folder.bag").mkdir()
    with pytest.raises(RecordingError, match=f"{path}: cannot be written: .*Errno"):
        Recorder(tmp_path / path, ["/a"]).start()


@pytest.mark.parametrize("question", ["getSystemState", "lookupNode"])
def test_a_master_that_dies_while_it_waits_is_an_error(
    second_master: SecondMaster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, question: str
) -> None:
    """It dies just before it is asked."""
    monkeypatch.setenv("ROS_MASTER_URI", second_master.uri)
    rosgraph.Master("/ended").registerPublisher("/a", "std_msgs/Float64", "http://127.0.0.1:1/")
    ask = getattr(rosgraph.Master, question)

    def kill_and_ask(*arguments: Any) -> Any:
        second_master.kill()
        return ask(*arguments)

    monkeypatch.setattr(rosgraph.Master, question, kill_and_ask)
    with pytest.raises(RecordingError, match=f"the ROS master at {second_master.uri} does not answer any more"):
        Recorder(tmp_path / "a.bag", ["/a"]).start()


def test_killed_recorder_is_an_error_with_the_repair_command(ros: Any, tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"ended early.*rosbag reindex .*a\.bag\.active"):
        with Counter(["/a"]), Recorder(tmp_path / "a.bag", ["/a"]) as recorder:
            wait_until((tmp_path / "a.bag.active").exists, "the bag is begun")
            recorder._process.kill()
            wait_until(lambda: not recorder.is_running, "it is dead")


def test_error_inside_is_raised_and_the_bag_is_closed(ros: Any, tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError):
        with Counter(["/a"]) as counter, Recorder(tmp_path / "a.bag", ["/a"]):
            first = counter.last
            wait_until(lambda: counter.last > first + 5, "something is published")
            raise ZeroDivisionError
    assert len(bag_to_dataframes(tmp_path / "a.bag")["/a"]) > 0


def test_ctrl_c_closes_the_bag_and_leaves_no_process(ros: Any, tmp_path: Path) -> None:
    path = tmp_path / "a.bag"
    with Counter(["/a"]) as counter:
        process = ros.start([sys.executable, "-c", SCRIPT, str(path)])
        wait_until(lambda: "recording" in ros.output(process), "it records")
        first = counter.last
        wait_until(lambda: counter.last > first + 10, "something is recorded")
        assert stop_group(process) != 0  # SIGINT goes to the script and to its recorder, as from a terminal
    assert len(bag_to_dataframes(path)["/a"]) > 0
    assert "Traceback" in ros.output(process) and "KeyboardInterrupt" in ros.output(process)
    with pytest.raises(ProcessLookupError):
        os.killpg(process.pid, 0)


def test_recorder_of_a_killed_script_closes_the_bag_and_ends(ros: Any, tmp_path: Path) -> None:
    path = tmp_path / "a.bag"
    with Counter(["/a"]) as counter:
        process = ros.start([sys.executable, "-c", SCRIPT, str(path)])
        wait_until(lambda: "recording" in ros.output(process), "it records")
        first = counter.last
        wait_until(lambda: counter.last > first + 10, "something is recorded")
        process.kill()
        process.wait()
        wait_until(path.exists, "the recorder closes the bag")
    assert len(bag_to_dataframes(path)["/a"]) > 0


def test_without_a_master_it_does_not_start(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_MASTER_URI", "http://127.0.0.1:1")
    with pytest.raises(RecordingError, match="no ROS master at http://127.0.0.1:1"):
        Recorder(tmp_path / "a.bag", ["/a"]).start()


def test_start_and_stop_out_of_order_are_refused(ros: Any, tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "a.bag", ["/a"])
    with pytest.raises(RecordingError, match="has not been started"):
        recorder.stop()
    recorder.start()
    with pytest.raises(RecordingError, match="going on already"):
        recorder.start()
    assert recorder.stop() == tmp_path / "a.bag"


def test_a_signal_late_in_a_poll_ends_the_writer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On a busy machine, a process goes on late after a signal: when the timeout of its queue is over."""
    monkeypatch.setattr(rospy, "get_param", lambda _, default: default)
    writer = BagWriter(tmp_path / "a.bag", 1.0)

    def end(*_: Any) -> None:
        writer.end()
        time.sleep(2.0 * bag_writer_node._POLL_S)

    before = signal.signal(signal.SIGUSR1, end)
    sender = threading.Timer(1.5 * bag_writer_node._POLL_S, os.kill, [os.getpid(), signal.SIGUSR1])
    sender.start()
    try:
        writer.run([])
    finally:
        sender.join()
        signal.signal(signal.SIGUSR1, before)
    assert (tmp_path / "a.bag").exists()


def test_simulated_time_without_a_clock_is_named(ros: Any, tmp_path: Path) -> None:
    rospy.set_param("/use_sim_time", True)
    (tmp_path / "a.bag").write_text("from before")  # not to be taken for the recording
    with pytest.raises(RecordingError, match="with use_sim_time the recorder waits for /clock"):
        with Recorder(tmp_path / "a.bag", ["/a"]):
            pass


def test_a_frozen_clock_stops_neither_start_nor_end(ros: Any, tmp_path: Path) -> None:
    rospy.set_param("/use_sim_time", True)
    clock = rospy.Publisher("/clock", Clock, queue_size=1, latch=True)
    clock.publish(rospy.Time(5))
    with Counter(["/a"]) as counter, Recorder(tmp_path / "a.bag", ["/a", "/clock"]):
        first = counter.last
        wait_until(lambda: counter.last > first + 5, "something is published")
    clock.unregister()
    tables = bag_to_dataframes(tmp_path / "a.bag")
    assert set(tables["/a"].index) == {5.0}
    assert list(tables["/clock"]["clock"]) == [5.0]


def test_no_message_of_a_fast_clock_is_missed_at_start(ros: Any, tmp_path: Path) -> None:
    """Its connection is there before those of fifty topics; all that is sent to it is counted by the publisher."""
    rospy.set_param("/use_sim_time", True)
    clock = rospy.Publisher("/clock", Clock, queue_size=1000)
    is_over = threading.Event()

    def run() -> None:
        tick = 0
        while not is_over.wait(5e-4):
            tick += 1
            clock.publish(rospy.Time(1, 1000 * tick))

    thread = threading.Thread(target=run)
    thread.start()
    with Recorder(tmp_path / "a.bag", [*(f"/a_{number}" for number in range(50)), "/clock"]) as recorder:
        is_over.set()
        thread.join()
        sent = wait_until(lambda: recorder.published().get("/clock"), "its publisher answers")
    clock.unregister()
    assert sent > 0 and len(bag_to_dataframes(recorder.path)["/clock"]) == sent


@pytest.mark.thorough
def test_hanging_publisher_is_named_and_the_others_are_recorded(
    ros: Any, tmp_path: Path, caplog: pytest.LogCaptureFixture, stopped: Callable[[str], str]
) -> None:
    node = stopped("/hung")
    with Counter(["/a"]) as counter, Recorder(tmp_path / "a.bag", ["/hung", "/a"], timeout_s=6.0):
        first = counter.last
        wait_until(lambda: counter.last > first + 5, "something is published")
    assert f"not connected to {node} (/hung)" in caplog.text
    assert len(bag_to_dataframes(tmp_path / "a.bag")["/a"]) >= 5


@pytest.fixture
def stopped(ros: Any) -> Callable[[str], str]:
    """Starts a publisher, stops it with SIGSTOP and returns the name of its node."""

    def stop(topic: str) -> str:
        talker = ros.start([sys.executable, "-c", TALKER, topic])

        def publishers() -> list[str]:
            return dict(rosgraph.Master("/tests").getSystemState()[0]).get(topic, [])

        (node,) = wait_until(publishers, f"{topic} is published")
        talker.send_signal(signal.SIGSTOP)
        return node

    return stop


def test_a_node_in_cpp_is_no_obstacle_to_counting(ros: Any, tmp_path: Path) -> None:
    ros.start(["rosrun", "tf2_ros", "static_transform_publisher", *"0 0 1 0 0 0 rpbi/world there".split()])
    wait_until(lambda: any("/tf_static" in topic for topic, _ in rospy.get_published_topics()), "it publishes")
    with Recorder(tmp_path / "a.bag", ["/tf_static"]) as recorder:
        assert set(recorder.published()) <= {"/tf_static"}
    assert len(bag_to_dataframes(tmp_path / "a.bag")["/tf_static"]) == 1
