"""`real_robot:=true`: a second simulator is the real robot, with the limits and reflexes of its controller."""

from __future__ import annotations

from collections.abc import Callable

import pytest
import rospy
from node_world import publishing
from ros_system import RosSystem, wait_until
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from ros_pybullet_interface.srv import ResetJointState
from rpbi_utils.msg import DriverState

ARM = [f"panda_joint{i}" for i in range(1, 8)]


def test_the_real_robot_follows_the_simulated_one_and_a_jump_stops_it_until_it_is_recovered(ros: RosSystem) -> None:
    example = ["roslaunch", "rpbi_examples", "basic_example_panda.launch", "real_robot:=true", "move:=false"]
    ros.start([*example, "headless:=true"])
    state = ros.listen("/stand_in/driver_state", DriverState)
    target, real = (ros.listen(f"/{name}/joint_states", JointState) for name in ("rpbi/panda", "stand_in"))
    shown = ros.listen("/rpbi/real/joint_states/target", JointState)

    def comes(what: str, holds: Callable[[DriverState], bool]) -> DriverState:
        wait_until(lambda: holds(state.messages[-1]), what)
        return next(message for message in reversed(state.messages) if holds(message))

    def move(position: float) -> None:
        goal = JointState(name=ARM[:1], position=[position])
        assert ros.call("/rpbi/panda/move_to_joint_state", ResetJointState, goal, 0.5).success
        wait_until(lambda: abs(real.messages[-1].position[0] - position) < 0.005, f"the real robot is at {position}")

    comes("it follows", lambda message: message.mode == DriverState.MOVE)
    assert target.messages[0].position[:7] == pytest.approx(real.messages[0].position, abs=0.003)
    move(0.15)
    (last,) = state.messages[-1:]
    assert (last.mode, last.reflexes, last.ignored) == (DriverState.MOVE, 0, 0), last.message
    assert 0.1 < last.peak_velocity < 1.0 and 0.0 < last.peak_acceleration < 1.0
    assert shown.messages[-1].position[0] == pytest.approx(0.15, abs=0.005)
    assert set(ARM) == set(shown.messages[-1].name)

    with publishing("/stand_in/joint_states/command", JointState) as commands:
        commands.publish(JointState(name=ARM, position=[0.4, *real.messages[-1].position[1:]]))
        stopped = comes("it stops", lambda message: message.mode == DriverState.REFLEX and not message.braking)
    assert (stopped.reflex, stopped.joint, stopped.reflexes) == ("discontinuity", "panda_joint1", 1)
    assert stopped.value == pytest.approx(0.25, abs=0.005) and stopped.value > stopped.limit > 0.0
    comes("commands are ignored", lambda message: message.ignored > stopped.ignored + 20)
    goal = JointState(name=ARM[:1], position=[0.1])
    assert ros.call("/rpbi/panda/move_to_joint_state", ResetJointState, goal, 0.5).success
    assert real.messages[-1].position[0] == pytest.approx(0.15, abs=0.005), "it stands where it stopped"

    def recover() -> tuple[bool, str]:
        answer = rospy.ServiceProxy("/stand_in/recover", Trigger)()
        return answer.success, answer.message

    assert recover() == (True, "recovered: commands begin where the robot stands")
    again = comes("it refuses to begin elsewhere", lambda message: message.reflex == "start_position")
    assert again.value == pytest.approx(-0.05, abs=0.005)
    goal.position = [0.15]
    assert ros.call("/rpbi/panda/move_to_joint_state", ResetJointState, goal, 0.5).success
    assert recover()[0]
    comes("it follows again", lambda message: message.mode == DriverState.MOVE and message.recoveries == 2)
    move(0.0)
    assert state.messages[-1].reflexes == 2
    assert recover() == (False, "there is no reflex to recover from")
