"""A page stays small, however long the recording and however many contacts are in it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from rpbi_data.view.page import MAX_BYTES, page_of
from rpbi_data.view.scene import MAX_ARROWS, Arrows, PageScene, Poses, ShownLink

TIMES, CONTACTS = 800, 100


@pytest.fixture(scope="module")
def scene() -> PageScene:
    """A link that tumbles for 32 s, and 100 contacts that differ from time to time."""
    draw = np.random.default_rng(0)
    rotation = Rotation.from_rotvec(draw.normal(size=(TIMES, 3)))
    link = ShownLink("box", "link0", [], Poses(draw.normal(size=(TIMES, 3)), rotation), np.ones(TIMES, bool))
    points, forces = (list(draw.normal(size=(TIMES, CONTACTS, 3))) for _ in range(2))
    times = np.arange(TIMES) / 25.0
    contacts = Arrows("/rpbi/box/contacts", True, points, forces)
    return PageScene(
        "long", 0.0, times, ((1.0, 1.0, 1.0), (0.0, 0.0, 0.0)), [link], arrows=[contacts], notes=["a note"]
    )


def test_arrows_are_bounded_by_fewer_times(scene: PageScene) -> None:
    few = scene.with_few_arrows()
    assert sum(map(len, few.arrows[0].points)) == sum(map(len, few.arrows[0].forces)) == MAX_ARROWS
    assert len(few.times) == len(few.links[0].is_there) == len(few.links[0].poses.rotation) == MAX_ARROWS // CONTACTS
    assert (few.times[0], few.times[-1]) == (scene.times[0], scene.times[-1])
    middle = list(scene.times).index(few.times[100])
    assert np.array_equal(few.arrows[0].points[100], scene.arrows[0].points[middle])
    assert np.array_equal(few.links[0].poses.position[100], scene.links[0].poses.position[middle])
    assert few.with_few_arrows() is few and scene.all_notes == ["a note"]


def test_too_large_page_is_built_with_fewer_times(scene: PageScene) -> None:
    page, shown = page_of(scene)
    assert len(page.encode()) < MAX_BYTES and 10 < len(shown.times) < TIMES
    note, rate = shown.all_notes
    assert note == "a note" and rate.startswith("the view has ") and rate in page


def test_texts_of_others_are_no_html(scene: PageScene) -> None:
    odd = "</title></script><script>x()</script>"
    lines = {odd: {odd: pd.Series([0.0, 1.0], [0.0, 1.0])}}
    few = scene.coarser(10)
    links = [replace(few.links[0], body=odd, name=odd)]
    page, _ = page_of(replace(few, title=odd, notes=[odd], panels=lines, links=links))
    assert odd not in page and page.count("u003c/script>") == 8
