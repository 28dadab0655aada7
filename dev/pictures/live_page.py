"""Picture of the live view in a real browser."""

from __future__ import annotations

import re
import sys
import tempfile
import time
from pathlib import Path

from files import write_png
from PIL import Image
from screen import Stage, next_message, wait_until

from ros_pybullet_interface.msg import Contacts

sys.path.append(str(Path(__file__).resolve().parents[2] / "tests/support/screens"))
from browser import Tab, browser
from rviz_worlds import PUSH_N, push_n
from viewer import Viewer

SIZE = (1280, 880)
IMAGE = "rpbi/camera/colour/image/compressed"
CAMERA = "initialCameraPosition=2.2,-3.3,2.3&initialCameraLookAt=0.3,-0.6,0.7"
"""Position of the page's camera, and point that it looks at [m], from which the camera of the world is seen."""
CLOSE = "[...document.querySelectorAll('[class*=Notification-closeButton]')].map((each) => each.click()).length"
DRAWN_S = 5.0
"""Time in which the page has drawn the stopped world [s]."""


def draw_browser(path: Path) -> None:
    """The demo in the browser: the arm pushes the box; sliders, and the image of the camera at its frustum."""
    with Stage(640, 480, scale=1) as stage, browser(*SIZE) as chromium, tempfile.TemporaryDirectory() as folder:
        stage.launch("basic_example_kuka_lwr.launch", "real_time_factor:=0.2")
        log, picture = Path(folder) / "view.log", Path(folder) / "page.png"
        with log.open("w") as output:
            stage.start(["rosrun", "rpbi_data", "browser_view_node.py", "_port:=0"], stdout=output)
        link = wait_until(lambda: re.search(r"view: (\S+)", log.read_text()), "the view runs")[1]
        tab = chromium.tab()
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
        time.sleep(DRAWN_S)
        tab.screenshot(picture)
        write_png(path, Image.open(picture).convert("RGB"))


def _close_warning(tab: Tab) -> None:
    """Closes the message that the browser draws without a graphics card."""
    tab.wait(CLOSE)
