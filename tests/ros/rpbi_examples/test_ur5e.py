"""`basic_example_ur5e`: the tool reaches its target, a real arm follows, and the guard rejects unsafe targets."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
import rospy
from geometry_msgs.msg import WrenchStamped
from real_robot import RealRobot
from ros_system import RosSystem, wait_until
from sensor_msgs.msg import JointState
from tf2_ros import TransformException

from ik_ros.lookup import make_solver
from ik_ros.problem import IKProblem
from robot_model.geometry import Pose
from ros_pybullet_interface.srv import ResetJointState
from rpbi_utils.msg import DriverState
from safe_robot.msg import Violation

URDF = "{rpbi_examples}/robots/ur5e.urdf"
WORLD, TARGET, TIP, REAL_TIP = "rpbi/world", "rpbi/figure_eight", "rpbi/ur5e/tool_tip", "rpbi/real/tool_tip"
CENTRE = np.array([0.45, 0.13, 0.35])
"""Where the target starts [m]."""
REAL_IS_BESIDE = np.array([0.0, 0.9, 0.0])
HOME = {"shoulder_lift_joint": -1.57, "elbow_joint": 1.57, "wrist_1_joint": -1.57, "wrist_2_joint": -1.57}
LOW = {"shoulder_lift_joint": math.radians(-52.0), "wrist_1_joint": math.radians(-128.0)}
"""Where the tip is some 2.5 cm above the floor, without touching it; the guard keeps it 5 cm above."""
TOOL_N = 0.4 * 9.81


@pytest.mark.parametrize("solver", ["kdl", "pybullet", "trac_ik", "global"])
def test_solvers_reach_a_pose_with_the_tool_down(solver: str) -> None:
    chain = {"urdf_filename": URDF, "base_link": "base_link", "tip_link": "tool_tip"}
    target = Pose(tuple(CENTRE), (0.0, 1.0, 0.0, 0.0))
    solution = make_solver(solver, chain).solve(IKProblem(target=target, start=HOME))
    assert solution.success, solution.message


@pytest.fixture
def position(ros: RosSystem) -> Callable[[str], np.ndarray]:
    buffer = ros.listen_to_tf()

    def position(frame: str) -> np.ndarray:
        """Returns where a frame is in the world [m]; far away while nobody knows."""
        try:
            found = buffer.lookup_transform(WORLD, frame, rospy.Time(0)).transform.translation
        except TransformException:
            return np.full(3, 1e3)
        return np.array([found.x, found.y, found.z])

    return position


def launch(ros: RosSystem, *arguments: str) -> None:
    ros.start(["roslaunch", "rpbi_examples", "basic_example_ur5e.launch", "headless:=true", *arguments])


@pytest.mark.thorough
def test_simulated_and_real_tool_reach_the_target(ros: RosSystem, position) -> None:
    real = RealRobot(ros)
    launch(ros, "real_robot:=true")

    def tracks() -> bool:
        """Tells whether the tip is near the target, and that is on its way."""
        target = position(TARGET)
        return np.linalg.norm(target - CENTRE) > 0.1 and np.linalg.norm(target - position(TIP)) < 0.04

    real.wait_until_moved()
    wait_until(lambda: np.linalg.norm(position(TIP) - CENTRE) < 0.01, "the arm reaches the target")
    wait_until(lambda: np.linalg.norm(position(REAL_TIP) - REAL_IS_BESIDE - CENTRE) < 0.02, "so does the real one")
    wait_until(tracks, "the arm tracks the target")


@pytest.mark.thorough
@pytest.mark.parametrize("guard", [True, False])
def test_guard_keeps_the_real_tool_off_the_floor(ros: RosSystem, position, guard: bool) -> None:
    driver = ros.listen("/stand_in/driver_state", DriverState)
    violations = ros.listen("/real_robot/robot_safety/violation", Violation)
    wrenches = ros.listen("/rpbi/ur5e/force_torque_sensor_mount/ft_sensor", WrenchStamped)
    launch(ros, "real_robot:=true", "move:=false", f"guard:={str(guard).lower()}")
    wait_until(lambda: follows(driver), "the real arm follows")
    force = wrenches.wait_for()[-1].wrench.force
    assert math.hypot(force.x, force.y, force.z) == pytest.approx(TOOL_N, rel=0.1), "the sensor carries the tool"
    goal = JointState(name=list(LOW), position=list(LOW.values()))
    lowered = ros.call("/rpbi/ur5e/move_to_joint_state", ResetJointState, goal, 2.0)
    assert lowered.success and position(TIP)[2] < 0.035, "the simulated tool is where it is too low"
    if not guard:
        wait_until(lambda: position(REAL_TIP)[2] < 0.035, "so is the real one, without a guard")
        return
    (violation, *_) = violations.wait_for()
    assert violation.check in ("link_box", "environment")
    wait_until(lambda: driver.messages[-1].peak_velocity > 0.0 and resting(driver), "the real arm rests")
    assert position(REAL_TIP)[2] > 0.045
    assert driver.messages[-1].reflexes == 0, driver.messages[-1].message


def follows(driver) -> bool:
    """Returns whether the stand-in follows commands; fails with its reflex, after which it never would."""
    state = driver.messages[-1]
    assert state.reflexes == 0, state.message
    return state.mode == DriverState.MOVE


def resting(driver) -> bool:
    """Tells whether no command has come for a while."""
    return len({each.commands for each in driver.messages[-20:]}) == 1
