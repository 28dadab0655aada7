"""The client of actions: answers that come at once, and goals that are replaced."""

from __future__ import annotations

import actionlib
import pytest
import rospy
from actionlib_msgs.msg import GoalStatus
from control_msgs.msg import FollowJointTrajectoryAction, FollowJointTrajectoryGoal, FollowJointTrajectoryResult
from ros_system import wait_until

from custom_ros_tools.ros.action_client import ActionClient


@pytest.mark.parametrize(("client_class", "is_heard"), [(ActionClient, True), (actionlib.SimpleActionClient, False)])
def test_answer_before_the_handle_is_assigned_counts(ros, monkeypatch, client_class, is_heard):
    def refuse(goal):
        goal.set_rejected(FollowJointTrajectoryResult(error_string="refused"))

    server = actionlib.ActionServer("/refusing", FollowJointTrajectoryAction, refuse, auto_start=False)
    server.start()
    send = actionlib.ActionClient.send_goal

    def send_slowly(*arguments, **callbacks):
        handle = send(*arguments, **callbacks)
        rospy.rostime.wallsleep(0.5)
        return handle

    monkeypatch.setattr(actionlib.ActionClient, "send_goal", send_slowly)
    client = client_class("/refusing", FollowJointTrajectoryAction)
    assert client.wait_for_server(rospy.Duration(30))
    client.send_goal(FollowJointTrajectoryGoal())
    assert client.wait_for_result(rospy.Duration(2)) is is_heard
    if is_heard:
        assert client.get_state() == GoalStatus.REJECTED and client.get_result().error_string == "refused"


def test_only_the_newest_goal_calls_back(ros):
    waiting = []
    held = actionlib.ActionServer("/holding", FollowJointTrajectoryAction, waiting.append, auto_start=False)
    held.start()
    client, ended = ActionClient("/holding", FollowJointTrajectoryAction), []
    assert client.wait_for_server(rospy.Duration(30))
    for name in ("first", "second"):
        client.send_goal(FollowJointTrajectoryGoal(), done_cb=lambda state, _, name=name: ended.append((name, state)))
    wait_until(lambda: len(waiting) == 2, "both goals are there")
    for goal in waiting:
        goal.set_accepted()
        goal.set_succeeded(FollowJointTrajectoryResult())
    wait_until(lambda: ended, "the second goal has ended")
    assert ended == [("second", GoalStatus.SUCCEEDED)]
