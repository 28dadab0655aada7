"""Lets sources of targets, their messages and the ROS master fail, and looks when the last motion was commanded."""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import json
import math
import multiprocessing
import os
import random
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from multiprocessing.connection import Connection

import rosgraph
import roslib.packages
import rospy
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from safe_robot.msg import Status

HZ = 100
TARGET, COMMAND = "/joint_states/target", "/joint_states/command"
START, STATUS = "/robot_safety/start_subscriber", "/robot_safety/status"
NAMES = ["slide", "turn"]
URDF = """<robot name="slider"><link name="base"/><link name="cart"/><link name="hand"/>
  <joint name="slide" type="prismatic"><parent link="base"/><child link="cart"/><axis xyz="1 0 0"/>
    <limit lower="-1" upper="1" effort="1" velocity="2"/></joint>
  <joint name="turn" type="revolute"><parent link="cart"/><child link="hand"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="1" velocity="3"/></joint>
</robot>"""
PARAMETERS = {"start_from": "target", "period_s": 0.009, "limits": {"acceleration": 20.0, "jerk": 2000.0}}
MESSAGES = {
    "NaN": {"position": (math.nan, 0.0)},
    "infinite": {"position": (0.0, math.inf)},
    "no positions": {"position": ()},
    "missing joint": {"name": NAMES[:1], "position": (0.0,)},
    "unknown joint": {"name": [NAMES[0], "trun"]},
    "efforts": {"effort": (1.0, 1.0)},
}
"""Faults of one message: fields that are wrong."""
FROM_THEN_ON = ("joints swapped", "position jumps", "clock jumps back", "clock jumps ahead", "late input")
"""Faults of all messages from one on."""
ENDS = ("kill -9", "SIGSTOP", "burst, kill -9", "burst, SIGSTOP")
"""Faults of the source's process; a burst is left behind by a source that has hung, and is ahead of its time."""
MASTER = "master killed"
FAULTS = (*MESSAGES, *FROM_THEN_ON, *ENDS, MASTER)
BURST = 10
BEGIN = (0.0, 0.5)
AFTER_S = 0.2
"""How long commands are looked at after a fault; much longer than the guard's watch-dogs take."""


@dataclasses.dataclass(frozen=True)
class Course:
    """What a source does: it swings from where it begins, and has its fault after some targets."""

    fault: str
    begin: tuple[float, float]
    hz: float
    count: int

    def position(self, k: int) -> tuple[float, float]:
        """Returns target k."""
        t = k / HZ
        swing = (1.0 - math.exp(-t)) ** 3 * math.sin(2.0 * math.pi * self.hz * t)
        return self.begin[0] + 0.08 * swing, self.begin[1] - 0.12 * swing


def stream(course: Course, report: Connection) -> None:
    """Publishes targets, from a process of its own, and reports when the fault was [s]."""
    rospy.init_node("source", anonymous=True, disable_signals=True, disable_rosout=True)
    publisher = rospy.Publisher(TARGET, JointState, queue_size=100, tcp_nodelay=True)
    while not publisher.get_num_connections():
        time.sleep(0.01)
    offset_s, begin_s, fault = 0.0, time.monotonic(), course.fault

    def publish(k: int, **fields: object) -> None:
        message = JointState(**{"name": NAMES, "position": course.position(k), **fields})
        message.header.stamp = rospy.Time.from_sec(time.time() + offset_s)
        publisher.publish(message)

    for k in range(100 * HZ):
        time.sleep(max(0.0, begin_s + k / HZ - time.monotonic()))
        fields = {}
        if k == course.count and (fault in ENDS or fault == MASTER):
            for ahead in range(BURST if "burst" in fault else 0):
                publish(k + ahead)
            time.sleep(0.002 if "burst" in fault else 0.0)  # rospy sends from a thread of its own
            report.send(time.monotonic())
            if fault != MASTER:
                os.kill(os.getpid(), signal.SIGKILL if "kill" in fault else signal.SIGSTOP)
        elif k == course.count:
            fields = MESSAGES.get(fault, {})
            offset_s = {"clock jumps back": -1.0, "clock jumps ahead": 1.0, "late input": -0.15}.get(fault, 0.0)
            report.send(time.monotonic())
        if k >= course.count and fault == "joints swapped":
            fields = {"name": NAMES[::-1]}
        if k >= course.count and fault == "position jumps":
            fields = {"position": tuple(value + 0.2 for value in course.position(k))}
        publish(k, **fields)


class Experiment:
    """A master, a guard, and one source after the other.

    Args:
        parameters: Of the guard; None puts a node in its place that lets everything pass.
    """

    def __init__(self, parameters: dict[str, object] | None) -> None:
        self._is_guarded = parameters is not None
        self._processes: list[subprocess.Popen[bytes]] = []
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self._port = probe.getsockname()[1]
        os.environ.update(ROS_MASTER_URI=f"http://127.0.0.1:{self._port}", ROS_IP="127.0.0.1")
        self._fork = multiprocessing.get_context("forkserver")
        self._fork.set_forkserver_preload(["rospy", "sensor_msgs.msg", "std_srvs.srv", "safe_robot.msg"])
        self._master = self._start_master()
        rospy.init_node("judge", disable_signals=True)
        self._motions: list[tuple[float, tuple[float, ...]]] = []
        self._statuses: list[Status] = []
        rospy.Subscriber(COMMAND, JointState, self._take, tcp_nodelay=True)
        rospy.Subscriber(STATUS, Status, self._statuses.append, tcp_nodelay=True)
        if parameters is None:
            commands = rospy.Publisher(COMMAND, JointState, queue_size=100, tcp_nodelay=True)
            rospy.Subscriber(TARGET, JointState, commands.publish, tcp_nodelay=True)
        else:
            rospy.set_param("/robot_description", URDF)
            rospy.set_param("/robot_safety_node", parameters)
            self._start([roslib.packages.find_node("safe_robot", "safe_robot_node.py")[0], "__name:=robot_safety_node"])
            rospy.wait_for_service(START, timeout=60.0)

    def close(self) -> None:
        """Ends all that was started."""
        for process in reversed(self._processes):
            with contextlib.suppress(ProcessLookupError, subprocess.TimeoutExpired):
                process.send_signal(signal.SIGINT)
                process.wait(20.0)
            process.kill()

    def latest_motion_s(self, course: Course) -> float:
        """Returns how long after a fault the last command came that moved the robot [s]; below 0: before it."""
        self._until(self._has_started, "the guard takes targets")
        self._motions.clear()
        ours, theirs = self._fork.Pipe()
        source = self._fork.Process(target=stream, args=(course, theirs), daemon=True)
        source.start()
        try:
            if not ours.poll(60.0):
                raise TimeoutError(f"{course}: the source went through no fault")
            fault_s = ours.recv()
            if course.fault == MASTER:
                fault_s = time.monotonic()
                self._master.kill()
            time.sleep(AFTER_S)
            motions = list(self._motions)
        finally:
            source.kill()
            source.join()
        moved = [b[0] for a, b in zip(motions, motions[1:]) if a[1] != b[1]]
        if course.fault == MASTER:
            self._master = self._start_master()
            if self._is_guarded:
                self._until(lambda: rosgraph.Master("/judge").lookupService(START), "the guard is registered again")
        return max(moved, default=-math.inf) - fault_s  # a slow source may be halted before it moves anything

    @property
    def position(self) -> tuple[float, float]:
        """Where the robot was commanded to last."""
        return tuple(self._motions[-1][1]) if self._motions else BEGIN

    def _said(self) -> str:
        return self._statuses[-1].message if self._statuses else "nothing"

    def _take(self, message: JointState) -> None:
        self._motions.append((time.monotonic(), message.position))

    def _has_started(self) -> bool:
        if not self._is_guarded:
            return True
        answer = rospy.ServiceProxy(START, Trigger)()
        return answer.success or "already" in answer.message

    def _start_master(self) -> subprocess.Popen[bytes]:
        master = self._start(["rosmaster", "--core", "-p", str(self._port)])
        self._until(rosgraph.is_master_online, "the master answers")
        return master

    def _start(self, command: Sequence[str]) -> subprocess.Popen[bytes]:
        self._processes.append(subprocess.Popen(command, stdout=sys.stderr, start_new_session=True))
        return self._processes[-1]

    def _until(self, condition: object, what: str) -> None:
        end_s = time.monotonic() + 60.0
        while time.monotonic() < end_s:
            with contextlib.suppress(OSError, rosgraph.MasterException, rospy.ROSException, rospy.ServiceException):
                if condition():
                    return
            time.sleep(0.05)
        raise TimeoutError(f"it did not come about that {what}")


def courses(faults: Sequence[str], count: int, seed: int) -> Iterator[tuple[str, float, int]]:
    """Returns fault, frequency [Hz] and number of targets before it, of so many courses: each fault in turn."""
    chosen = random.Random(seed)
    order = [faults[k % len(faults)] for k in range(count)]
    chosen.shuffle(order)
    return ((fault, chosen.uniform(0.3, 0.7), chosen.randint(30, 150)) for fault in order)


def main() -> None:
    """Prints as JSON, by fault, how long after each the last motion was commanded [s]."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", type=int)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--faults", nargs="+", default=FAULTS, choices=FAULTS)
    parser.add_argument("--silence", type=float, default=0.02, help="the guard's silence_s")
    parser.add_argument("--unguarded", action="store_true", help="everything passes")
    arguments = parser.parse_args()
    experiment = Experiment(None if arguments.unguarded else {**PARAMETERS, "silence_s": arguments.silence})
    found: dict[str, list[float]] = {}
    try:
        for fault, hz, count in courses(arguments.faults, arguments.count, arguments.seed):
            course = Course(fault, experiment.position, hz, count)
            found.setdefault(fault, []).append(experiment.latest_motion_s(course))
    finally:
        experiment.close()
    print("result:", json.dumps(found))


if __name__ == "__main__":
    main()
