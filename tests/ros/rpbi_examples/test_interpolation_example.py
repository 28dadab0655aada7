"""The example of interpolation, as a user launches it: the tip is at the balls at their times, and then elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from node_world import Rosout, publishing
from PIL import Image
from ros_system import RosSystem, wait_until
from std_msgs.msg import Float64MultiArray
from tf2_msgs.msg import TFMessage

from rpbi_examples.ros.run_interpolation import TARGET, VISITS, as_message

pytestmark = pytest.mark.thorough

TIP = "rpbi/kuka_lwr/end_effector_ball"
WAYPOINTS = "/kuka_lwr/ros_pybullet_interface/end_effector/waypt_traj"
NEAR_M = 0.01
LATE_S = 0.5
"""Largest time by which a busy machine may have the tip pass a ball late [s], while targets that stalled are played."""
SLOW_S = 180.0
FACTOR = 2.0
LONG_S = 40.0
"""Duration of a motion that is replaced before its end, on a busy machine too [s]."""


class Paths:
    """Where target and tip were, by the stamps of TF; the arm's foot is at the world's origin."""

    def __init__(self, system: RosSystem) -> None:
        self._tf = system.listen("/tf", TFMessage)

    def of(self, frame: str) -> tuple[np.ndarray, np.ndarray]:
        """Returns stamps [s], shape (N,), and positions [m], shape (N, 3)."""
        found = [one for each in list(self._tf.messages) for one in each.transforms if one.child_frame_id == frame]
        places = [one.transform.translation for one in found]
        return np.array([one.header.stamp.to_sec() for one in found]), np.array([(p.x, p.y, p.z) for p in places])

    def at(self, frame: str, time_s: float) -> np.ndarray:
        """Returns where a frame was at a time [s]."""
        stamps, places = self.of(frame)
        return np.array([np.interp(time_s, stamps, axis) for axis in places.T])

    def distance(self, frame: str, place: Sequence[float], time_s: float) -> float:
        """Returns how near a frame was to a place [m] at a time [s] or a little later."""
        stamps, places = self.of(frame)
        is_meant = (stamps > time_s - 0.02) & (stamps < time_s + LATE_S)
        return float(np.linalg.norm(places[is_meant] - place, axis=1).min())

    def wait_until_at(self, time_s: float) -> None:
        """Waits for a time [s] of the world."""
        wait_until(lambda: self.of(TIP)[0][-1] > time_s, f"the tip is seen at {time_s:.3f} s", SLOW_S)


@pytest.fixture(scope="module")
def example(ros_master, tmp_path_factory):
    """The example, its paths, and what it logs, after its motion."""
    system = RosSystem(tmp_path_factory.mktemp("interpolation"))
    try:
        rosout, paths = Rosout(system), Paths(system)
        picture = system.folder / "motion.png"
        arguments = [f"plot:={picture}", "headless:=true", f"real_time_factor:={FACTOR}"]
        system.start(["roslaunch", "rpbi_examples", "interpolation.launch", *arguments])
        wait_until(picture.exists, "the motion is over, and drawn", SLOW_S)
        yield system, paths, rosout, picture
    finally:
        system.close()


def test_the_tip_is_at_the_balls_at_their_times(example):
    _, paths, rosout, _ = example
    start_s = paths.of(TARGET)[0][0]
    for visit in VISITS:
        assert paths.at(TARGET, start_s + visit.time_s) == pytest.approx(visit.position, abs=5e-4)
        assert paths.distance(TIP, visit.position, start_s + visit.time_s) < NEAR_M
        assert rosout.logs(f"{visit.colour} at {visit.time_s:g}"), "its log reports it"
    away = [np.linalg.norm(paths.at(TIP, start_s + each.time_s - 1.5) - each.position) for each in VISITS]
    assert min(away) > 3.0 * NEAR_M, "it is not there all the time"


def test_samples_are_100_per_simulated_second_at_any_speed(example):
    stamps, _ = example[1].of(TARGET)
    steps = np.diff(stamps[stamps < stamps[0] + 14.0]) / 0.01
    assert steps == pytest.approx(np.round(steps), abs=1e-4), (
        "a busy machine leaves samples out, the others are in time"
    )
    assert np.median(steps) <= 2


def test_the_picture_shows_three_plots(example: tuple[RosSystem, Paths, Rosout, Path]):
    picture = np.asarray(Image.open(example[3]).convert("RGB")).astype(int)
    blue = np.flatnonzero((picture[..., 2] - picture[..., 0] > 80).any(axis=0))
    thirds = np.histogram(blue, bins=3, range=(0, picture.shape[1]))[0]
    assert thirds.min() > 50


def test_new_waypoints_continue_and_replace_the_current_motion(example):
    """A second motion, wrong waypoints in the middle of it, and a third motion that replaces the rest of it."""
    _, paths, rosout, _ = example
    here = np.array(VISITS[-1].position)
    there, other = here + (-0.2, -0.2, 0.1), here + (-0.1, -0.1, 0.25)
    quat = np.tile([[1.0], [0.0], [0.0], [0.0]], 2)

    def rows(end: np.ndarray, times_s: tuple[float, float] = (0.0, LONG_S)) -> np.ndarray:
        return np.vstack([times_s, np.array([here, end]).T, quat])

    before = len(paths.of(TARGET)[0])
    with publishing(WAYPOINTS, Float64MultiArray) as waypoints:
        waypoints.publish(as_message(rows(there)))
        wait_until(lambda: len(paths.of(TARGET)[0]) > before + 100, "the second motion has begun", SLOW_S)
        broken = as_message(rows(there, (LONG_S, 0.0)))
        broken.layout.dim[0].label = "row"
        waypoints.publish(broken)
        waypoints.publish(as_message(rows(other, (0.0, np.nan))))
        rosout.wait_for([f"{WAYPOINTS}: waypoints rejected: layout.dim[0].label: expected 'rows', got 'row'"])
        waypoints.publish(as_message(rows(other, (0.0, 3.0))))
        wait_until(lambda: np.linalg.norm(paths.of(TARGET)[1][-1] - other) < 1e-9, "the third motion has ended", SLOW_S)
        end_s = paths.of(TARGET)[0][-1]
        paths.wait_until_at(end_s + 0.5)
    assert paths.at(TIP, end_s + 0.4) == pytest.approx(other, abs=NEAR_M)
    stamps, places = (each[before:] for each in paths.of(TARGET))
    speeds = np.diff(places, axis=0) / np.diff(stamps)[:, np.newaxis]
    assert np.abs(np.diff(speeds, axis=0)).max() < 0.02, "no jump of the velocity, in 0.01 s"
    assert np.linalg.norm(places - there, axis=1).min() > 0.05, "the second end is never reached"
