"""Moments of a live view: poses of frames, the last seconds, and that only changes are sent."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import count
from typing import Any

import numpy as np
import pytest
from viewer import Viewer

from robot_model.geometry import Pose
from rpbi.bodies.visual_shapes import BodyShape, ShapeKind
from rpbi_data.view import moment as moments
from rpbi_data.view.live_scene import LiveScene
from rpbi_data.view.moment import (
    HISTORY_S,
    CameraItem,
    History,
    Item,
    LinesItem,
    Moment,
    Placed,
    ShapeItem,
    SurfaceItem,
    TextItem,
    moment_at,
)
from rpbi_data.view.web_server import WebServer

WORLD, RED = "world", (1.0, 0.0, 0.0, 1.0)
ODD = "<img src=x onerror=alert(1)>/../%2F"
AT = Pose((1.0, 0.0, 0.0))


def shape(frame: str, kind: ShapeKind = ShapeKind.BOX) -> ShapeItem:
    return ShapeItem(frame, Pose(), BodyShape(-1, "link", kind, (1.0, 1.0, 1.0), Pose(), RED))  # type: ignore[arg-type]


def surface(height: float, triangles: int = 1) -> SurfaceItem:
    return SurfaceItem(WORLD, Pose(), np.full((3 * triangles, 3), height, np.float32), RED)


def moment(wall_s: float = 0.0, frames: Any = None, **items: Item) -> Moment:
    named = {tuple(name.split("_", 1)): item for name, item in items.items()}
    return Moment(wall_s, wall_s, WORLD, frames or {}, named)  # type: ignore[arg-type]


@pytest.fixture
def server() -> Iterator[WebServer]:
    running = WebServer("127.0.0.1", 0)
    yield running
    running.close()


@pytest.fixture
def viewer(server: WebServer) -> Iterator[Viewer]:
    with Viewer(server.link) as connected:
        yield connected


def test_poses_are_chained_up_to_the_world() -> None:
    frames = {"c": Placed("b", AT), "b": Placed("a", AT), "a": Placed(WORLD, AT), "loose": Placed("none", AT)}
    poses = moment(frames=frames).poses()
    assert poses["c"].position == (3.0, 0.0, 0.0) and "loose" not in poses


def test_circle_of_frames_has_no_pose() -> None:
    assert set(moment(frames={"a": Placed("b", AT), "b": Placed("a", AT)}).poses()) == {WORLD}


def test_history_has_the_last_seconds() -> None:
    history = History()
    for tick in range(0, 2 * int(HISTORY_S)):
        history.add(moment(float(tick)))
    past = history.copy()
    assert (past[0].wall_s, past[-1].wall_s) == (HISTORY_S - 1.0, 2 * HISTORY_S - 1.0)
    assert moment_at(past, 0.0) is past[-1] and moment_at(past, 5.5).wall_s == past[-1].wall_s - 6.0
    assert moment_at(past, 1e6) is past[0]


def test_history_with_large_surfaces_is_shorter(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(moments, "MAX_HISTORY_BYTES", 10 * surface(0.0, 100).nbytes)
    history, same = History(), surface(0.0, 100)
    for tick in range(20):
        history.add(moment(0.1 * tick, body_same=same))
    assert len(history.moments) == 20  # an unchanged surface needs memory once
    for tick in range(20, 40):
        history.add(moment(0.1 * tick, body_soft=surface(tick, 100)))
    assert len(history.moments) == 10


def test_only_changed_poses_are_sent(server: WebServer, viewer: Viewer) -> None:
    scene, names = LiveScene(server.viser), [f"f{number}" for number in range(20)]
    items = {f"body_{name}": shape(name) for name in names}
    still = {name: Placed(WORLD, AT) for name in names}
    scene.show(moment(0.0, still, **items))
    viewer.wait(lambda: viewer.nodes.get("/body/f19", {}).get("position") == [1.0, 0.0, 0.0])
    before = dict(viewer.counts)
    for tick in range(1, 31):
        moved = {**still, "f0": Placed(WORLD, Pose((1.0, 0.01 * tick, 0.0)))}
        scene.show(moment(tick, moved, **items))
        viewer.wait(lambda: viewer.nodes["/body/f0"]["position"][1] == pytest.approx(0.01 * tick))  # noqa: B023
    after = {kind: number - before.get(kind, 0) for kind, number in viewer.counts.items()}
    assert {kind for kind, number in after.items() if number} == {"SetPositionMessage"}
    assert after["SetPositionMessage"] == 30


def test_items_come_change_and_go(server: WebServer, viewer: Viewer) -> None:
    scene = LiveScene(server.viser)
    lines = LinesItem(WORLD, Pose(), np.ones((2, 2, 3), np.float32), RED, 0.01, True)
    first = {
        "box_0": shape(WORLD),
        "soft_surface": surface(0.0),
        "force_arrows": lines,
        "goal_text": TextItem(WORLD, AT, "here"),
        "eye_camera": CameraItem(WORLD, Pose(), 0.7, 1.5),
        "line_0": replace(lines, are_arrows=False),
    }
    scene.show(moment(**first))
    viewer.wait(lambda: {"/box/world/0", "/eye/world/camera", "/goal/world/text"} <= viewer.nodes.keys())
    kinds = {name: node.get("type") for name, node in viewer.nodes.items()}
    assert kinds["/soft/world/surface"] == "MeshMessage" and kinds["/force/world/arrows"] == "ArrowMessage"
    later = {**first, "soft_surface": surface(2.0), "force_arrows": replace(lines, points=3.0 * lines.points)}
    del later["box_0"]
    count_of_meshes = viewer.counts["MeshMessage"]
    scene.show(moment(1.0, **later))
    viewer.wait(lambda: "/box/world/0" not in viewer.nodes and "/box/world" not in viewer.nodes)
    assert viewer.counts["MeshMessage"] == count_of_meshes  # the surface is updated, not drawn anew
    scene.show(
        moment(
            2.0, **{**later, "soft_surface": surface(2.0, 2), "force_arrows": replace(lines, points=lines.points[:0])}
        )
    )
    viewer.wait(lambda: viewer.counts["MeshMessage"] == count_of_meshes + 1)
    viewer.wait(lambda: "/force/world/arrows" not in viewer.nodes)
    scene.show(moment(3.0))
    viewer.wait(lambda: not any(name.startswith("/soft") for name in viewer.nodes))


def test_moved_shape_is_not_drawn_again(server: WebServer, viewer: Viewer) -> None:
    scene, item = LiveScene(server.viser), shape(WORLD)
    scene.show(moment(0.0, box_0=item))
    viewer.wait(lambda: "/box/world/0" in viewer.nodes)
    moved = replace(item, pose=AT, shape=item.shape._replace(pose_in_link=AT))  # type: ignore[arg-type]
    scene.show(moment(1.0, box_0=moved))
    viewer.wait(lambda: viewer.nodes["/box/world/0"].get("position") == [1.0, 0.0, 0.0])
    assert viewer.counts["BoxMessage"] == 1
    scene.show(moment(2.0, box_0=replace(moved, shape=moved.shape._replace(rgba=(0.0, 0.0, 1.0, 1.0)))))
    viewer.wait(lambda: viewer.counts["BoxMessage"] == 2)


def test_item_moves_to_another_frame(server: WebServer, viewer: Viewer) -> None:
    scene = LiveScene(server.viser)
    scene.show(moment(0.0, {"a": Placed(WORLD, AT)}, box_0=shape(WORLD)))
    scene.show(moment(1.0, {"a": Placed(WORLD, AT)}, box_0=shape("a")))
    viewer.wait(lambda: "/box/a/0" in viewer.nodes and "/box/world" not in viewer.nodes)


def test_item_without_a_pose_is_hidden(server: WebServer, viewer: Viewer) -> None:
    scene, item = LiveScene(server.viser), shape("a")
    scene.show(moment(0.0, box_0=item))
    scene.show(moment(1.0, {"a": Placed(WORLD, AT)}, box_0=item))
    viewer.wait(lambda: viewer.nodes.get("/box/a", {}).get("visible"))
    scene.show(moment(2.0, box_0=item))
    viewer.wait(lambda: viewer.nodes["/box/a"]["visible"] is False)


def test_frames_are_shown_and_named_on_request(server: WebServer, viewer: Viewer) -> None:
    scene, frames = LiveScene(server.viser), {f"f{number}": Placed(WORLD, AT) for number in range(3)}
    scene.shows_frames = scene.shows_names = True
    scene.show(moment(0.0, frames))
    viewer.wait(lambda: "/frames" in viewer.nodes and "/names/f2" in viewer.nodes)
    scene.show(moment(1.0, {**frames, "f3": Placed("f0", AT)}))
    viewer.wait(lambda: viewer.nodes.get("/names/f3", {}).get("position") == [2.0, 0.0, 0.0])
    scene.shows_frames = False
    scene.show(moment(2.0, frames))
    viewer.wait(lambda: not {"/frames", "/names/f0"} & viewer.nodes.keys())


def test_odd_names_are_single_parts(server: WebServer, viewer: Viewer) -> None:
    scene = LiveScene(server.viser)
    odd = {(ODD, str(number)): shape(frame) for number, frame in zip(count(), (ODD, "", "a/b", "a\u2215b", "a%2Fb"))}
    scene.show(Moment(0.0, 0.0, WORLD, {ODD: Placed(WORLD, AT)}, odd))
    viewer.wait(lambda: sum(name.count("/") == 3 for name in viewer.nodes) == len(odd))
    scene.show(moment(1.0))
    viewer.wait(lambda: not any("img" in name for name in viewer.nodes))
