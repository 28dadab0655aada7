"""Learning from demonstration without ROS: the scripted person, the learned skill and the report."""

from __future__ import annotations

import json
import math
import resource
from collections import deque

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure
from PIL import Image

from custom_ros_tools.errors import InterfaceError
from rpbi_examples.lfd.person import HALF_SIDE_M, TIP_RADIUS_M, Person
from rpbi_examples.lfd.report import (
    BoxError,
    Run,
    draw_paths,
    draw_pipeline,
    write_picture,
    write_summary,
    write_tables,
)
from rpbi_examples.lfd.skill import PushSkill, ShownPush
from rpbi_examples.motions import PlanarPose

GOAL, START = PlanarPose(-0.15, 0.4, 0.0), (0.0, 0.25)
SPEED, LOOK_S, DELAY = 0.1, 0.02, 4
"""Speed of the tip [m/s], time between two looks [s], and number of looks until a key has an effect."""
CONTACT_M = HALF_SIDE_M + TIP_RADIUS_M


def demonstrated(seed: int, is_stuck: bool = False) -> pd.DataFrame:
    """Returns what a person does in a flat world, where the box moves with the tip, and turns."""
    person = Person(GOAL, SPEED, np.random.default_rng(seed))
    tip, box, yaw, time_s, rows = [0.0, 0.0], list(START), 0.0, 0.0, []
    keys = deque([None] * DELAY)
    while not person.is_done and time_s < 60.0:
        keys.append(person.key(time_s, (tip[0], tip[1]), PlanarPose(box[0], box[1], yaw)))
        key, touches = keys.popleft(), False
        if key is not None and not is_stuck:
            tip[key.axis] += key.sign * SPEED * LOOK_S
            beside = [at - middle for at, middle in zip(tip, box)]
            if touches := max(map(abs, beside)) < CONTACT_M:
                box[key.axis] = tip[key.axis] + key.sign * CONTACT_M
                turns = key.sign * beside[1 - key.axis] * (-1.0 if key.axis == 0 else 1.0)
                yaw += turns / 0.006 * SPEED * LOOK_S
        time_s += LOOK_S
        signal = (0.0, 0.0) if key is None else tuple(SPEED * each for each in key.value)
        rows.append((time_s, *tip, *box, yaw, float(touches), *signal))
    names = ["time", "tip/x", "tip/y", "box/x", "box/y", "box/yaw", "contact", "signal/x", "signal/y"]
    return pd.DataFrame(rows, columns=names).set_index("time")


def shown(table: pd.DataFrame) -> ShownPush:
    touched = table.index[table["contact"] > 0.0]
    return ShownPush(table.index.to_numpy(), table[["tip/x", "tip/y"]].to_numpy(), touched[0] if len(touched) else None)


@pytest.mark.parametrize("seed", range(5))
def test_the_person_pushes_the_box_to_the_goal(seed):
    end = demonstrated(seed).iloc[-1]
    assert math.dist((end["box/x"], end["box/y"]), GOAL[:2]) < 0.02
    assert abs(end["box/yaw"]) < math.radians(8.0)


def test_the_person_gives_up_if_the_tip_does_not_move():
    assert demonstrated(0, is_stuck=True).index[-1] < 30.0


@pytest.mark.parametrize("start", [(0.1, 0.1), (-0.1, -0.1), (0.1, -0.1), (0.0, 0.1)])
def test_a_plan_comes_from_anywhere_and_pushes_as_was_shown(start):
    table = demonstrated(0)
    plan = PushSkill(shown(table)).plan(np.array(start))
    assert plan.places[0] == pytest.approx(start)
    assert plan.places[-1] == pytest.approx(table[["tip/x", "tip/y"]].iloc[-1], abs=3e-3)
    approach = plan.places[plan.times <= plan.push_s]
    assert approach[:, 1].max() < START[1] - CONTACT_M, "the box is not touched on the way"
    push = plan.places[plan.times > plan.push_s]
    path = table[["tip/x", "tip/y"]].to_numpy()
    beside = [np.linalg.norm(path - place, axis=1).min() for place in push]
    assert max(beside) < 4e-3, "it is on the path that was shown"
    before, after = (plan.at(plan.push_s + dt)[0] for dt in (-0.01, 0.01))
    assert np.linalg.norm(after - before) < 0.01, "no jump between the two primitives"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: t.assign(contact=0.0), "the box was not touched"),
        (lambda t: t.assign(**{"tip/x": 0.0, "tip/y": 0.0}), "the tip has not moved"),
        (lambda t: t[t["contact"].cumsum() > 0.0], "the tip was at the box from the start"),
        (lambda t: t.iloc[::150], "expected at least 10 samples"),
    ],
)
def test_unsuitable_demonstrations_are_refused_with_a_reason(change, message):
    with pytest.raises(InterfaceError, match=message):
        PushSkill(shown(change(demonstrated(0))))


def test_a_box_on_its_side_is_not_at_its_goal():
    half = math.sqrt(0.5)
    assert BoxError.of(np.array([0.02, 0.0, 0.0]), np.array([0.0, 0.0, 0.05, 0.998])).is_at_goal
    assert not BoxError.of(np.array([0.025, 0.0, 0.0]), np.array([0.0, 0.0, 0.0, 1.0])).is_good_to_learn
    assert not BoxError.of(np.array([0.02, 0.0, 0.03]), np.array([half, 0.0, 0.0, half])).is_at_goal
    assert not BoxError.of(np.array([0.031, 0.0, 0.0]), np.array([0.0, 0.0, 0.0, -1.0])).is_at_goal


def test_full_disk_leaves_no_partial_table_or_picture(tmp_path, file_limit):
    table, figure = pd.DataFrame({"a": np.random.default_rng(0).random(2_000)}), Figure()
    figure.subplots().plot(table["a"])
    file_limit(5_000)
    for write in (lambda: write_tables(table, tmp_path / "t"), lambda: write_picture(figure, tmp_path / "p.png")):
        with pytest.raises(OSError, match="File too large"):
            write()
    file_limit(resource.RLIM_INFINITY)
    assert list(tmp_path.iterdir()) == []


def test_summary_and_pictures(tmp_path):
    table = demonstrated(0)
    plan = PushSkill(shown(table)).plan(np.array([0.1, -0.1]))
    first, second = Run(0, table, BoxError(0.01, 0.0)), Run(1, table, BoxError(0.2, 1.0), plan)
    path = tmp_path / "summary.json"
    write_summary(path, {"seed": 3}, [first], [second])
    assert [each.name for each in tmp_path.iterdir()] == ["summary.json"]
    summary = json.loads(path.read_text())
    assert summary["at_goal"] is False and summary["seed"] == 3
    assert [each["episode"] for each in summary["demonstrations"] + summary["executions"]] == [0, 1]
    for name, draw in (
        ("paths", lambda figure: draw_paths(figure, GOAL, first, [second])),
        ("pipeline", lambda figure: draw_pipeline(figure, GOAL, first, second)),
    ):
        figure = Figure(figsize=(15.0, 8.4), layout="constrained")
        draw(figure)
        figure.savefig(tmp_path / f"{name}.png", dpi=50)
        with Image.open(tmp_path / f"{name}.png") as picture:
            pixels = np.asarray(picture.convert("RGB")).astype(int)
        assert (pixels[..., 2] - pixels[..., 0] > 80).sum() > 100, "the tip's path is drawn"
