"""`real_robot:=true`: a second simulator is the real robot, with the limits and reflexes of its controller.

That other examples lead one, from their launch files to its joints, is tested with them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import rospy
from node_world import publishing
from real_robot import RealRobot
from ros_system import RosSystem, wait_until
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger

from ros_pybullet_interface.srv import ResetJointState, SetJointState
from rpbi_utils.msg import DriverState
from safe_robot.msg import Status

JOINT = "lwr_arm_0_joint"
SLOW_S = 120.0


@pytest.mark.alone
@pytest.mark.thorough
@pytest.mark.parametrize("example", ["human_interaction", "teleop"])
def test_an_example_leads_a_real_robot(ros: RosSystem, example: str, tmp_path: Path) -> None:
    """From its launch file to the joints of the stand-in."""
    real = RealRobot(ros)
    more = ["device:=scripted", f"output:={tmp_path}"] if example == "human_interaction" else ["device:=joystick"]
    ros.start(["roslaunch", "rpbi_examples", f"{example}.launch", "real_robot:=true", "headless:=true", *more])
    real.wait_until_moved()


def test_real_robot_follows_and_a_jump_stops_it_until_recovery(ros: RosSystem) -> None:
    """The guard smooths what trembles, and refuses what jumps; behind it a jump is a reflex.

    Its driver counts in degrees, names joints A1 to A7, and takes joint states or bare numbers."""
    ros.start(["roslaunch", "rpbi_examples", "run_kuka.launch", "real_robot:=true", "headless:=true"])
    state = ros.listen("/stand_in/driver_state", DriverState)
    target, real = (ros.listen(f"/{name}/joint_states", JointState) for name in ("rpbi/kuka_lwr", "stand_in"))
    shown = ros.listen("/rpbi/real/joint_states/target", JointState)
    checked = ros.listen("/real_robot/joint_states/command", JointState)

    def joint(messages: list[JointState]) -> list[float]:
        return [dict(zip(each.name, each.position))[JOINT] for each in messages]

    def comes(what: str, holds: Callable[[DriverState], bool]) -> DriverState:
        wait_until(lambda: holds(state.messages[-1]), what)
        return next(message for message in reversed(state.messages) if holds(message))

    def stands_at() -> float:
        return math.radians(real.messages[-1].position[0])

    def move(position: float) -> None:
        goal = JointState(name=[JOINT], position=[position])
        assert ros.call("/rpbi/kuka_lwr/move_to_joint_state", ResetJointState, goal, 0.5).success
        wait_until(lambda: abs(stands_at() - position) < 0.005, f"the real robot is at {position} rad")

    def rests_at(position: float) -> None:
        """Waits until the guard lets nothing else pass."""
        wait_until(lambda: np.ptp([position, *joint(checked.messages[-20:])]) < 0.002, f"it rests at {position} rad")

    def put(position: float) -> None:
        goal = JointState(name=[JOINT], position=[position])
        assert ros.call("/rpbi/kuka_lwr/set_joint_state", SetJointState, goal).success

    comes("it follows", lambda message: message.mode == DriverState.MOVE)
    stands, commanded = real.wait_for()[0], target.wait_for()[0]
    assert stands.name == [f"A{i}" for i in range(1, 8)]
    begin = dict(zip(commanded.name, commanded.position))
    assert begin["lwr_arm_3_joint"] == pytest.approx(math.radians(stands.position[3]), abs=0.003)
    move(0.15)
    (last,) = state.messages[-1:]
    assert (last.mode, last.reflexes, last.ignored) == (DriverState.MOVE, 0, 0), last.message
    assert 0.1 < last.peak_velocity < 1.0 and 0.0 < last.peak_acceleration < 1.0

    def is_shown() -> bool:
        last = shown.messages[-1]
        return dict(zip(last.name, last.position))[JOINT] == pytest.approx(0.15, abs=0.005)

    wait_until(is_shown, "it is shown there")

    begin, commanded = len(target.messages), state.messages[-1].commands
    with publishing("/rpbi/kuka_lwr/joint_states/target", JointState) as targets:
        for k in range(40):
            targets.publish(JointState(name=[JOINT], position=[0.15 + 0.02 * (k % 2)]))
            target.wait_for(len(target.messages) + 1)
        targets.publish(JointState(name=[JOINT], position=[0.15]))
    rough = np.diff(joint(target.messages[begin:]), 2) / 0.01**2
    assert np.abs(rough).max() > 10.0, "the driver would not have taken that"
    assert comes("all was followed", lambda message: message.commands > commanded + 45).reflexes == 0

    rests_at(0.15)
    status = ros.listen("/real_robot/robot_safety/status", Status)
    put(-0.6)
    wait_until(lambda: not status.messages[-1].is_safe, "the guard refuses a jump")
    assert status.messages[-1].message.startswith(f"joint_velocity: joint '{JOINT}': velocity is ")
    put(0.15)

    def restarted() -> bool:
        """States from before may still come, and halt it again."""
        ros.call("/real_robot/robot_safety/start_subscriber", Trigger)
        return bool(status.messages[-1].is_safe)

    wait_until(restarted, "the real robot follows again")
    assert state.messages[-1].reflexes == 0

    with publishing("/stand_in/joint_group_position_controller/command", Float64MultiArray) as commands:
        commands.publish(Float64MultiArray(data=[math.degrees(0.4), *real.messages[-1].position[1:]]))
        stopped = comes("it stops", lambda message: message.mode == DriverState.REFLEX and not message.braking)
    assert (stopped.reflex, stopped.joint, stopped.reflexes) == ("discontinuity", "A1", 1)
    assert stopped.value == pytest.approx(0.25, abs=0.005) and stopped.value > stopped.limit > 0.0
    comes("commands are ignored", lambda message: message.ignored > stopped.ignored + 20)

    def lead(position: float) -> None:
        goal = JointState(name=[JOINT], position=[position])
        assert ros.call("/rpbi/kuka_lwr/move_to_joint_state", ResetJointState, goal, 0.5).success
        rests_at(position)

    lead(0.1)
    assert stands_at() == pytest.approx(0.15, abs=0.005), "it stands where it stopped"

    def recover() -> tuple[bool, str]:
        answer = rospy.ServiceProxy("/stand_in/recover", Trigger)()
        return answer.success, answer.message

    assert recover() == (True, "recovered: commands begin where the robot stands")
    again = comes("it refuses to begin elsewhere", lambda message: message.reflex == "start_position")
    assert again.value == pytest.approx(-0.05, abs=0.005)
    lead(0.15)
    assert recover()[0]
    comes("it follows again", lambda message: message.mode == DriverState.MOVE and message.recoveries == 2)
    move(0.0)
    assert state.messages[-1].reflexes == 2
    assert recover() == (False, "there is no reflex to recover from")
