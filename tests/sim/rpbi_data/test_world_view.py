"""A script shows its world in the browser while it steps it."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from soft_meshes import DEFORMABLE, block
from viewer import Viewer
from worlds import FLOOR, box, iiwa, write_world

from custom_ros_tools.errors import InterfaceError
from robot_model.geometry import Pose
from rpbi.world import World

EYE = {"name": "eye", "intrinsics": {"width": 64, "height": 48, "fov": 50.0, "range": [0.1, 10.0]}}


class Script:
    """Steps a world in the thread that made it, as a script does, until it is closed."""

    def __init__(self, folder: Path, **parts: Any) -> None:
        self.world: World
        self.view: Any = None
        self.error: BaseException | None = None
        self._ended, self._is_ready = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, args=(write_world(folder, **parts),))
        self._thread.start()
        self._is_ready.wait()

    def _run(self, file: str) -> None:
        try:
            self.world = World.from_file(file)
            self.view = self.world.view()
            self._is_ready.set()
            while not self._ended.wait(0.0005):
                self.world.step()
            self.world.close()
        except BaseException as error:
            self.error = error
            self._is_ready.set()

    def close(self) -> None:
        self._ended.set()
        self.view._controls._is_stopped = False
        self._thread.join()
        assert self.error is None


@pytest.fixture
def script(tmp_path: Path) -> Iterator[Script]:
    parts: dict[str, Any] = {"collision": (FLOOR,), "dynamic": (box("box", contacts={}),), "robots": (iiwa(),)}
    camera = {**EYE, "object_tf": {"tf_id": "rpbi/eye"}}
    running = Script(tmp_path, **parts, timeStep=0.004, rgbd_sensor=camera)
    yield running
    running.close()


@pytest.fixture
def viewer(script: Script) -> Iterator[Viewer]:
    with Viewer(script.view.link) as connected:
        connected.wait(lambda: has(connected, "/iiwa/"))
        yield connected


def has(viewer: Viewer, start: str) -> bool:
    return any(name.startswith(start) for name in list(viewer.nodes))


def test_bodies_contacts_and_cameras_are_shown(viewer: Viewer, script: Script) -> None:
    viewer.wait(lambda: has(viewer, "/box/rpbi∕world/contacts") and has(viewer, "/camera/camera∕eye/eye"))
    script.world.put("eye/pose", Pose((0.0, 0.0, 2.0), (1.0, 0.0, 0.0, 0.0)))
    viewer.set("Image", "eye")
    viewer.wait(lambda: viewer.nodes["/camera/camera∕eye/eye"].get("_image_data"))


def test_script_waits_steps_and_continues(viewer: Viewer, script: Script) -> None:
    viewer.press("Stop")
    viewer.wait_for_note("Stop")
    viewer.wait(lambda: str(viewer.value("World")).startswith("stopped"))
    tick = script.world.clock.tick
    viewer.set("Ticks", 5)
    viewer.press("Run these ticks")
    viewer.wait(lambda: script.world.clock.tick == tick + 5)
    viewer.wait_for_note("Ticks")
    viewer.press("Start")
    viewer.wait(lambda: script.world.clock.tick > tick + 50)
    viewer.press("Run these ticks")
    viewer.wait_for_note("Ticks", "stop it before stepping")


def test_arm_is_moved_and_objects_come_and_go(viewer: Viewer, script: Script) -> None:
    viewer.set("Duration [s]", 0.2)
    viewer.set("lbr_iiwa_joint_2", 0.3)
    viewer.press("Move")
    viewer.wait_for_note("Move", "iiwa moves")
    viewer.wait(lambda: abs(viewer.value("lbr_iiwa_joint_2") - 0.3) < 0.01)
    viewer.set("Name", "crate")
    viewer.press("Add")
    viewer.wait(lambda: has(viewer, "/crate/") and viewer.offers("Object", "crate"))
    viewer.set("Object", "crate")
    viewer.press("Remove")
    viewer.wait(lambda: not has(viewer, "/crate"))
    viewer.press("Reset")
    viewer.wait_for_note("Reset")
    assert script.world.resets == 1


def test_pace_is_limited(viewer: Viewer, script: Script) -> None:
    viewer.set("Real-time factor", 0.001)
    viewer.wait_for_note("Real-time factor", "at most 0.001")
    viewer.set("Real-time factor", 0.0)
    tick = script.world.clock.tick
    viewer.wait(lambda: script.world.clock.tick > tick + 50)


def test_view_does_not_change_the_simulation(tmp_path: Path) -> None:
    file = write_world(tmp_path, collision=(FLOOR,), dynamic=(box("box", contacts={}),), robots=(iiwa(),))
    hashes = []
    for is_shown in (False, True):
        world = World.from_file(file)
        if is_shown:
            view = world.view()
        for _ in range(500):
            world.step()
        hashes.append(world.state_hash())
        world.close()
    assert hashes[0] == hashes[1]
    assert "iframe" in view._repr_html_() and view.link in view._repr_html_()


def test_soft_body_is_shown_as_triangles(tmp_path: Path) -> None:
    script = Script(tmp_path, soft=(block(tmp_path),), **DEFORMABLE)
    with Viewer(script.view.link) as viewer:
        viewer.wait(lambda: has(viewer, "/jelly/"))
    script.close()


def test_requests_between_steps_are_refused_in_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rpbi_data.view.script_controls.LIMIT_S", 0.2)
    world = World.from_file(write_world(tmp_path, robots=(iiwa(),)))
    with world.view() as view:
        with pytest.raises(InterfaceError, match="does not step the world"):
            view._controls.run("Reset")
        world.step()
        assert world.resets == 0
    world.step()
    world.close()
