"""Mistakes in what describes an environment, and a library that is missing."""

from __future__ import annotations

import importlib
import sys

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces

from custom_ros_tools.errors import ConfigError, MissingDependency, UnknownNameError
from rpbi.gym.checks import problems
from rpbi.gym.env import register
from rpbi.gym.randomization import Randomization


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("dynamic: []", "dynamic: unknown key 'dynamic'; did you mean 'dynamics'?"),
        ("dynamics: [{object: box, masss: [1, 2]}]", "dynamics[0].masss: unknown key 'masss'; did you mean 'mass'?"),
        (
            "dynamics: [{object: box, mass: 1}]",
            "dynamics[0].mass: expected a list of 2 numbers [lowest, highest], got 1",
        ),
        ("dynamics: [{object: box, mass: [2, 1]}]", "dynamics[0].mass: expected [lowest, highest], got [2.0, 1.0]"),
        ("delays: {action_s: [-1, 0]}", "delays.action_s[0]: must be >= 0"),
    ],
)
def test_mistakes_are_named_with_file_and_key(tmp_path, given, message):
    file = tmp_path / "random.yaml"
    file.write_text(given)
    with pytest.raises(ConfigError) as caught:
        Randomization.read(str(file))
    assert str(caught.value).startswith(f"{file}: {message}")


def test_values_outside_of_a_space_are_named():
    space = spaces.Dict({"a": spaces.Box(-1.0, 1.0, (2,)), "b": spaces.Discrete(3)})
    good = {"a": np.zeros(2, np.float32), "b": 1}
    assert problems(space, good) == []
    assert problems(space, {**good, "a": np.zeros(2)}) == ["observation['a']: expected float32, got float64"]
    assert problems(space, {**good, "a": np.full(2, 2, np.float32)})[0].startswith("observation['a']: expected numbers")
    assert problems(space, {**good, "b": 3}) == ["observation['b']: expected one of Discrete(3), got 3"]
    assert problems(space, [1]) == ["observation: expected a dict of ['a', 'b'], got list"]


def test_unknown_arguments_are_answered_with_the_known_ones():
    register("rpbi/Mistaken-v0", "world.yaml", "reach")
    known = "known are world, task, randomization, cameras, render_mode"
    message = f"unknown argument of an environment 'randomisation': {known}; did you mean 'randomization'?"
    for make in (
        lambda: gymnasium.make("rpbi/Mistaken-v0", randomisation={}),
        lambda: gymnasium.make_vec("rpbi/Mistaken-v0", num_envs=2, vectorization_mode="sync", randomisation={}),
        lambda: register("rpbi/Other-v0", "world.yaml", "reach", randomisation={}),
    ):
        with pytest.raises(UnknownNameError) as caught:
            make()
        assert str(caught.value) == message
    with pytest.raises(UnknownNameError, match="'wrokers': .*; did you mean 'workers'?"):
        gymnasium.make_vec("rpbi/Mistaken-v0", num_envs=2, wrokers=1)


def test_without_gymnasium_the_extra_is_named(monkeypatch):
    for name in [name for name in sys.modules if name.startswith("rpbi.gym.")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    from rpbi.gym.tasks import TASKS  # names are known without it

    assert "reach" in TASKS and TASKS.summaries()
    with pytest.raises(MissingDependency, match="'gymnasium' is not installed: ./rpbi setup gym"):
        TASKS.find("reach")
    with pytest.raises(MissingDependency, match="'gymnasium' is not installed: ./rpbi setup gym"):
        importlib.import_module("rpbi.gym.env")
