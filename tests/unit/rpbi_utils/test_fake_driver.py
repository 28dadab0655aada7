"""The controller that stands in for a robot's: judged by finite differences that know nothing of it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from custom_ros_tools.errors import ConfigError
from custom_ros_tools.joint_values import JointValues
from rpbi_utils.fake_driver.config import ROBOTS, DriverJointLimits, FakeDriverConfig, NoiseConfig
from rpbi_utils.fake_driver.controller import Mode, RobotController
from rpbi_utils.fake_driver.measurement import Measurement

Array = npt.NDArray[np.float64]

HZ, DT_S = 1000.0, 0.001
PANDA = FakeDriverConfig(robot="panda", limits="panda").load_limits()
LOWER, UPPER, VELOCITY, ACCELERATION, JERK = (
    np.array([getattr(each, key) for each in PANDA.values()])
    for key in ("lower", "upper", "velocity", "acceleration", "jerk")
)
HOME = np.array([0.0, -0.5, 0.0, -2.0, 0.0, 1.5, 0.8])
NO_EFFORT = (0.0,) * 7


def controller(position: Array = HOME, **config: Any) -> RobotController:
    """Returns the controller of a Panda, whose cycle is 1 ms."""
    keys = {"robot": "panda", "limits": "panda", "command_hz": HZ, **config}
    return RobotController(FakeDriverConfig(**keys), PANDA, position)


def smooth(count: int, reach: float, duration_s: float, start: Array = HOME) -> Array:
    """Returns positions of a motion there and back of all joints; shape (count, 7)."""
    t = np.arange(count) * DT_S
    return start + reach * np.sin(np.pi * t / duration_s)[:, None] ** 4 * np.ones(7)


def verdicts(path: Array) -> list[set[str]]:
    """Returns which limits each command breaks: differences of the path, which stood still before it began."""
    before = np.vstack([path[:1]] * 4 + [path[1:]])  # the first one is where it stands
    out = np.diff(before, 1, axis=0, prepend=before[:1])
    broken = {
        "discontinuity": np.abs(np.diff(before, 1, axis=0)) > 3.0 * VELOCITY * DT_S,
        "velocity": np.abs(np.diff(before, 1, axis=0)) / DT_S > VELOCITY,
        "acceleration": np.abs(np.diff(before, 2, axis=0)) / DT_S**2 > ACCELERATION,
        "jerk": np.abs(np.diff(before, 3, axis=0)) / DT_S**3 > JERK,
        "position": ((before < LOWER) & (out < 0.0)) | ((before > UPPER) & (out > 0.0)),
    }
    rows = {check: wrong.any(axis=1)[-len(path) :] for check, wrong in broken.items()}
    return [{check for check in rows if rows[check][i]} for i in range(len(path))]


def run(robot: RobotController, path: Array, start_s: float = 0.0) -> tuple[int | None, list[Any]]:
    """Sends commands, one a cycle; returns at which one the reflex came, and all set points."""
    points, at = [], None
    for i, position in enumerate(path):
        robot.command(start_s + i * DT_S, position)
        if at is None and robot.mode is Mode.REFLEX:
            at = i
        points += [point.position for point in robot.cycle(start_s + i * DT_S, robot.set_point, NO_EFFORT)]
    return at, points


def random_path(draw: np.random.Generator) -> Array:
    """Returns a motion that perhaps has a jump, a kink, noise, or leaves the limits somewhere."""
    path = smooth(120, draw.uniform(-0.3, 0.3), draw.uniform(0.5, 3.0))
    kind, at, joint = draw.integers(6), draw.integers(2, 110), draw.integers(7)
    if kind == 1:
        path[at:, joint] += draw.choice([-1, 1]) * 10.0 ** draw.uniform(-7.0, 0.0)
    elif kind == 2:
        path[at:, joint] += 10.0 ** draw.uniform(-2.0, 1.0) * DT_S * np.arange(120 - at)
    elif kind == 3:
        path += draw.normal(0.0, 10.0 ** draw.uniform(-9.0, -4.0), path.shape)
    elif kind == 4:
        path[:, joint] += UPPER[joint] - path[:, joint].max() + 10.0 ** draw.uniform(-5.0, -2.0) * draw.choice([-1, 1])
    elif kind == 5:
        path[at:, joint] += 0.5 * draw.uniform(1.0, 60.0) * (DT_S * np.arange(120 - at)) ** 2
    return path


def test_first_command_that_breaks_a_limit_stops_the_robot() -> None:
    """500 paths: the oracle and the controller agree on the command, and on a limit that it breaks."""
    draw, seen = np.random.default_rng(14), set()
    for _ in range(500):
        path = random_path(draw)
        broken = verdicts(path)
        robot = controller(path[0])
        at, _ = run(robot, path)
        expected = next((i for i, checks in enumerate(broken) if checks), None)
        assert at == expected
        if at is not None:
            assert robot.reflex is not None and robot.reflex.check in broken[at]
            assert robot.reflex.check == "discontinuity" or "discontinuity" not in broken[at]
            assert abs(robot.reflex.value) > abs(robot.reflex.limit) or robot.reflex.check == "position"
            assert (robot.counters.commands, robot.counters.ignored) == (at, len(path) - at - 1)
        seen.add(robot.reflex.check if robot.reflex else "none")
    assert seen == {"none", "discontinuity", "velocity", "acceleration", "jerk", "position"}


def test_valid_commands_reach_the_motors_unchanged_and_peaks_are_reported() -> None:
    path = smooth(1000, 0.3, 2.0)
    robot = controller(command_delay_s=0.0195)
    at, points = run(robot, path)
    assert at is None and robot.mode is Mode.MOVE
    assert np.array_equal(np.array(points), path[:-20])
    peaks = [np.abs(np.diff(path, n, axis=0)) / DT_S**n for n in (1, 2)]
    told = robot.counters.peaks
    assert told["velocity"] == pytest.approx((peaks[0] / VELOCITY).max())
    assert told["acceleration"] == pytest.approx((peaks[1] / ACCELERATION).max())


def test_reflex_brakes_at_the_limits_and_requires_recovery() -> None:
    path = smooth(702, 0.6, 3.0)
    path[700:, 2] += 1.0
    robot = controller()
    at, points = run(robot, path)
    assert at == 700 and robot.reflex is not None
    assert str(robot.reflex).startswith("discontinuity: panda_joint3: jumps by")
    assert robot.recover(robot.set_point) == "the robot has not come to rest yet"
    speed = (path[699] - path[698]) / DT_S
    while robot.is_braking:
        points += [point.position for point in robot.cycle(len(points) * DT_S, robot.set_point, NO_EFFORT)]
    brake = np.array(points[698:])  # from the last two commands on
    assert np.abs(np.diff(brake, 2, axis=0)).max(axis=0) / DT_S**2 == pytest.approx(ACCELERATION, rel=1e-6)
    way = np.sign(speed) * speed**2 / (2.0 * ACCELERATION)
    assert brake[-1] - path[699] == pytest.approx(way, abs=1e-9)

    assert robot.recover(HOME) is None and robot.mode is Mode.IDLE
    assert robot.recover(HOME) == "there is no reflex to recover from"
    robot.command(10.0, HOME + 0.1)
    assert robot.reflex.check == "start_position", "it began elsewhere than where it stands"
    robot.cycle(10.0, HOME, NO_EFFORT)
    assert robot.recover(HOME) is None
    assert run(robot, smooth(200, 0.1, 2.0), 20.0)[0] is None
    assert (robot.counters.reflexes, robot.counters.recoveries) == (2, 2)


def test_who_is_outside_may_only_come_back() -> None:
    for edge, way in ((UPPER, 0.1), (LOWER, -0.1)):
        outside = HOME.copy()
        outside[5] = edge[5] + way
        back = smooth(100, -0.5 * way, 2.0, outside)
        assert run(controller(outside), back)[0] is None
        at, _ = run(controller(outside), 2.0 * outside - back)
        assert at == 1


def test_commands_in_transit_are_lost_in_a_reflex() -> None:
    robot = controller(command_delay_s=0.01)
    robot.command(0.0, HOME + 0.01)
    robot.refuse_command("a joint is missing")
    assert not robot.cycle(0.001, HOME, NO_EFFORT) and robot.recover(HOME) is None
    assert not robot.cycle(1.0, HOME, NO_EFFORT) and robot.set_point == tuple(HOME)


def test_commands_with_jitter_reach_the_motors_one_per_cycle() -> None:
    robot = controller(command_delay_s=0.01, timeout_s=1.0, rate_tolerance=0.9)
    arrivals_s = 5.0 + np.arange(2000) * DT_S + np.random.default_rng(0).uniform(0.0, DT_S, 2000)
    arrivals_s[1000:] += 0.5  # a pause
    arrivals_s[1500:1520] = arrivals_s[1520]  # a burst
    points = []
    for now_s in arrivals_s:
        robot.command(now_s, HOME)
        points += robot.cycle(now_s, HOME, NO_EFFORT)
    points += robot.cycle(arrivals_s[-1] + 0.01, HOME, NO_EFFORT)
    assert robot.mode is Mode.MOVE and len(points) == 2000
    times_s = np.array([point.time_s for point in points])
    steps = np.delete(np.diff(times_s), 999) / DT_S
    assert np.delete(np.abs(steps - 1.0), slice(1490, 1700)).max() < 0.1
    assert steps.min() >= 0.5
    assert times_s[[0, 1000]] == pytest.approx(arrivals_s[[0, 1000]] + 0.01)
    assert np.abs(times_s - arrivals_s - 0.01)[[900, 1400, 1999]].max() < 2.0 * DT_S


def test_a_burst_after_a_stall_is_played_in_order() -> None:
    robot = controller(timeout_s=1.0, rate_tolerance=0.9)
    arrivals_s = 5.0 + np.arange(3000) * DT_S
    arrivals_s[1000:1500] = arrivals_s[1500]
    points = []
    for now_s in arrivals_s:
        robot.command(now_s, HOME)
        points += robot.cycle(now_s, HOME, NO_EFFORT)
    steps = np.diff([point.time_s for point in points]) / DT_S
    assert len(points) == 3000 and steps.min() > 0.49, "motors that get times out of order jump"
    assert abs(points[-1].time_s - arrivals_s[-1]) < 2.0 * DT_S


def test_motors_at_their_torque_and_joints_left_behind_are_reflexes() -> None:
    for cycles, effort, behind, check in (
        (60, 86.0, 0.19, None),
        (50, -87.0, 0.0, None),
        (51, -87.0, 0.0, "torque"),
        (1, 0.0, 0.21, "following_error"),
    ):
        robot = controller(torque_time_s=0.0495)
        for i in range(cycles):
            robot.command(i * DT_S, HOME)
            robot.cycle(i * DT_S, HOME + np.array([behind, *[0.0] * 6]), (effort, *[0.0] * 6))
        assert (robot.reflex and robot.reflex.check) == check
        assert (robot.reflex and robot.reflex.joint) in (None, "panda_joint1")
    robot = controller()
    for i in range(200):  # a motor that is at its limit now and then
        robot.cycle(i * DT_S, HOME, (87.0 if i % 10 else 0.0, *[0.0] * 6))
        assert robot.reflex is None


def test_commands_may_end_only_at_rest_and_keep_their_rate() -> None:
    there_and_back = smooth(2001, 0.3, 2.0)
    for count, mode in ((2001, Mode.IDLE), (1001, Mode.IDLE), (700, Mode.REFLEX)):
        robot = controller(timeout_s=0.05)
        run(robot, there_and_back[:count])
        robot.cycle(count * DT_S + 0.048, robot.set_point, NO_EFFORT)
        assert robot.mode is Mode.MOVE
        robot.cycle(count * DT_S + 0.052, robot.set_point, NO_EFFORT)
        assert robot.mode is mode
    assert robot.reflex is not None and robot.reflex.check == "command_timeout"
    for share, expected in ((1.0, None), (0.8, None), (1.25, None), (0.6, "command_rate"), (1.5, "command_rate")):
        robot = controller(rate_tolerance=0.3)
        for i in range(2500):
            robot.command(i * DT_S / share, HOME)
        assert (robot.reflex and robot.reflex.check) == expected
        assert robot.reflex is None or robot.reflex.value == pytest.approx(share * HZ, rel=0.01)


@pytest.mark.parametrize("command", [[math.nan, *HOME[1:]], [math.inf, *HOME[1:]], HOME[:6], [], [*HOME, 0.0]])
def test_invalid_command_causes_a_reflex(command: Any) -> None:
    robot = controller()
    robot.command(0.0, HOME)
    robot.command(DT_S, command)
    assert robot.reflex is not None and robot.reflex.check == "command_invalid"
    assert robot.set_point == tuple(HOME)


def test_measurements_are_late_and_noisy_and_the_same_again() -> None:
    config = NoiseConfig(position=0.001, velocity=0.01, effort=0.5, delay_s=0.01, seed=3)
    states = [JointValues.of(("a",), (0.1 * i,), (0.0,), (1.0,)) for i in range(2000)]

    def measured(config: NoiseConfig) -> list[JointValues | None]:
        measurement = Measurement(config)
        return [measurement.observe(0.004 * i, state) for i, state in enumerate(states)]

    first = measured(config)
    assert first == measured(config) and first != measured(config.model_copy(update={"seed": 4}))
    assert first[:3] == [None] * 3 and None not in first[3:]
    noise = np.array([one.position[0] - 0.1 * i for i, one in enumerate(first[3:])])
    assert abs(noise.mean()) < 1e-4 and noise.std() == pytest.approx(0.001, rel=0.1)
    assert np.std([one.effort[0] for one in first[3:]]) == pytest.approx(0.5, rel=0.1)


@pytest.mark.parametrize("robot", ROBOTS)
def test_limits_of_robots_can_be_changed_joint_by_joint(robot: str) -> None:
    limits = FakeDriverConfig(robot=robot, limits=robot).load_limits()
    assert len(limits) == 7 and all(each.torque > 0.0 for each in limits.values())
    first, second = list(limits)[:2]
    changed = FakeDriverConfig(robot=robot, limits=robot, joint_limits={first: {"velocity": 0.5}}).load_limits()
    assert changed[first] == limits[first].model_copy(update={"velocity": 0.5}) and changed[second] == limits[second]


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"limits": "pandas"}, "~config: limits: unknown robot 'pandas'.*did you mean 'panda'"),
        ({"limits": "nowhere.yaml"}, "nowhere.yaml: no such file"),
        ({"joint_limits": {"panda_joint9": {}}}, "~config: joint_limits.panda_joint9: unknown joint"),
        ({"joint_limits": {"panda_joint1": {"velocity": -1.0}}}, "~config.joint_limits: .*velocity: must be > 0"),
        ({"joint_limits": {"panda_joint1": {"upper": -3.0}}}, "joints.panda_joint1.upper: must be above lower"),
        ({"driver": {"joints": [{"joint": "A1"}]}}, r"~config: driver.joints\[0\].joint: unknown joint 'A1'"),
        ({"driver": {"joint_names": ["panda_joint1"]}}, "~config: driver.joint_names: expected all of"),
        ({"command_hz": 0.0}, "command_hz: must be > 0"),
    ],
)
def test_wrong_limits_are_reported_with_file_and_key(changes: dict[str, Any], complaint: str) -> None:
    with pytest.raises(ConfigError, match=complaint):
        FakeDriverConfig.parse({"robot": "panda", "limits": "panda", **changes}, "~config").load_limits()


def test_limits_may_be_a_file(tmp_path) -> None:
    file = tmp_path / "slide.yaml"
    file.write_text("joints: {slide: {lower: 0, upper: 1, velocity: 0.5, acceleration: 1, jerk: 10, torque: 100}}")
    (limits,) = FakeDriverConfig(robot="slide", limits=str(file)).load_limits().values()
    assert limits == DriverJointLimits(lower=0.0, upper=1.0, velocity=0.5, acceleration=1.0, jerk=10.0, torque=100.0)
