"""Resets a running world again and again, while it is listened to and commanded."""

from __future__ import annotations

import argparse
import json
import statistics
import threading
import time

import rospy
import tf2_ros
from processes import handles, memory_mb, process_of
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

WARM_UP = 20
ROBOT, JOINT = "kuka_lwr", "lwr_arm_1_joint"


def main() -> None:
    """Prints the times and the growth of memory as JSON."""
    parser = argparse.ArgumentParser()
    parser.add_argument("resets", type=int)
    resets = parser.parse_args().resets
    rospy.init_node("reset_often", disable_rostime=True)
    warnings: list[str] = []
    rospy.Subscriber("/rosout", Log, lambda log: warnings.append(log.msg) if log.level > Log.INFO else None)
    buffer = tf2_ros.Buffer()
    listener = tf2_ros.TransformListener(buffer)
    threading.Thread(target=_control, daemon=True).start()
    reset = rospy.ServiceProxy("rpbi/reset", Trigger)
    reset.wait_for_service()
    process_id = process_of("/ros_pybullet_interface")
    _reset(reset, WARM_UP)
    warnings.clear()
    before = memory_mb(process_id), handles(process_id)
    times_s = _reset(reset, resets)
    after = memory_mb(process_id), handles(process_id)
    assert buffer.can_transform("rpbi/world", "rpbi/box", rospy.Time(0)), "TF works"
    found = {
        "median_ms": 1e3 * statistics.median(times_s),
        "slowest_ms": 1e3 * max(times_s),
        "grown_mb": after[0] - before[0],
        "grown_handles": after[1] - before[1],
    }
    print("\n".join(f"warning: {text}" for text in warnings))
    print("result:", json.dumps(found))
    del listener


def _control() -> None:
    target = rospy.Publisher(f"rpbi/{ROBOT}/joint_states/target", JointState, queue_size=10)
    while not rospy.is_shutdown():
        target.publish(JointState(name=[JOINT], position=[0.3]))
        time.sleep(0.01)


def _reset(reset: rospy.ServiceProxy, count: int) -> list[float]:
    times_s = []
    for _ in range(count):
        start_s = time.perf_counter()
        answer = reset()
        times_s.append(time.perf_counter() - start_s)
        assert answer.success, answer.message
        time.sleep(0.02)  # some ticks come in between
    return times_s


if __name__ == "__main__":
    main()
