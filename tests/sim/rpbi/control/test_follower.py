"""A simulated robot follows trajectories, within its tolerances and not beyond them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from worlds import FLOOR, box, iiwa, write_world

from custom_ros_tools.errors import ConfigError
from rpbi.control.joint_command import JointCommand
from rpbi.control.timed_motion import TimedMotion
from rpbi.control.trajectories.motion import TrajectoryMotion
from rpbi.control.trajectories.request import ErrorCode, GoalTolerances, TrajectoryRefusedError, TrajectoryRequest
from rpbi.control.trajectories.request import TrajectoryPoint as Point
from rpbi.world import World

ARM = tuple(f"lbr_iiwa_joint_{number}" for number in range(1, 8))
STILL = (0.0,) * 7
STRETCHED = (0.6, -0.5, 0.3, -0.8, 0.4, 0.7, -0.2)


class Arm:
    """A world with an arm, and how tests talk to it."""

    def __init__(self, folder: Path, controller: dict[str, Any] | None = None, **parts: Any) -> None:
        robot = iiwa(joint_trajectory_controller=controller or {}, **parts.pop("robot", {}))
        self.world = World.from_file(write_world(folder, robots=(robot,), **parts))
        self.robot: Any = self.world.bodies["iiwa"]
        self.follower = self.robot.follower

    @property
    def time_s(self) -> float:
        return self.world.clock.time_s

    @property
    def position(self) -> tuple[float, ...]:
        return self.follower.state(self.time_s).position

    def follow(
        self,
        *points: Point,
        names: Sequence[str] = ARM,
        start_in_s: float | None = None,
        tolerances: GoalTolerances | None = GoalTolerances(),  # noqa: B008
        **more: Any,
    ) -> TrajectoryMotion:
        clock = self.world.clock
        stamp_ns = 0 if start_in_s is None else clock.stamp_ns + round(start_in_s * 1e9)
        checked = self.follower.check(TrajectoryRequest(tuple(names), points, stamp_ns), tolerances)
        return self.follower.follow(checked, clock, **more)

    def step(self, seconds: float) -> None:
        for _ in range(round(seconds / self.world.clock.dt_s)):
            self.world.step()

    def worst(self, seconds: float) -> SimpleNamespace:
        """Runs, and returns the largest errors of position [rad] and velocity [rad/s] and the largest speed."""
        position = velocity = speed = 0.0
        for _ in range(round(seconds / self.world.clock.dt_s)):
            self.world.step()
            state = self.follower.state(self.time_s)
            position = max(position, *(abs(a - b) for a, b in zip(state.position, state.desired.position)))
            velocity = max(velocity, *(abs(a - b) for a, b in zip(state.velocity, state.desired.velocity)))
            speed = max(speed, *map(abs, state.velocity))
        return SimpleNamespace(position=position, velocity=velocity, speed=speed)


@pytest.fixture
def arm(tmp_path: Path) -> Arm:
    return Arm(tmp_path)


@pytest.mark.parametrize("mode", ["POSITION_CONTROL", "VELOCITY_CONTROL"])
def test_follows_a_smooth_trajectory_to_a_hair(tmp_path, mode):
    arm = Arm(tmp_path, robot={"setJointMotorControlArray": {"controlMode": mode}})
    motion = arm.follow(Point(1.0, STRETCHED, STILL, STILL), Point(2.0, STILL, STILL, STILL))
    worst = arm.worst(1.999)
    assert worst.position < 1e-4 and worst.velocity < 0.02
    assert not motion.is_over
    arm.step(0.002)
    assert motion.result.result().success and motion.code == ErrorCode.SUCCESSFUL
    assert arm.position == pytest.approx(STILL, abs=1e-4)


def test_line_arrives_with_a_velocity_and_stops_within_goal_time(tmp_path):
    arm = Arm(tmp_path, {"constraints": {"goal_time": 0.2}})
    motion = arm.follow(Point(0.5, STRETCHED), Point(1.0, STILL))
    arm.step(1.2)
    assert motion.result.result().success
    assert arm.position == pytest.approx(STILL, abs=1e-3)
    assert arm.worst(0.5).position < 1e-3


def test_holds_its_goal_when_it_has_ended(arm):
    arm.follow(Point(0.5, STRETCHED, STILL))
    arm.step(1.0)
    assert arm.robot.drive.motion is None
    arm.step(2.0)
    assert arm.position == pytest.approx(STRETCHED, abs=1e-3)


def test_trajectory_begins_at_its_stamp_and_skips_past_points(arm):
    arm.follow(Point(0.5, STRETCHED, STILL), start_in_s=0.5)
    arm.step(0.5)
    assert arm.position == pytest.approx(STILL, abs=1e-4)
    arm.step(0.5)
    assert arm.position == pytest.approx(STRETCHED, abs=1e-3)
    arm.follow(Point(0.1, STRETCHED, STILL), Point(1.0, STILL, STILL), start_in_s=-0.5)
    arm.step(0.5)
    assert arm.position == pytest.approx(STILL, abs=1e-3)


def test_all_points_past_is_refused(arm):
    arm.step(1.0)
    with pytest.raises(TrajectoryRefusedError, match=r"all points are in the past, the last one by 0.4 s") as refused:
        arm.follow(Point(0.1, STRETCHED), start_in_s=-0.5)
    assert refused.value.code == ErrorCode.OLD_HEADER_TIMESTAMP
    assert arm.robot.drive.motion is None


def test_splices_smoothly_and_preempts(arm):
    first = arm.follow(Point(2.0, STRETCHED, STILL))
    arm.step(1.0)
    second = arm.follow(Point(1.0, STILL, STILL), start_in_s=0.5)
    assert first.preempted and not first.result.result().success
    before = arm.follower.state(arm.time_s).velocity
    arm.step(0.4)  # still on the first one
    assert arm.position[0] > 0.35
    worst = arm.worst(1.101)
    assert worst.position < 1e-4 and worst.velocity < 0.02
    assert before[0] > 0.4 and second.result.result().success


def test_leaving_the_path_breaks_it_off_and_stops_the_arm(tmp_path):
    rock = box("rock", (0.2, 0.5, 1.0), basePosition=[0.8, 0.0, 1.0], baseMass=2000.0)
    constraints = {"lbr_iiwa_joint_2": {"trajectory": 0.05}}
    arm = Arm(tmp_path, {"constraints": constraints}, collision=(FLOOR,), dynamic=(rock,))
    motion = arm.follow(Point(3.0, (0.0, 1.2, *STILL[2:]), STILL))
    arm.step(3.5)
    assert not motion.result.result().success and motion.code == ErrorCode.PATH_TOLERANCE_VIOLATED
    assert "'lbr_iiwa_joint_2' is 0.05" in motion.result.result().message
    assert "stop and hold where they are" in motion.result.result().message
    stopped = arm.position
    assert stopped[1] < 1.1
    arm.step(1.0)
    assert arm.position == pytest.approx(stopped, abs=5e-3)


def test_goal_may_be_reached_within_its_time_and_not_later(tmp_path):
    weak = {"setJointMotorControlArray": {"controlMode": "POSITION_CONTROL", "velocityGains": [0.05]}}
    late = {}
    for goal_time in (0.0, 3.0):
        (tmp_path / f"{goal_time}").mkdir()
        keys = {"constraints": {"goal_time": goal_time, **{name: {"goal": 1e-3} for name in ARM}}}
        arm = Arm(tmp_path / f"{goal_time}", keys, robot=weak)
        late[goal_time] = arm.follow(Point(0.2, (0.3,) * 7, STILL))
        arm.step(3.3)
    assert late[0.0].code == ErrorCode.GOAL_TOLERANCE_VIOLATED
    assert "of its goal, 0.001 s after the end" in late[0.0].result.result().message
    assert late[3.0].result.result().success


def test_without_tolerances_nothing_is_looked_at(tmp_path):
    weak = {"setJointMotorControlArray": {"controlMode": "POSITION_CONTROL", "velocityGains": [0.05]}}
    arm = Arm(tmp_path, {"constraints": {name: {"goal": 1e-9, "trajectory": 1e-9} for name in ARM}}, robot=weak)
    motion = arm.follow(Point(0.2, (0.3,) * 7, STILL), tolerances=None)
    arm.step(0.3)
    assert motion.result.result().success


@pytest.mark.parametrize("stop_s", [0.0, 0.3])
def test_cancelling_stops_the_arm_in_the_time_that_is_set(tmp_path, stop_s):
    arm = Arm(tmp_path, {"stop_trajectory_duration": stop_s})
    motion = arm.follow(Point(2.0, STRETCHED, STILL))
    arm.step(1.0)
    at, speed = arm.position[0], arm.follower.state(arm.time_s).velocity[0]
    arm.follower.cancel("enough", arm.world.clock, motion)
    assert motion.preempted and motion.result.result().message == "enough"
    arm.step(stop_s + 0.05)
    assert arm.position[0] - at == pytest.approx(speed * stop_s / 2.0, abs=3e-3)
    assert arm.worst(0.3).speed < 5e-3


def test_cancelling_a_replaced_trajectory_does_nothing(arm):
    first = arm.follow(Point(2.0, STRETCHED, STILL))
    second = arm.follow(Point(0.5, STRETCHED, STILL))
    arm.follower.cancel("late", arm.world.clock, first)
    arm.step(0.6)
    assert second.result.result().success


def test_empty_trajectory_makes_the_arm_hold(arm):
    arm.follow(Point(2.0, STRETCHED, STILL))
    arm.step(1.0)
    held = arm.position
    hold = arm.follow(names=())
    arm.step(0.1)
    assert hold.is_over
    assert arm.position == pytest.approx(held, abs=3e-3)


def test_omitted_joints_continue_their_motion(tmp_path):
    arm = Arm(tmp_path, {"allow_partial_joints_goal": True})
    arm.follow(Point(2.0, (0.5, -0.5), (0.0, 0.0)), names=ARM[:2])
    arm.step(0.5)
    arm.follow(Point(0.5, (0.3,), (0.0,)), names=ARM[1:2])
    arm.step(2.0)
    assert arm.position[:2] == pytest.approx((0.5, 0.3), abs=1e-3)


def test_cancelling_leaves_joints_alone_that_no_trajectory_drives(tmp_path):
    arm = Arm(tmp_path, {"allow_partial_joints_goal": True})
    target = arm.world.inputs["iiwa/target"]
    target.apply(target.check(JointCommand(["lbr_iiwa_joint_7"], [1.5])))
    arm.follow(Point(2.0, (0.5,), (0.0,)), names=ARM[:1])
    arm.step(0.05)
    arm.follower.cancel("enough", arm.world.clock)
    arm.step(2.0)
    assert arm.position[6] == pytest.approx(1.5, abs=1e-3)


def test_only_its_own_joints_are_driven(tmp_path):
    arm = Arm(tmp_path, {"joints": list(ARM[4:])})
    assert arm.follower.joint_names == ARM[4:]
    with pytest.raises(TrajectoryRefusedError, match="unknown joint 'lbr_iiwa_joint_1'"):
        arm.follow(Point(1.0, STILL), names=ARM)
    motion = arm.follow(Point(0.5, (0.2, 0.3, 0.4), (0.0,) * 3), names=ARM[4:])
    arm.step(0.6)
    assert motion.result.result().success


def test_torque_control_refuses_with_a_reason(tmp_path):
    arm = Arm(tmp_path, robot={"setJointMotorControlArray": {"controlMode": "TORQUE_CONTROL"}})
    with pytest.raises(TrajectoryRefusedError, match="TORQUE_CONTROL"):
        arm.follow(Point(1.0, STRETCHED))


def test_paused_world_keeps_the_trajectory_and_aborts_timed_motions(arm):
    motion = arm.follow(Point(1.0, STRETCHED, STILL))
    arm.step(0.5)
    arm.world.pause("the simulation was stopped")
    assert not motion.is_over
    arm.step(0.6)
    assert motion.result.result().success
    timed = TimedMotion(arm.robot.model, {0: 0.0}, 1.0)
    arm.robot.drive.run(timed)
    arm.step(0.1)
    arm.world.pause("the simulation was stopped")
    assert timed.is_over


@pytest.mark.parametrize("end", ["remove", "close"])
def test_goal_is_answered_when_robot_or_world_goes(arm, end):
    motion = arm.follow(Point(1.0, STRETCHED, STILL))
    arm.step(0.2)
    if end == "remove":
        arm.world.remove("iiwa")
    else:
        arm.world.close()
    result = motion.result.result(timeout=0)
    assert not result.success and not motion.preempted
    assert "lbr_iiwa_joint_1=" in result.message


def test_timed_motion_replaces_the_trajectory_and_reports_it(arm):
    motion = arm.follow(Point(1.0, STRETCHED, STILL))
    arm.step(0.2)
    arm.robot.drive.run(TimedMotion(arm.robot.model, {0: 0.0}, 0.5))
    assert "a newer motion replaced it" in motion.result.result(timeout=0).message


def test_feedback_comes_at_its_tick_rate_with_simultaneous_errors(tmp_path):
    arm = Arm(tmp_path, {"action_monitor_rate": 25})
    fed: list[Any] = []
    arm.follow(Point(1.0, STRETCHED, STILL), feedback=fed.append)
    arm.step(1.1)
    times = [state.time_from_start_s for state in fed]
    assert len(times) in (25, 26)
    assert [b - a for a, b in zip(times, times[1:])] == pytest.approx([0.04] * (len(times) - 1), abs=1e-9)
    for state in fed:
        assert state.position == pytest.approx(state.desired.position, abs=1e-4)


def test_same_trajectories_give_the_same_motion_bit_for_bit(tmp_path):
    runs = []
    for number in range(2):
        (tmp_path / str(number)).mkdir()
        arm = Arm(tmp_path / str(number))
        arm.follow(Point(1.0, STRETCHED, STILL))
        arm.step(0.7)
        arm.follow(Point(0.8, STILL, STILL), start_in_s=0.1)
        arm.step(1.0)
        runs.append(arm.follower.state(arm.time_s))
    assert runs[0] == runs[1]


def test_visual_robot_with_a_follower_is_refused(tmp_path):
    with pytest.raises(ConfigError, match="joint_trajectory_controller"):
        Arm(tmp_path, robot={"is_visual_robot": True})


def test_joint_that_the_robot_lacks_is_named(tmp_path):
    with pytest.raises(ConfigError, match=r"joint_trajectory_controller.constraints.elbow: no joint 'elbow'"):
        Arm(tmp_path, {"constraints": {"elbow": {"goal": 0.1}}})
