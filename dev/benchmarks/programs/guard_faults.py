"""Lets sources of targets, their messages, ROS time and the ROS master fail, and looks when commands moved last."""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import multiprocessing
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

import rosgraph
import roslib.packages
import rospy
from faulty_source import ENDS, MESSAGES, OTHER_TARGETS, STAMPS, TARGET, Course, stream
from sensor_msgs.msg import JointState
from simulated_clock import SimulatedClock
from std_srvs.srv import Trigger

from custom_ros_tools.ros.lifecycle.timed_master import unused_port

COMMAND, SERVICE = "/joint_states/command", "/robot_safety/{}_subscriber"
URDF = """<robot name="slider"><link name="base"/><link name="cart"/><link name="hand"/>
  <joint name="slide" type="prismatic"><parent link="base"/><child link="cart"/><axis xyz="1 0 0"/>
    <limit lower="-1" upper="1" effort="1" velocity="2"/></joint>
  <joint name="turn" type="revolute"><parent link="cart"/><child link="hand"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="1" velocity="3"/></joint>
</robot>"""
PARAMETERS = {
    "start_from": "target",
    "start_tolerance": 1.0,
    "period_s": 0.009,
    "limits": {"acceleration": 10.0, "jerk": 1000.0},
}
MASTER = "master killed"
CLOCK_JUMPS = ("/clock jumps back", "/clock jumps ahead")
FAULTS = (*MESSAGES, *OTHER_TARGETS, *STAMPS, *ENDS, MASTER)
AFTER_S = 0.4
"""How long commands are looked at after a fault; much longer than the guard's watch-dogs take, and a braking."""
LONGEST_BRAKING = 20
"""So many commands the braking from the fastest of these motions takes at most."""
SLOWER = 5e-5
"""Each command of a braking moves joints at most by so much more than the one before [rad or m]: it may turn round."""


class Outcome(NamedTuple):
    """What was commanded after a fault: when the last motion was that is no braking, and the last of all [s]."""

    followed_s: float
    moved_s: float

    @classmethod
    def of(cls, commands: Sequence[tuple[float, tuple[float, ...]]], fault_s: float, may_brake: bool) -> Outcome:
        """Judges commands: times of a clock [s], and positions; braking is a motion that slows down until rest."""
        times_s = [time_s - fault_s for time_s, _ in commands]
        steps = [[abs(x - y) for x, y in zip(b, a)] for (_, a), (_, b) in zip(commands, commands[1:])]
        moving = [k for k, step in enumerate(steps, start=1) if any(step)]
        if not moving:
            return cls(-math.inf, -math.inf)  # a slow source may be halted before it moves anything
        last = first = moving[-1]
        is_at_rest = time.monotonic() - commands[last][0] > AFTER_S / 4.0
        while may_brake and is_at_rest and times_s[first] > 0.0 and first > max(1, last - LONGEST_BRAKING):
            if not _is_slower(steps[first - 1], steps[first - 2]):
                break
            first -= 1
        return cls(times_s[first], times_s[last])


def _is_slower(step: Sequence[float], before: Sequence[float]) -> bool:
    return all(b <= a + SLOWER for a, b in zip(before, step))


CLOCK: dict[str, Callable[[SimulatedClock], None]] = {
    CLOCK_JUMPS[0]: lambda clock: clock.jump(-1.0),
    CLOCK_JUMPS[1]: lambda clock: clock.jump(1.0),
    "/clock stands still": SimulatedClock.stand_still,
    "/clock begins anew": lambda clock: clock.stand_still(0.0),
}
"""Faults of ROS time, where it is simulated."""
FOLLOWED = {*OTHER_TARGETS, *CLOCK_JUMPS}
"""What the policy `limit` follows: in the end these are targets, as good as others."""


class Experiment:
    """A master, a guard, and one source after the other.

    Args:
        parameters: Of the guard; None puts a node in its place that lets everything pass.
        is_simulated: Whether ROS time is that of `/clock`.
    """

    def __init__(self, parameters: Mapping[str, object] | None, is_simulated: bool) -> None:
        self._is_guarded = parameters is not None
        options = parameters or {}
        self._may_brake = options.get("policy") == "limit" or options.get("on_halt") == "brake"
        self._processes: list[subprocess.Popen[bytes]] = []
        self._port = unused_port()
        os.environ.update(ROS_MASTER_URI=f"http://127.0.0.1:{self._port}", ROS_IP="127.0.0.1")
        self._fork = multiprocessing.get_context("forkserver")
        self._fork.set_forkserver_preload(["rospy", "sensor_msgs.msg", "std_srvs.srv", "safe_robot.msg"])
        self._master = self._start_master()
        rospy.set_param("/use_sim_time", is_simulated)
        rospy.init_node("judge", disable_signals=True)
        self._clock = SimulatedClock() if is_simulated else None
        self._commands: list[tuple[float, tuple[float, ...]]] = []
        rospy.Subscriber(COMMAND, JointState, self._on_message, tcp_nodelay=True)
        if parameters is None:
            commands = rospy.Publisher(COMMAND, JointState, queue_size=100, tcp_nodelay=True)
            rospy.Subscriber(TARGET, JointState, commands.publish, tcp_nodelay=True)
        else:
            rospy.set_param("/robot_description", URDF)
            rospy.set_param("/robot_safety_node", parameters)
            self._start([roslib.packages.find_node("safe_robot", "safe_robot_node.py")[0], "__name:=robot_safety_node"])
            rospy.wait_for_service(SERVICE.format("start"), timeout=60.0)

    def close(self) -> None:
        """Ends all started processes."""
        for process in reversed(self._processes):
            with contextlib.suppress(ProcessLookupError, subprocess.TimeoutExpired):
                process.send_signal(signal.SIGINT)
                process.wait(20.0)
            process.kill()

    def outcome(self, course: Course) -> Outcome:
        """Returns the commands after a fault."""
        self._until(lambda: self._call("stop"), "the guard takes no targets")
        self._until(lambda: self._call("start"), "the guard takes targets")
        self._commands.clear()
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
            elif self._clock and course.fault in CLOCK:
                fault_s = time.monotonic()
                CLOCK[course.fault](self._clock)
            time.sleep(AFTER_S)
            outcome = Outcome.of(list(self._commands), fault_s, self._may_brake)
        finally:
            source.kill()
            source.join()
        if course.fault == MASTER:
            self._master = self._start_master()
            if self._is_guarded:
                lookup = rosgraph.Master("/judge").lookupService
                self._until(lambda: lookup(SERVICE.format("start")), "the guard is registered again")
        if self._clock:
            self._clock.go_on()
        return outcome

    def _on_message(self, message: JointState) -> None:
        self._commands.append((time.monotonic(), message.position))

    def _call(self, verb: str) -> bool:
        if not self._is_guarded:
            return True
        answer = rospy.ServiceProxy(SERVICE.format(verb), Trigger)()
        return answer.success or "already" in answer.message

    def _start_master(self) -> subprocess.Popen[bytes]:
        master = self._start(["rosmaster", "--core", "-p", str(self._port)])
        self._until(rosgraph.is_master_online, "the master answers")
        return master

    def _start(self, command: Sequence[str]) -> subprocess.Popen[bytes]:
        self._processes.append(subprocess.Popen(command, stdout=sys.stderr, start_new_session=True))
        return self._processes[-1]

    def _until(self, condition: Callable[[], object], what: str) -> None:
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
    """Prints as JSON, by fault, for each one the outcome."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", type=int)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--faults", nargs="+", choices=(*FAULTS, *CLOCK), help="by default all that are meant")
    parser.add_argument("--policy", default="reject", help="the guard's")
    parser.add_argument("--on-halt", default="nothing", help="the guard's on_halt")
    parser.add_argument("--silence", type=float, default=0.02, help="the guard's silence_s")
    parser.add_argument("--simulated-time", action="store_true", help="ROS time is that of /clock, which fails")
    parser.add_argument("--unguarded", action="store_true", help="everything passes")
    arguments = parser.parse_args()
    is_rejected = arguments.policy == "reject"
    meant = CLOCK if arguments.simulated_time else FAULTS
    faults = arguments.faults or [each for each in meant if is_rejected or each not in FOLLOWED]
    options = {"policy": arguments.policy, "on_halt": arguments.on_halt, "silence_s": arguments.silence}
    experiment = Experiment(None if arguments.unguarded else {**PARAMETERS, **options}, arguments.simulated_time)
    found: dict[str, list[Outcome]] = {}
    try:
        for fault, hz, count in courses(faults, arguments.count, arguments.seed):
            course = Course(fault, hz, count, is_for_good=not is_rejected)
            found.setdefault(fault, []).append(experiment.outcome(course))
    finally:
        experiment.close()
    print("result:", json.dumps(found))


if __name__ == "__main__":
    main()
