"""`scene_node.py`: runs a scene in the simulator, with one seed after the other."""

from __future__ import annotations

from itertools import count

import numpy as np
import rospy
from pydantic import Field

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.lifecycle.parameters import private_parameters
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.schema import ConfigModel, Count, NonNegative, Switch, Text
from rpbi_examples.scenes import SCENES
from rpbi_examples.scenes.scene import SceneResult, broken_off, run_scene

from .stage import SimulatorStage

NODE = "scene"


class SceneNodeConfig(ConfigModel):
    """Parameters of the node."""

    scene: Text = Field(description="The scene: a name of `SCENES`, or `module:Class`.")
    seed: Count = Field(1, description="Seed of the first episode; each further one adds 1.")
    episodes: Count = Field(0, description="Number of episodes; 0: until it is stopped.")
    noise: Switch = Field(False, description="Whether poses are sensed with noise and delay.")
    real_time_factor: NonNegative = Field(1.0, description="Simulated seconds a second; 0: as fast as possible.")


def _run() -> None:
    config = private_parameters(SceneNodeConfig)
    kind = SCENES.find(config.scene)
    stage = SimulatorStage(kind.watch, kind.cycle_ticks, config.real_time_factor)
    succeeded = 0
    for number, seed in enumerate(count(config.seed), 1):
        scene = kind(np.random.default_rng(seed))
        scene.is_noisy = config.noise
        rospy.loginfo("seed %d", seed)
        stage.begin(scene)
        try:
            result = run_scene(scene, stage)
        except InterfaceError as error:  # the reset for the next episode may remove the cause
            result = broken_off(scene, error)
        succeeded += result.success
        _report(seed, result, stage)
        if number == config.episodes:
            rospy.loginfo("%d of %d episodes succeeded", succeeded, number)
            rospy.signal_shutdown("all episodes are done")
            break


def _report(seed: int, result: SceneResult, stage: SimulatorStage) -> None:
    """Logs in one line how an episode ended."""
    verdict = "succeeded" if result.success else f"failed: {result.reason}" if result.reason else "failed"
    parts = [f"{name}: {value:.4g}" for name, value in result.figures.items()]
    parts += [f"real-time factor: {stage.reached_factor():.3f}", f"state: {stage.state_hash()}"]
    say = rospy.loginfo if result.success else rospy.logwarn
    say("seed %d %s, after %.2f s; %s", seed, verdict, result.time_s, ", ".join(parts))


def main() -> None:
    """Runs the node."""
    run_node(NODE, _run, loggers=("rpbi_examples",))
