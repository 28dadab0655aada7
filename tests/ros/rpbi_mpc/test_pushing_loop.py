"""The loop of `pushing_mpc_node.py` in this process, beside a simulator: late messages, and a solver that fails."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
import rospy
import yaml
from ros_system import RosSystem, wait_until
from std_srvs.srv import Trigger

from custom_ros_tools.errors import InterfaceError
from robot_model.asset_files import find_file
from rpbi_mpc.msg import MpcStatus
from rpbi_mpc.node_configs import PushingNodeConfig
from rpbi_mpc.pushing.config import ProgramConfig
from rpbi_mpc.pushing.controller import PushingController
from rpbi_mpc.pushing.hand import PlanarHand
from rpbi_mpc.pushing.planner import ProgramPlanner
from rpbi_mpc.pushing.program import PushingProgram
from rpbi_mpc.records import table_of
from rpbi_mpc.ros.listener import SceneListener
from rpbi_mpc.ros.loop_node import LoopNode
from rpbi_mpc.ros.plants import SteppedPlant

LATE_S = 0.6
STARTING, PUSHING = 10, 30
"""Number of cycles until the hand is at the box, and until it has pushed it a little."""


def example(name: str) -> dict:
    return yaml.safe_load(Path(find_file(f"{{rpbi_examples}}/configs/pushing_mpc/{name}.yaml", "test")).read_text())


class PushingLoop:
    """The parts of the node, whose cycles are run by the test."""

    def __init__(self) -> None:
        config = PushingNodeConfig.parse(example("mpc"), "mpc.yaml")
        self.config, self.planner = config.pushing, ProgramPlanner(config.pushing)
        self.plant = SteppedPlant(config.plant, PlanarHand(config.hand))
        self.start_s = self.plant._simulator.time_s
        self.controller = PushingController(config.pushing, self.planner)
        self.node = LoopNode(self.plant, self.controller, config.loop)
        self.loop = self.node._loop

    def table(self, cycles: int):
        for _ in range(cycles):
            self.loop.cycle()
        table = table_of(self.loop.cycles, self.controller)
        table["time_s"] -= self.start_s
        return table.drop(columns=["wall_s", "processor_s"])

    def joints(self) -> np.ndarray:
        return self.plant._listener.joints()


def test_late_messages_change_no_decision_and_solver_failure_stops_motion(ros: RosSystem, monkeypatch) -> None:
    monkeypatch.setattr(rospy, "Service", lambda *_: None)  # those of the node would outlive the test
    ros.simulator({**example("config"), "start_pybullet_after_initialization": False}, use_sim_time=True)
    status = ros.listen("mpc/status", MpcStatus)
    first = PushingLoop()
    at_once = first.table(PUSHING)
    assert ros.call("rpbi/reset", Trigger).success
    take, poses = SceneListener._on_pose, iter(range(10**6))

    def take_late(listener, message):
        time.sleep(LATE_S if next(poses) == 4 * STARTING else 0.0)
        take(listener, message)

    monkeypatch.setattr(SceneListener, "_on_pose", take_late)
    pushing = PushingLoop()
    late = pushing.table(PUSHING)
    assert next(poses) > 4 * STARTING and set(at_once["status"]) == {"waiting", "solved"}
    numbers = at_once.select_dtypes("number").columns
    assert np.allclose(at_once[numbers], late[numbers], rtol=0.0, atol=1e-9, equal_nan=True)

    pushing.planner._program = PushingProgram(pushing.config.slider, ProgramConfig(max_iterations=1))
    pushing.table(7)
    wait_until(lambda: status.messages[-2].status == "stopped", "all cycles have a status")
    failing = status.messages[-7:]
    assert [each.status for each in failing] == ["last plan"] * 5 + ["stopped"] * 2
    assert "did not converge" in failing[0].reason and failing[-1].reason.endswith("; 6 cycles without a new plan")
    stopped = pushing.joints()
    pushing.table(5)
    assert np.allclose(pushing.joints(), stopped, rtol=0.0, atol=1e-3), "the robot stands"
    pushing.node._ends = pushing.node._running = True
    with pytest.raises(InterfaceError, match="the task is not done: .* did not converge"):  # which ends the node with 1
        pushing.node.run()
    for each in (first, pushing):
        each.node._status.unregister()  # other tests of this process would receive its last status
