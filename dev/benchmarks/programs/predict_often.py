"""Asks the running simulator for predictions again and again; prints how long each took.

Arguments: number of candidates, ticks, duration [s].
"""

import json
import sys
import time

import numpy as np
import rospy

from ros_pybullet_interface.msg import Candidate, PlannedInput
from ros_pybullet_interface.srv import Predict

JOINTS = ["lwr_arm_0_joint", "lwr_arm_1_joint", "lwr_arm_3_joint"]


def main() -> None:
    count, ticks, seconds = int(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3])
    rospy.init_node("predict_often", anonymous=True)
    rospy.wait_for_service("rpbi/predict", 60.0)
    predict, random = rospy.ServiceProxy("rpbi/predict", Predict, persistent=True), np.random.default_rng(0)
    predict(candidates=[Candidate()], ticks=1)  # the first one starts the processes
    print("ready")
    durations, end_s = [], time.monotonic() + seconds
    while time.monotonic() < end_s:
        goals = random.uniform((-0.5, 0.3, -1.8), (0.5, 0.9, -1.0), (count, 3)).tolist()
        begin_s = time.monotonic()
        candidates = [Candidate([PlannedInput(0, "kuka_lwr/target", JOINTS, goal)]) for goal in goals]
        answer = predict(candidates=candidates, ticks=ticks)
        durations.append(time.monotonic() - begin_s)
        assert answer.success and not any(each.fault for each in answer.predictions), answer
    print(f"result: {json.dumps(durations)}")


if __name__ == "__main__":
    main()
