"""Swings a joint by 50 targets a second, with the stamp of sending or without stamps, and records its efforts."""

from __future__ import annotations

import argparse
import json
import math

AMPLITUDE, FREQUENCY_HZ = 0.49, 0.5  # [rad], [Hz]
RAMP_S = 1.0
HZ = 50
JOINT = "lbr_iiwa_joint_2"


def position(time_s: float) -> float:
    """Returns the position [rad] at a time: a swing that grows from rest."""
    share = min(max(time_s / RAMP_S, 0.0), 1.0)
    grown = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    return AMPLITUDE * grown * math.sin(2.0 * math.pi * FREQUENCY_HZ * time_s)


def velocity(time_s: float) -> float:
    """Returns the velocity [rad/s] at a time."""
    step_s = 1e-5
    return (position(time_s + step_s) - position(time_s - step_s)) / (2.0 * step_s)


def main() -> None:
    """Waits for the robot, swings it for a while and prints the efforts [N m]."""
    import rospy
    from sensor_msgs.msg import JointState

    parser = argparse.ArgumentParser()
    parser.add_argument("states", help="topic of the joint states; targets go to TOPIC/target")
    parser.add_argument("seconds", type=float, help="how long to swing")
    parser.add_argument("--no-stamps", action="store_true", help="send targets without stamps")
    arguments = parser.parse_args()
    rospy.init_node("swing", disable_signals=True)
    targets = rospy.Publisher(f"{arguments.states}/target", JointState, queue_size=10, tcp_nodelay=True)
    efforts: list[float] = []

    def note(state: JointState) -> None:
        efforts.append(state.effort[state.name.index(JOINT)])

    rospy.Subscriber(arguments.states, JointState, note, tcp_nodelay=True)
    rate = rospy.Rate(HZ)
    while not targets.get_num_connections():
        rate.sleep()
    for number in range(round(arguments.seconds * HZ)):
        target = JointState(name=[JOINT], position=[position(number / HZ)])
        if not arguments.no_stamps:
            target.header.stamp = rospy.Time.now()
        targets.publish(target)
        rate.sleep()
        if number == round(RAMP_S * HZ):
            efforts.clear()
    print("result: " + json.dumps(efforts))


if __name__ == "__main__":
    main()
