"""Files of primitives: what is saved is read again, and what is wrong in one is named; primitives of other packages."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from shown_motions import reach, stir

from custom_ros_tools.errors import ConfigError, UnknownNameError
from motion_primitives import PRIMITIVES, load, make_primitive, save
from motion_primitives.errors import NotLearnedError

SHOWN = {"dmp": [reach(0), reach(1)], "promp": [reach(0), reach(1)], "rhythmic_dmp": [stir()]}


@pytest.mark.parametrize("name", PRIMITIVES)
def test_a_primitive_is_read_as_it_was_saved(name, tmp_path):
    primitive = make_primitive(name, {"alpha": 30.0}).learn(SHOWN[name])
    save(primitive, tmp_path / "it.yaml")
    again = load(tmp_path / "it.yaml")
    assert type(again) is type(primitive) and again.config == primitive.config and again.space == primitive.space
    assert again.learned() == primitive.learned()
    assert again.plan().points == pytest.approx(primitive.plan().points, abs=1e-12)
    assert [path.name for path in tmp_path.iterdir()] == ["it.yaml"]


@pytest.mark.parametrize(
    "change, text",
    [
        (lambda data: data.update(type="dmpp"), "unknown primitive 'dmpp'.* did you mean 'dmp'"),
        (lambda data: data["options"].update(bases=12), "weights: expected 6 signals x 12 bases, got shape"),
        (lambda data: data["options"].update(bass=12), "bass: unknown key 'bass'; did you mean 'bases'"),
        (lambda data: data["learned"].update(duration_s=-1.0), "learned.duration_s: must be > 0"),
        (lambda data: data["learned"].pop("goal"), "learned.goal: missing"),
        (lambda data: data["learned"]["weights"][0].pop(), "weights: expected 6 signals x 30 bases"),
        (lambda data: data["learned"]["weights"][0].__setitem__(0, float("nan")), r"learned.weights\[0\]\[0\]"),
        (lambda data: data["learned"]["start"].__setitem__(6, 9.0), "start: expected a quaternion of length 1"),
        (lambda data: data.update(names=["x"]), "start: expected 5 finite numbers"),
        (lambda data: data.update(more=1), "more: unknown key 'more'"),
    ],
)
def test_faults_in_a_file_are_named(change, text, tmp_path):
    path = tmp_path / "it.yaml"
    save(make_primitive("dmp", {}).learn(SHOWN["dmp"]), path)
    data = yaml.safe_load(path.read_text())
    change(data)
    path.write_text(yaml.safe_dump(data))
    with pytest.raises((ConfigError, UnknownNameError), match=text):
        load(path)


def test_primitive_that_learned_nothing_is_not_saved(tmp_path):
    (tmp_path / "it.yaml").write_text("before")
    with pytest.raises(NotLearnedError):
        save(make_primitive("dmp", {}), tmp_path / "it.yaml")
    assert (tmp_path / "it.yaml").read_text() == "before"


OWN = '''
import numpy as np
from custom_ros_tools.schema import ConfigModel, ListOf
from motion_primitives.dynamics import PathExecution, QuinticPath, SpringDamper
from motion_primitives.primitive import Primitive


class Learned(ConfigModel):
    goal: ListOf[float]


class StraightLine(Primitive):
    """Goes straight to where demonstrations ended."""

    Learned = Learned

    def _learn(self, space, demonstrations):
        self._goal = space.mean([each.points[-1] for each in demonstrations])

    def _begin(self, start, goal, duration_s, via_points, velocity):
        path = QuinticPath(self.space, duration_s, start, self._goal if goal is None else goal, velocity)
        spring, none = SpringDamper(self.config.alpha, duration_s), np.zeros(self.space.dof)
        return PathExecution(self.space, spring, path, lambda time_s: none, self._goal if goal is None else goal)

    def _learned(self):
        return Learned(goal=self._goal.tolist())

    def _restore(self, space, learned):
        self._goal = space.point(learned.goal, "goal")
'''


def test_a_primitive_of_another_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "their_primitives.py").write_text(OWN)
    monkeypatch.syspath_prepend(str(tmp_path))
    primitive = make_primitive("their_primitives:StraightLine", {}).learn(SHOWN["dmp"])
    save(primitive, tmp_path / "it.yaml")
    start = reach().points[0]
    plan = load(tmp_path / "it.yaml").plan(start=start, duration_s=2.0)
    along = (plan.positions - start[:3]) @ (plan.positions[-1] - start[:3])
    beside = np.linalg.norm(plan.positions - start[:3], axis=1) ** 2 - along**2 / along[-1]
    assert beside == pytest.approx(0.0, abs=1e-12)
    sys.modules.pop("their_primitives")
