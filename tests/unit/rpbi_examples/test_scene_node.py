"""The node of scenes, without a master: an error ends an episode alone, and a shutdown is no error."""

from __future__ import annotations

import pytest
import rospy
from writing_scene import Writing

from custom_ros_tools.errors import InterfaceError
from rpbi_examples.scenes import scene_node as node
from rpbi_examples.scenes.scene import Stage
from rpbi_examples.scenes.scene_node import SimulatorStage


class FaultyStage(Stage):
    """Has an error in the first episode, and ends the second one."""

    def __init__(self, *_) -> None:
        self.episodes = 0

    def begin(self, scene):
        self.episodes += 1

    def do(self, change):
        pass

    def cycle(self):
        if self.episodes == 1:
            raise InterfaceError("nothing came on rpbi/kuka_lwr/joint_states\nfor a while")

    def reached_factor(self):
        return 1.0

    def state_hash(self):
        return "0b6"


def test_error_ends_an_episode_as_failed_and_the_next_begins(monkeypatch):
    config = node.SceneNodeConfig(scene="writing_scene:Writing", episodes=2)
    said = []
    monkeypatch.setattr(node, "private_parameters", lambda kind: config)
    monkeypatch.setattr(node, "SimulatorStage", FaultyStage)
    monkeypatch.setattr(Writing, "act", lambda self: iter(()))
    for name in ("loginfo", "logwarn"):
        monkeypatch.setattr(rospy, name, lambda text, *given: said.append(text % given))
    monkeypatch.setattr(node, "end_launch", said.append)
    node._run()
    failed = "seed 1 failed: nothing came on rpbi/kuka_lwr/joint_states for a while, after 0.00 s; "
    assert any(line.startswith(failed) for line in said), said
    assert said[-3].startswith("seed 2 failed, after") and said[-2:] == [
        "0 of 2 episodes succeeded",
        "all episodes are done",
    ]


class Answer:
    """Of a service that the simulator does not do any more."""

    success, message, stamp, tick = False, "the world is closed", rospy.Time(1), 1


@pytest.mark.parametrize("is_shutdown", [True, False])
def test_shutdown_while_waiting_for_the_world_is_no_error(monkeypatch, is_shutdown):
    def wait_for_tick(*_):
        raise TimeoutError("nothing came")

    stage = object.__new__(SimulatorStage)
    stage._ticks, stage._services, stage._listener, stage._scene = 1, {"rpbi/reset": lambda: Answer}, stage, object()
    stage.wait_for_tick, stage._step = wait_for_tick, lambda ticks: Answer
    monkeypatch.setattr(rospy.core, "is_shutdown_requested", lambda: is_shutdown)
    expected = rospy.ROSInterruptException if is_shutdown else InterfaceError
    with pytest.raises(expected):
        stage.cycle()
    with pytest.raises(expected):
        stage._ask("rpbi/reset", None)
