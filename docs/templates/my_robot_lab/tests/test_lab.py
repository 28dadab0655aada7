"""The lab without ROS: the same world, stepped by the test."""

import pytest
from my_robot_lab.conveyor import Conveyor, ConveyorConfig
from my_robot_lab.range_finder import RangeSample

from custom_ros_tools.errors import ConfigError
from rpbi.world import World

TICKS_A_SECOND = 1000


@pytest.fixture
def world():
    world = World.from_file("{my_robot_lab}/configs/lab.yaml")
    yield world
    world.close()


def run(world, seconds):
    """Returns the samples of some seconds."""
    return [sample for _ in range(int(seconds * TICKS_A_SECOND)) for sample in world.step()]


def test_the_belt_carries_the_parcel_and_stays_itself(world):
    run(world, 1.0)
    before = world.bodies["parcel"].base_pose().position
    run(world, 1.0)
    after = world.bodies["parcel"].base_pose().position
    assert after[0] - before[0] == pytest.approx(0.4, abs=0.01)
    assert world.bodies["belt"].base_pose().position == pytest.approx((0.0, 0.0, 0.45), abs=0.001)


def test_the_belt_takes_another_speed(world):
    run(world, 1.0)
    world.put("belt/speed", 0.0)
    run(world, 1.0)
    assert world.bodies["parcel"].base_twist().linear == pytest.approx((0.0, 0.0, 0.0), abs=1e-3)
    with pytest.raises(ValueError, match="speed must be within"):
        world.put("belt/speed", float("nan"))


def test_the_range_finder_sees_the_parcel_pass(world):
    ranges = [each.distance for each in run(world, 4.0) if isinstance(each, RangeSample)]
    assert len(ranges) == 4 * 50
    assert ranges[0] is None
    seen = [distance for distance in ranges if distance is not None]
    assert seen and seen[0] == pytest.approx(0.15, abs=0.005)  # from the edge of the belt to the side of the parcel


def test_yaml_mistake_is_reported():
    with pytest.raises(ConfigError, match=r"belt.yaml: sped: unknown key 'sped'; did you mean 'speed'"):
        ConveyorConfig.parse({"name": "belt", "size": [1, 1, 1], "position": [0, 0, 0], "sped": 1}, "belt.yaml")


def test_a_belt_can_come_and_go_at_run_time(world):
    config = Conveyor.Config.parse({"name": "second", "size": [1, 1, 0.1], "position": [0, 3, 1]}, "second.yaml")
    world.add("my_robot_lab.conveyor:Conveyor", config)
    run(world, 0.1)
    world.remove("second")
    assert "second" not in world.bodies
