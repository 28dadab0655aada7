"""The device by its socket: hands as axes, silence, calibration, recordings and their player."""

from __future__ import annotations

import struct
import time

import numpy as np
import pytest
from mvn_stream import HZ, T_POSE, WALKER, Sender, assert_same, suit, truth
from tries import tries

from custom_ros_tools.errors import InterfaceError
from operator_node.device import DeviceError
from operator_node.devices.mvn import AXES, HandAxes, Mvn
from operator_node.mvn.orientations import Calibration, about_z, multiply
from operator_node.mvn.player import send, timed_datagrams
from operator_node.mvn.receiver import MvnConfig, Silence
from operator_node.mvn.recording import MAGIC, DatagramRecording, read_recording
from operator_node.mvn.segments import INDEX, SegmentFrame

SOON_S = 10.0


@pytest.fixture
def mvn(request):
    """The device; who stands still for a minute has gone, or after as long as a test says."""
    device = Mvn(MvnConfig(port=0, timeout_s=getattr(request, "param", 60.0)))
    device.open()
    yield device
    device.close()


@pytest.fixture
def sender(mvn):
    sender = Sender(mvn.receiver.port)
    yield sender
    sender.close()


def read_frame(device):
    """Returns the reading with the next frame, and the frame."""
    for _ in tries("a frame comes"):
        reading = device.read(SOON_S)
        assert reading is not None, "no frame came"
        for event in reading.events:
            if isinstance(event, SegmentFrame):
                return reading, event


def test_received_hand_positions_are_relative_to_the_first_frame(mvn, sender):
    first = round((1.5 + 1.0) * HZ)  # a hand is on its way
    sender.send(*suit().datagrams(first, first / HZ))
    reading, frame = read_frame(mvn)
    assert_same(frame, truth(first))
    assert reading.axes == (0.0,) * len(AXES)
    sender.send(*suit().datagrams(first + 6, (first + 6) / HZ))
    reading, _ = read_frame(mvn)
    assert 0.02 < max(map(abs, reading.axes)) <= 1.0


@pytest.mark.parametrize("mvn", [0.3], indirect=True)
def test_silence_gives_zeros_once_and_the_hands_count_anew(mvn, sender):
    for sample in (150, 165):
        sender.send(*suit().datagrams(sample, sample / HZ))
        reading, _ = read_frame(mvn)
    assert any(reading.axes)
    silent = mvn.read(SOON_S)
    assert silent == ((0.0,) * 6, (), (Silence(0, 0.3),), *silent[3:])
    assert mvn.receiver.people == []
    assert mvn.read(0.0) is None
    sender.send(*suit().datagrams(10, 200 / HZ))  # elsewhere, and from an earlier sample
    reading, frame = read_frame(mvn)
    assert frame.sample == 10 and not any(reading.axes)


def test_port_in_use_is_reported(mvn):
    other = Mvn(MvnConfig(port=mvn.receiver.port))
    with pytest.raises(
        DeviceError, match=r"cannot listen at 127.0.0.1:\d+: Address already in use; does another program"
    ):
        other.open()
    other.close()


def test_reopened_receiver_continues(mvn, sender):
    config = MvnConfig(port=mvn.receiver.port)
    mvn.close()
    mvn.close()
    again = Mvn(config)
    again.open()
    sender.send(*suit().datagrams(1, 0.0))
    read_frame(again)
    again.close()


def test_refused_datagrams_are_counted_with_their_reason(mvn, sender):
    sender.send(b"", b"hello", b"MXTP05" + bytes(100))
    refused = []
    for _ in tries("all three are refused"):
        refused += mvn.read(SOON_S).refused
        if len(refused) >= 3:
            break
    assert [reason.partition(":")[0] for reason in refused] == ["shorter than a header"] * 2 + ["Unity's format"]
    assert mvn.counts["refused: too short"] == 2


class TestHands:
    """How far the hands are from where they were."""

    def moved(self, by, turned=0.0, at=0.0):
        """Returns the axes after the right hand has moved, and then the whole person."""
        hands, frame = HandAxes(), truth(0, moves=T_POSE)
        assert hands.axes(frame) == (0.0,) * 6
        positions = frame.positions.copy()
        positions[INDEX["RightHand"]] += by
        turn = about_z(turned)
        c, s = np.cos(turned), np.sin(turned)
        positions = positions @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) + at
        return hands.axes(
            frame._replace(positions=positions, quats_xyzw=multiply(np.tile(turn, (23, 1)), frame.quats_xyzw))
        )

    def test_are_counted_in_arms(self):
        arm_m = (0.186 + 0.146) * 1.7  # of the emulator's person
        by = np.array([0.1, 0.02, -0.05])
        axes = self.moved(by)
        assert axes[:3] == pytest.approx(by / arm_m)
        assert axes[3:] == pytest.approx((0, 0, 0), abs=1e-12)

    def test_are_seen_from_the_pelvis(self):
        by = np.array([0.1, 0.02, -0.05])
        assert self.moved(by, turned=2.5, at=(3.0, -1.0, 0.0)) == pytest.approx(self.moved(by), abs=1e-9)

    def test_stay_in_their_range(self):
        assert self.moved(np.array([3.0, 0.0, -3.0]))[:3] == (1.0, 0.0, -1.0)

    def test_move_little_from_frame_to_frame(self):
        hands, before = HandAxes(), (0.0,) * 6
        for sample in range(90, 500):
            axes = hands.axes(truth(sample))
            assert max(abs(a - b) for a, b in zip(axes, before)) < 0.15
            before = axes


class TestCalibration:
    """A T-pose that the suit does not see as one."""

    @pytest.fixture
    def crooked(self):
        """A T-pose whose segments are turned by some degrees, of somebody who looks elsewhere."""
        random = np.random.default_rng(3)
        positions, quats = T_POSE.pose(0.0)
        axes = random.normal(size=(23, 3))
        half = np.radians(random.uniform(0, 20, (23, 1))) / 2
        errors = np.hstack((np.sin(half) * axes / np.linalg.norm(axes, axis=1)[:, None], np.cos(half)))
        errors[0] = 0, 0, 0, 1
        return truth(0)._replace(quats_xyzw=multiply(np.tile(about_z(1.0), (23, 1)), multiply(quats, errors)))

    def test_turns_all_segments_alike(self, crooked):
        calibration = Calibration()
        assert "deg off a T-pose" in calibration.fit(crooked)
        upright = calibration.apply(crooked).quats_xyzw
        np.testing.assert_allclose(np.abs(upright @ about_z(1.0)), 1.0, atol=1e-12)
        assert calibration.people == [0]
        calibration.clear()
        assert calibration.apply(crooked) is crooked

    def test_of_another_person_changes_nothing(self, crooked):
        calibration = Calibration()
        calibration.fit(crooked._replace(person=1))
        assert calibration.apply(crooked) is crooked

    def test_refuses_who_walks(self):
        with pytest.raises(InterfaceError, match=r"person 0: \w+ is \d+ deg off a T-pose; stand upright"):
            Calibration().fit(truth(300))

    def test_calibration_without_a_person_is_refused(self, mvn):
        with pytest.raises(InterfaceError, match="no person is present"):
            mvn.receiver.calibrate()

    def test_by_the_device(self, mvn, sender, crooked):
        data = suit().frame(5, 0.1, crooked.positions, crooked.quats_xyzw)
        sender.send(*data)
        read_frame(mvn)
        mvn.receiver.calibrate()
        sender.send(*suit().frame(6, 0.1, crooked.positions, crooked.quats_xyzw))
        _, frame = read_frame(mvn)
        np.testing.assert_allclose(np.abs(frame.quats_xyzw @ about_z(1.0)), 1.0, atol=1e-6)


class TestRecording:
    """What came, in a file."""

    DATA = [(10.0, b"one"), (10.25, b""), (11.0, b"three" * 1000)]

    @pytest.fixture
    def path(self, tmp_path):
        path = tmp_path / "new" / "some.mvn"
        recording = DatagramRecording(path)
        for now_s, data in self.DATA:
            recording.write(now_s, data)
        recording.close()
        return path

    def test_is_read_as_it_came(self, path):
        assert [tuple(each) for each in read_recording(path)] == [(at - 10.0, data) for at, data in self.DATA]

    def test_is_as_the_documentation_says(self, path):
        assert path.read_bytes().startswith(b"MVN datagrams 1\n" + struct.pack(">dH", 0.0, 3) + b"one")

    def test_truncated_recording_is_read_up_to_its_end(self, path):
        path.write_bytes(path.read_bytes()[:-1])
        assert [data for _, data in read_recording(path)] == [b"one", b""]

    @pytest.mark.parametrize(
        ("content", "words"),
        [
            (b"something else", "is no recording: expected the line 'MVN datagrams 1' first"),
            (MAGIC + struct.pack(">dH", float("nan"), 0), "byte 26: expected a time after 0 s, got nan s"),
            (MAGIC + struct.pack(">dHdH", 1.0, 0, 0.5, 0), "expected a time after 1 s, got 0.5 s"),
            (MAGIC + struct.pack(">dH", 1e9, 0), "got 1e+09 s"),
        ],
        ids=["other file", "nan", "back in time", "years"],
    )
    def test_that_makes_no_sense_is_refused(self, tmp_path, content, words):
        path = tmp_path / "bad.mvn"
        path.write_bytes(content)
        with pytest.raises(InterfaceError) as error:
            list(read_recording(path))
        assert words in str(error.value) and str(path) in str(error.value)

    def test_overwrites_nothing(self, path):
        with pytest.raises(InterfaceError, match="cannot be written: File exists"):
            DatagramRecording(path)

    def test_is_played_faster_and_again(self, path):
        played = timed_datagrams(path, speed=2.0, loop=True)
        times = [next(played)[0] for _ in range(5)]
        assert times == pytest.approx([0.0, 0.125, 0.5, 0.52, 0.645])

    def test_of_nothing_is_not_played_for_ever(self, tmp_path):
        DatagramRecording(tmp_path / "empty.mvn").close()
        with pytest.raises(InterfaceError, match="the recording is empty"):
            next(timed_datagrams(tmp_path / "empty.mvn", loop=True))

    def test_ends_with_the_device(self, mvn, sender, tmp_path):
        path = tmp_path / "walk.mvn"
        mvn.receiver.start_recording(path)
        sender.send(*suit().datagrams(0, 0.0))
        read_frame(mvn)
        mvn.close()
        assert len(list(read_recording(path))) == 1

    def test_of_the_device_plays_the_same_frames(self, mvn, sender, tmp_path):
        path = tmp_path / "walk.mvn"
        mvn.receiver.start_recording(path)
        with pytest.raises(InterfaceError, match="is being recorded already"):
            mvn.receiver.start_recording(path)
        for sample in range(5):
            sender.send(*suit().datagrams(sample, sample / HZ))
            read_frame(mvn)
        sender.send(b"garbage")  # is kept as well: what came is what is played
        for _ in tries("garbage is refused"):
            mvn.read(0.01)
            if mvn.counts["refused: too short"]:
                break
        assert mvn.receiver.stop_recording() == (path, 6)
        with pytest.raises(InterfaceError, match="nothing is being recorded"):
            mvn.receiver.stop_recording()
        mvn.open()
        begin_s = time.monotonic()
        assert send(timed_datagrams(path, speed=0.5), "127.0.0.1", mvn.receiver.port) == 6
        recorded_s = [at for at, _ in read_recording(path)][-1]
        assert time.monotonic() - begin_s >= 2.0 * recorded_s
        frames: list[SegmentFrame] = []
        for _ in tries("all frames come"):
            frames += [event for event in mvn.read(SOON_S).events if isinstance(event, SegmentFrame)]
            if len(frames) >= 5:
                break
        for sample, frame in enumerate(frames):
            assert_same(frame, truth(sample, moves=WALKER))


@pytest.mark.parametrize("mvn", [0.3], indirect=True)
def test_one_person_may_leave_while_another_stays(mvn, sender):
    sender.send(*suit(0).datagrams(150, 2.5))
    read_frame(mvn)
    left = []
    for sample in range(150, 100_000):
        sender.send(*suit(1).datagrams(sample, 2.5))
        reading = mvn.read(SOON_S)
        left += [event for event in reading.events if isinstance(event, Silence)]
        if left:
            break
    assert left == [Silence(0, 0.3)] and not any(reading.axes)
    assert mvn.receiver.people == [1]
