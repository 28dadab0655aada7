"""Pictures of the live view and of an episode's page in a real browser, by themselves and next to RViz."""

from __future__ import annotations

import math
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from xmlrpc.client import ServerProxy

import numpy as np
import rosgraph
from files import write_png
from labels import label
from PIL import Image
from render import beside
from screen import PATIENCE_S, Stage, next_message, wait_until

from ros_pybullet_interface.msg import Contacts, SimulationState

sys.path.append(str(Path(__file__).resolve().parents[2] / "tests/support/screens"))
from chromium import Tab, browser
from rviz_worlds import PUSH_N, RVIZ, push_n
from viewer import Viewer

ROOT = Path(__file__).resolve().parents[2]
SIZE, FINENESS = (960, 760), 1.5
"""Size of the page in its own pixels, and pixels of the picture for each of them, so that its words are readable."""
IMAGE = "rpbi/camera/colour/image/compressed"
CAMERA = "initialCameraPosition=0.75,-1.65,1.1&initialCameraLookAt=0.53,0.0,0.27"
"""Position of the page's camera, and point that it looks at [m]: the arm is to the left of the panel."""
CLOSE = "[...document.querySelectorAll('[class*=Notification-closeButton]')].map((each) => each.click()).length"
CONNECTED = "document.body.innerText.includes('Connected')"
EPISODE_SIZE, PUSHED_S = (960, 880), 4.5
"""Size of the page of an episode in its own pixels, and time in it at which the arm pushes the box [s]."""
PLAYED_S = "document.querySelector('#root [role=slider]')?.getAttribute('aria-valuenow')"
SEEK = """(() => { const input = document.querySelector('#root input[inputmode]');
Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, 'value').set.call(input, '%s');
input.dispatchEvent(new Event('input', { bubbles: true })); })()"""
LOOKS, LOOKS_S = 3, 2.0
"""Number of equal pictures after which the page has drawn the stopped world, and time between two of them [s]."""


HALF = (600, 520)
"""Size of the picture of RViz, and of that of the browser next to it [px]."""
PAGE_WIDTH = 1280
"""Width of the page, of which the middle is shown: the panel is to the right of it [px]."""
SCENE = "/scene"
"""Node that steps the world of a scene."""


def draw_browser(path: Path) -> None:
    """The demo in the browser: the arm pushes the box; sliders, and the image of the camera."""
    with Stage(640, 480, scale=1) as stage, browser(*SIZE) as chromium, tempfile.TemporaryDirectory() as folder:
        stage.launch("basic_example_kuka_lwr.launch", "real_time_factor:=0.2")
        link = _start_view(stage, Path(folder))
        tab = chromium.tab()
        width, height = SIZE
        screen = {"width": width, "height": height, "deviceScaleFactor": FINENESS, "mobile": False}
        tab.call("Emulation.setDeviceMetricsOverride", **screen)
        tab.open(f"{link}?{CAMERA}")
        tab.wait("document.body.innerText.includes('Time line')", 300.0)
        with Viewer(link) as viewer:
            viewer.wait(lambda: viewer.offers("Image", IMAGE))
            viewer.set("Image", IMAGE)
            viewer.wait(lambda: any(each.get("_image_data") for each in list(viewer.nodes.values())))
        tab.click("Joints")
        _close_warning(tab)
        next_message("rpbi/box/contacts", Contacts, lambda each: push_n(each) > PUSH_N)
        stage.stop_world()
        tab.wait(CONNECTED, PATIENCE_S)
        write_png(path, _still_screenshot(tab, Path(folder)))


def draw_episode(path: Path) -> None:
    """The page of a recorded push, while the arm pushes the box."""
    with tempfile.TemporaryDirectory() as name, browser(*EPISODE_SIZE) as chromium:
        page, run = Path(name) / "episode.html", [str(ROOT / "rpbi")]
        subprocess.run([*run, "demo", "--headless", "--seconds", "14", "--out", name], check=True)
        subprocess.run([*run, "view", f"{name}/recording.bag", "--out", str(page)], check=True)
        tab = chromium.tab()
        width, height = EPISODE_SIZE
        screen = {"width": width, "height": height, "deviceScaleFactor": FINENESS, "mobile": False}
        tab.call("Emulation.setDeviceMetricsOverride", **screen)
        tab.open(page.as_uri())
        tab.wait(PLAYED_S, 120.0)
        _close_warning(tab)
        tab.run(SEEK % PUSHED_S)
        write_png(path, _still_screenshot(tab, Path(name)))


def draw_browser_demo(path: Path) -> None:
    """The demo in RViz and in the browser."""
    _draw_beside(path, "basic_example_kuka_lwr", (0.9, -1.5, 1.3), (0.1, 0.0, 0.4), ("TF", "Coloured depth"))


def draw_browser_factory(path: Path) -> None:
    """The scene `factory` in RViz and in the browser."""
    _draw_beside(path, "factory", (1.55, 0.35, 1.75), (0.25, 0.02, 1.0), starts_s=12.0)


def draw_browser_talos(path: Path) -> None:
    """The scene `talos` in RViz and in the browser."""
    _draw_beside(path, "talos", (2.0, 1.6, 1.5), (0.1, 0.0, 0.92), starts_s=3.8)


def _draw_beside(
    path: Path,
    name: str,
    eye: tuple[float, ...],
    focus: tuple[float, ...],
    hidden: tuple[str, ...] = (),
    starts_s: float = 5.0,
) -> None:
    """Draws one tick of an example in RViz, and in the browser with the same camera.

    Args:
        path: The picture.
        name: Name of the launch file and of RViz's configuration.
        eye: Position of the camera [m].
        focus: Point that it looks at [m].
        hidden: Displays of RViz that are left out.
        starts_s: Simulated time at which the world is stopped [s].
    """
    away = np.subtract(eye, focus)
    distance_m = float(np.linalg.norm(away))
    orbit = {"Pitch": math.asin(away[2] / distance_m), "Yaw": math.atan2(away[1], away[0]) % (2.0 * math.pi)}
    camera = f"initialCameraPosition={','.join(map(str, eye))}&initialCameraLookAt={','.join(map(str, focus))}"
    with ExitStack() as exits:
        stage, folder = exits.enter_context(Stage(*HALF)), exits.enter_context(tempfile.TemporaryDirectory())
        chromium = exits.enter_context(browser(PAGE_WIDTH, HALF[1]))
        stage.launch(f"{name}.launch")
        next_message("rpbi/state", SimulationState, lambda each: each.simulated_time > starts_s)
        exits.enter_context(_stopped(stage))
        without = dict.fromkeys(hidden)
        stage.rviz(RVIZ / f"{name}.rviz", without, Distance=distance_m, Focal_Point=dict(zip("XYZ", focus)), **orbit)
        rviz = stage.still_picture()
        tab = chromium.tab()
        tab.open(f"{_start_view(stage, Path(folder))}?{camera}")
        tab.wait("document.body.innerText.includes('Time line')", 300.0)
        _close_warning(tab)
        left = (PAGE_WIDTH - HALF[0]) // 2
        page = _still_screenshot(tab, Path(folder)).crop((left, 0, left + HALF[0], HALF[1]))
    label(rviz, "RViz", (60, 24))
    label(page, "browser", (60, 24))
    write_png(path, beside(rviz, page))


@contextmanager
def _stopped(stage: Stage) -> Iterator[None]:
    """Stops the world, and the process of the node that steps it, if there is one, until the `with` block ends."""
    master = rosgraph.Master("/pictures")
    if SCENE not in {node for _, nodes in master.getSystemState()[0] for node in nodes}:
        stage.stop_world()
        yield
        return
    process_id = ServerProxy(master.lookupNode(SCENE)).getPid("/pictures")[2]
    os.kill(process_id, signal.SIGSTOP)
    try:
        yield
    finally:
        os.kill(process_id, signal.SIGCONT)


def _start_view(stage: Stage, folder: Path) -> str:
    """Starts the view, and returns its link."""
    log = folder / "view.log"
    with log.open("w") as output:
        stage.start(["rosrun", "rpbi_data", "browser_view_node.py", "_port:=0"], stdout=output)
    return str(wait_until(lambda: re.search(r"view: (\S+)", log.read_text()), "the view runs")[1])


def _still_screenshot(tab: Tab, folder: Path) -> Image.Image:
    """Returns a picture of the page as soon as it stays the same."""
    pictures: list[bytes] = []

    def is_still() -> bool:
        time.sleep(LOOKS_S)
        tab.screenshot(folder / "page.png")
        pictures.append((folder / "page.png").read_bytes())
        return len(pictures) > LOOKS and len(set(pictures[-LOOKS:])) == 1

    wait_until(is_still, "the page stands still")
    return Image.open(folder / "page.png").convert("RGB")


def _close_warning(tab: Tab) -> None:
    """Closes the message that the browser draws without a graphics card."""
    tab.wait(CLOSE)
