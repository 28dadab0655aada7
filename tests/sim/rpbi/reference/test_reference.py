"""The schemas and pages that are written from the code are those of the code."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pybullet
import pytest
from worlds import iiwa, write_world

from custom_ros_tools.console.docs import files
from custom_ros_tools.errors import ConfigError
from rpbi.bodies import BODY_TYPES
from rpbi.reference.config_texts import BEGINNINGS, OVERVIEW
from rpbi.reference.markdown import link
from rpbi.reference.reference_world import FOLLOWED, reference_world
from rpbi.ros.headers import FRAMES
from rpbi.ros.interface_table import FOLLOWS, endpoints
from rpbi.samples import LinkPoseSample
from rpbi.world import World

ROOT = Path(__file__).resolve().parents[4]
PAGES = (OVERVIEW, *BEGINNINGS, "topics_and_services.md")


@pytest.fixture(scope="module")
def world() -> Iterator[World]:
    """A world with one body of each type."""
    world = reference_world()
    yield world
    world.close()


def test_schemas_and_pages_are_fresh() -> None:
    written = files(ROOT)
    stale = [path for path, text in written.items() if not path.exists() or path.read_text() != text]
    assert [str(path.relative_to(ROOT)) for path in stale] == [], "not what the code says: run ./rpbi docs"
    generated = [*ROOT.glob("src/*/schema/*"), *ROOT.glob("docs/config_*.md")]
    left_over = [path for path in generated if path not in written]
    assert left_over == [], "nothing writes these any more"


def test_reference_world_has_a_body_named_after_each_type(world: World) -> None:
    assert {name: type(body) for name, body in world.bodies.items()} == dict(BODY_TYPES)


def test_all_that_the_page_lists_is_explained(world: World) -> None:
    for row in endpoints(world):
        if row.kind == FOLLOWS:
            assert row.name == FOLLOWED
        else:
            assert row.meaning.endswith("."), row


@pytest.mark.parametrize("name", ["joint_trajectory_controller", "joint_states"])
def test_controller_named_like_a_topic_of_its_robot_is_refused(tmp_path: Path, name: str) -> None:
    controllers = {name: {"type": "joint_impedance", "active": False}}
    robot = iiwa(joint_trajectory_controller={}, controllers=controllers)
    world = World.from_file(write_world(tmp_path, robots=(robot,)), connection_mode=pybullet.DIRECT)
    with pytest.raises(
        ConfigError, match=rf"world.yaml: the node \w+ rpbi/iiwa/{name}/\w+ (as \S+ and|twice) as \S+: give"
    ):
        endpoints(world)
    world.close()


def test_all_frames_of_the_world_are_in_the_table(world: World) -> None:
    patterns = [re.sub("NAME|LINK", r"\\w+", name) for name in FRAMES]
    samples = [sample for sample in (*world.step(), *world.read_rest()) if isinstance(sample, LinkPoseSample)]
    assert len(samples) == 5
    for sample in samples:
        for frame in sample.frames:
            assert any(re.fullmatch(pattern, frame) for pattern in patterns), frame


@pytest.mark.parametrize("page", PAGES)
def test_links_of_the_pages_lead_somewhere(page: str) -> None:
    for target in re.findall(r"\]\(([^)]+)\)", (ROOT / "docs" / page).read_text()):
        name, _, anchor = target.partition("#")
        text = (ROOT / "docs" / (name or page)).read_text()
        anchors = {link(heading).split("#")[-1].rstrip(")") for heading in re.findall(r"^#+ (.*)$", text, re.MULTILINE)}
        assert not anchor or anchor in anchors, target


@pytest.mark.parametrize("page", PAGES)
def test_headings_of_the_pages_differ(page: str) -> None:
    """Links to one of two equal headings would lead to the first."""
    text = re.sub(r"```.*?```", "", (ROOT / "docs" / page).read_text(), flags=re.DOTALL)
    headings = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    assert len(set(map(str.lower, headings))) == len(headings)
