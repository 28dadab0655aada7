"""Sends problems or joint states at a rate and notes how long it takes until joint targets come back."""

from __future__ import annotations

import argparse
import json
import math
import time

import genpy
import rospy
from geometry_msgs.msg import Point, Pose, Quaternion
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from ik_ros.msg import IKProblem

JOINTS = [f"lwr_arm_{index}_joint" for index in range(7)]
CENTRE = (-0.5, 0.0, 0.4)  # [m], where the tip of the LWR points downwards
RADIUS_M, LAP_S = 0.1, 4.0
HOME, SWING_RAD = (0.0, 0.5, 0.0, -1.2, 0.0, 0.8, 0.0), 0.1
WARM_UP_S = 1.0
ANSWER_S = 0.5
"""How long the last answers may take."""


def problem(header: Header, time_s: float) -> IKProblem:
    """Returns the problem of being where an upright circle leads at a time, as the setup node sends it."""
    angle = 2.0 * math.pi * time_s / LAP_S
    x, y, z = CENTRE
    place = Point(x, y + RADIUS_M * math.sin(angle), z + RADIUS_M * math.cos(angle))
    return IKProblem(header=header, has_target=True, target=Pose(place, Quaternion(1.0, 0.0, 0.0, 0.0)))


def joint_state(header: Header, share: float) -> JointState:
    """Returns a joint state at a share of a way on which the arm swings out of its home and comes to rest there."""
    swing = SWING_RAD * math.sin(math.pi * min(share / 0.95, 1.0)) ** 4
    return JointState(header=header, name=JOINTS, position=[position + swing for position in HOME])


def latencies_s(sent_ns: list[int], arrivals_ns: dict[int, int]) -> list[float]:
    """Returns how long each took [s]; one that was skipped for newer ones took until the first of those was answered.

    Args:
        sent_ns: When they were sent, in order [ns].
        arrivals_ns: When answers came, by the former [ns].
    """
    latencies = []
    arrival_ns = math.inf
    for sent in reversed(sent_ns):
        arrival_ns = min(arrival_ns, arrivals_ns.get(sent, math.inf))
        latencies.append((arrival_ns - sent) * 1e-9)
    return latencies[::-1]


def main() -> None:
    """Prints as JSON which share got an answer, and for each how long it took to its answer or to a newer one [s]."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("topic", help="where they go")
    parser.add_argument("target", help="topic of the joint targets")
    parser.add_argument("hz", type=float)
    parser.add_argument("count", type=int)
    parser.add_argument("--joint-states", action="store_true", help="send joint states, not problems")
    arguments = parser.parse_args()
    rospy.init_node("circle", anonymous=True, disable_signals=True)
    arrivals_ns: dict[int, int] = {}
    to_wall_ns = time.time_ns() - time.monotonic_ns()

    def on_message(message: JointState) -> None:
        arrivals_ns[message.header.stamp.to_nsec() - to_wall_ns] = time.monotonic_ns()

    message_type = JointState if arguments.joint_states else IKProblem
    publisher = rospy.Publisher(arguments.topic, message_type, queue_size=1000, tcp_nodelay=True)  # none is lost
    subscriber = rospy.Subscriber(arguments.target, JointState, on_message, tcp_nodelay=True)
    while not (publisher.get_num_connections() and subscriber.get_num_connections()):
        time.sleep(0.05)
    period_ns = round(1e9 / arguments.hz)
    warm_up = round(WARM_UP_S * arguments.hz)
    sent_ns = []
    start_ns = time.monotonic_ns()
    for tick in range(warm_up + arguments.count):
        left_ns = start_ns + tick * period_ns - time.monotonic_ns()
        if left_ns > 0:
            time.sleep(left_ns * 1e-9)
        sent_ns.append(time.monotonic_ns())
        header = Header(stamp=genpy.Time(*divmod(sent_ns[-1] + to_wall_ns, 1_000_000_000)), frame_id="base")
        if arguments.joint_states:
            publisher.publish(joint_state(header, tick / (warm_up + arguments.count)))
        else:
            publisher.publish(problem(header, tick * period_ns * 1e-9))
    time.sleep(ANSWER_S)
    answered = sum(sent in arrivals_ns for sent in sent_ns[warm_up:]) / arguments.count
    print("result:", json.dumps({"answered": answered, "latencies_s": latencies_s(sent_ns, arrivals_ns)[warm_up:]}))


if __name__ == "__main__":
    main()
