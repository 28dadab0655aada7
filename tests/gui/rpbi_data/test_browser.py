"""A real browser draws the live view, and runs nothing that names contain."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from chromium import CHROMIUM, Browser, browser
from PIL import Image
from worlds import FLOOR, box, write_world

from robot_model.geometry import Pose
from rpbi.world import World
from rpbi_data.view.live_scene import LiveScene
from rpbi_data.view.moment import Moment, Placed, TextItem
from rpbi_data.view.web_server import WebServer

pytestmark = [
    pytest.mark.thorough,
    pytest.mark.skipif(CHROMIUM is None, reason="needs a browser: apt-get install chromium"),
]
ODD = "<img src=x onerror='window.hacked=1'>"
RED = {"shapeType": "GEOM_BOX", "halfExtents": [0.3, 0.3, 0.3], "rgbaColor": [0.9, 0.0, 0.0, 1.0]}


@pytest.fixture(scope="module")
def chromium() -> Iterator[Browser]:
    with browser(900, 600) as running:
        yield running


def red_pixels(path: Path) -> int:
    pixels = np.asarray(Image.open(path).convert("RGB")).astype(int)
    return int(((pixels[..., 0] > 100) & (pixels[..., 1:].max(axis=2) < 90)).sum())


def test_browser_draws_the_world_and_its_buttons_work(chromium: Browser, tmp_path: Path) -> None:
    red = box("box", createVisualShape=RED, basePosition=[0.0, 0.0, 0.3])
    world = World.from_file(write_world(tmp_path, collision=(FLOOR,), dynamic=(red,)))
    ended, view, picture = threading.Event(), world.view(), tmp_path / "page.png"
    tab = chromium.tab()

    def look() -> None:
        try:
            tab.open(view.link)
            tab.wait("document.querySelector('canvas') && document.body.innerText.includes('Time line')")
            end_s = time.monotonic() + 60.0
            while not picture.exists() or red_pixels(picture) < 2_000:
                assert time.monotonic() < end_s, "no red box is drawn"
                tab.screenshot(picture)
            tab.click("Stop")
            tab.wait("document.body.innerText.includes('the script waits in World.step')")
            tab.click("Start")
        finally:
            view._controls._is_stopped = False
            ended.set()

    thread = threading.Thread(target=look)
    thread.start()
    while not ended.wait(0.001):
        world.step()
    thread.join()
    world.close()
    assert red_pixels(picture) >= 2_000 and red_pixels(picture) < 900 * 600 / 2


def test_names_are_no_html(chromium: Browser) -> None:
    server = WebServer("127.0.0.1", 0)
    gui, tab = server.viser.gui, chromium.tab()
    scene = LiveScene(server.viser)
    scene.shows_frames = scene.shows_names = True
    scene.show(Moment(0.0, 0.0, "world", {ODD: Placed("world", Pose())}, {(ODD, ODD): TextItem("world", Pose(), ODD)}))
    gui.add_dropdown(ODD, (ODD,), hint=ODD)
    gui.add_text(ODD, ODD, disabled=True)
    gui.add_button(ODD)
    try:
        tab.open(server.link)
        tab.wait("document.body.innerText.includes('onerror')")
        for client in server.viser.get_clients().values():
            client.add_notification(ODD, ODD)
        tab.wait("document.body.innerText.split('onerror').length > 3")
        assert tab.run("window.hacked") is None
        assert tab.run(f'document.body.innerHTML += "{ODD}", 1') == 1  # the name would work as HTML
        tab.wait("window.hacked")
    finally:
        server.close()
