"""Environments in PyBullet's window: Gymnasium's check makes one for each way of rendering."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

CHECK = """
import sys
import warnings
from pathlib import Path
import gym_world
import gymnasium
from gymnasium.utils.env_checker import check_env
from rpbi.gym.env import register

world = gym_world.write(Path(sys.argv[1]), connect={"connection_mode": "DIRECT", "options": "--width=160 --height=120"})
register("test/Swing-v0", world, "gym_world:Swing")
warnings.simplefilter("error")
check_env(gymnasium.make("test/Swing-v0").unwrapped)
env = gymnasium.make("test/Swing-v0", render_mode="human")
env.reset(seed=0)
print(env.step(env.action_space.sample())[1] > 0, env.unwrapped.world.window is not None)
env.close()
"""


@pytest.mark.thorough
def test_it_opens_and_closes(screen, tmp_path):
    command = [sys.executable, "-c", CHECK, str(tmp_path)]
    environment = {**os.environ, **screen.environment, "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "True True"
