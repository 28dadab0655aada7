"""What `rpbi/state` and the hash service tell."""

from __future__ import annotations

import pytest
from node_world import main_config
from ros_system import wait_until
from std_srvs.srv import Trigger
from worlds import FLOOR, ball, iiwa

from ros_pybullet_interface.msg import SimulationState
from ros_pybullet_interface.srv import GetStateHash, StepN


@pytest.fixture
def start(ros, tmp_path):
    def open_world(**main):
        dynamic = (ball(basePosition=[1.0, 0.0, 1.0]),)
        config = main_config(tmp_path, collision=(FLOOR,), dynamic=dynamic, robots=(iiwa(),), **main)
        ros.simulator(config, use_sim_time=True)
        return ros.listen("/rpbi/state", SimulationState)

    return open_world


@pytest.mark.quick
def test_state_reports_tick_and_speed(ros, start):
    states = start(real_time_factor=0.5)
    state = wait_until(lambda: _at_half_pace(states), "it goes at the pace that is asked for")
    assert state.running and not state.stepping
    assert state.real_time_factor_asked == 0.5
    assert state.simulated_time == pytest.approx(state.tick * 0.001)
    assert state.header.stamp.to_nsec() == (state.tick + 1) * 1_000_000
    ros.call("/rpbi/stop", Trigger)
    state = wait_until(lambda: [each for each in states.messages if not each.running], "it tells of the stop")[-1]
    assert state.real_time_factor == 0.0


def test_hashes_come_at_their_ticks_and_equal_those_of_services(ros, start):
    states = start(start_pybullet_after_initialization=False, state_hash_hz=100.0)
    states.wait_for(1)
    service = [ros.call("/rpbi/step_n", StepN, 10) and ros.call("/rpbi/get_state_hash", GetStateHash) for _ in range(5)]
    hashed = wait_until(lambda: len(_hashed(states)) >= 5 and _hashed(states), "the hashes come")
    assert hashed == {answer.tick: answer.state_hash for answer in service}
    assert sorted(hashed) == [10, 20, 30, 40, 50]
    assert len(set(hashed.values())) == 5


def test_world_with_hash_rate_zero_publishes_no_hash(ros, start):
    states = start(start_pybullet_after_initialization=False, state_hash_hz=0, state_hz=50.0)
    ros.call("/rpbi/step_n", StepN, 1500)
    states.wait_for(20)
    assert _hashed(states) == {}
    assert ros.call("/rpbi/get_state_hash", GetStateHash).state_hash


def test_it_can_be_switched_off(ros, start):
    states = start(state_hz=0, state_hash_hz=10.0)
    states.wait_for(5)
    assert all(message.state_hash for message in states.messages)


def _at_half_pace(states):
    """Returns a message from a second of that pace; what a busy machine is late for is caught up with in the next."""
    return next((each for each in list(states.messages) if 0.4 < each.real_time_factor < 0.6), None)


def _hashed(states):
    return {message.tick: message.state_hash for message in list(states.messages) if message.state_hash}
