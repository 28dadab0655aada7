"""A force-torque sensor whose samples come too slowly: the service that zeroes it ends with a reason."""

from __future__ import annotations

import threading

import pytest
from worlds import iiwa, write_world

from custom_ros_tools.errors import InterfaceError
from rpbi.ros.publishers.sample_publishers import SamplePublishers
from rpbi.ros.requests import Requests
from rpbi.ros.services import body_endpoints
from rpbi.ros.services.body_context import BodyContext
from rpbi.ros.simulation import Simulation
from rpbi.world import World

JOINT = "lbr_iiwa_joint_7"


@pytest.fixture
def zeroing(ros, tmp_path):
    """The loop of a running world; its sensor has a sample every 100 s."""
    sensor = {"joint": JOINT, "hz": 0.01}
    robot = iiwa(enabled_joint_force_torque_sensors=[sensor])
    world = World.from_file(write_world(tmp_path, robots=(robot,)))
    simulation = Simulation(world, SamplePublishers(world), [])
    simulation.start()
    over = threading.Event()
    thread = threading.Thread(target=simulation.run, args=(over.is_set,))
    thread.start()
    yield BodyContext("iiwa", f"iiwa/{JOINT}", simulation, Requests(simulation))
    over.set()
    thread.join()
    world.close()


def test_zeroing_that_takes_too_long_is_given_up_and_can_be_asked_for_again(zeroing, monkeypatch):
    (sensor,) = zeroing.body.force_torque_sensors
    monkeypatch.setattr(body_endpoints, "LONGEST_ZEROING_S", 0.1)
    with pytest.raises(InterfaceError, match="not 100 samples within 0.1 s: .* 0.01 Hz .*old zero stays"):
        body_endpoints.zero_force_torque(zeroing, None)
    assert sensor._zeroing is None
    monkeypatch.undo()
    zeroing.ask(lambda: zeroing.world.set_sensor_rate("iiwa", zeroing.world.sensors_of("iiwa").index(sensor), 1000.0))
    body_endpoints.zero_force_torque(zeroing, None)
