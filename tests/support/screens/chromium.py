"""A real browser without a window, which opens pages and takes screenshots: Chromium, by its debugging protocol."""

from __future__ import annotations

import base64
import contextlib
import json
import os
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from websockets.sync.client import connect

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
OPTIONS = (
    "--headless=new",
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",  # WebGL without a graphics card
    "--enable-unsafe-swiftshader",
    "--remote-debugging-port=0",
    "--hide-scrollbars",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--password-store=basic",
)
MAX_ANSWER_S = 400.0
"""Longest time until the browser answers [s]; without a graphics card, a busy computer draws slowly."""


class Tab:
    """A tab of a browser.

    Args:
        address: Address of the tab's debugging protocol.
    """

    def __init__(self, address: str) -> None:
        self._socket = connect(address, max_size=None)
        self._number = 0
        self.texts: list[str] = []
        """Messages of the page's console, and errors of its scripts."""
        self.call("Page.enable")
        self.call("Runtime.enable")

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Calls a method of the protocol, and returns its result."""
        self._number += 1
        self._socket.send(json.dumps({"id": self._number, "method": method, "params": parameters}))
        while True:
            message = json.loads(self._socket.recv(timeout=MAX_ANSWER_S))
            if message.get("id") == self._number:
                if "error" in message:
                    raise RuntimeError(f"{method}: {message['error']}")
                return message["result"]
            if message.get("method") == "Runtime.consoleAPICalled":
                self.texts.append(" ".join(str(each.get("value", "")) for each in message["params"]["args"]))
            elif message.get("method") == "Runtime.exceptionThrown":
                self.texts.append(str(message["params"]["exceptionDetails"].get("text", "error")))

    def open(self, link: str) -> None:
        """Opens a page, and returns at once."""
        self.call("Page.navigate", url=link)

    def run(self, script: str) -> Any:
        """Runs a script in the page, and returns its value."""
        result = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        return result["result"].get("value")

    def wait(self, script: str, timeout_s: float = 60.0) -> Any:
        """Waits until a script in the page has a value that is true, and returns the value."""
        end_s = time.monotonic() + timeout_s
        while not (value := self.run(script)):
            if time.monotonic() > end_s:
                raise TimeoutError(f"{script}: not within {timeout_s:g} s; {self.run('document.body.innerText')}")
            time.sleep(0.05)
        return value

    def click(self, text: str) -> None:
        """Clicks the button, or the head of a folder, that has a text."""
        script = f"""(() => {{
          const all = [...document.querySelectorAll('button, label, div, span, p')].reverse();
          const found = all.find((each) => each.textContent.trim() === {json.dumps(text)});
          if (found) found.click();
          return Boolean(found);
        }})()"""
        self.wait(script)

    def screenshot(self, path: Path) -> None:
        """Writes a picture of the page as PNG."""
        data = self.call("Page.captureScreenshot", format="png")["data"]
        path.write_bytes(base64.b64decode(data))


class Browser:
    """A running browser.

    Args:
        width: Width of its pages [px].
        height: Height of its pages [px].
    """

    def __init__(self, width: int, height: int) -> None:
        assert CHROMIUM is not None
        self._size = width, height
        self._folder = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        options = (*OPTIONS, f"--user-data-dir={self._folder.name}", f"--window-size={width},{height}", "about:blank")
        output = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        self.process = subprocess.Popen([CHROMIUM, *options], start_new_session=True, **output)
        file = Path(self._folder.name) / "DevToolsActivePort"
        end_s = time.monotonic() + 60.0
        while not (file.exists() and len(file.read_text().splitlines()) == 2):
            if time.monotonic() > end_s:
                raise TimeoutError("the browser did not start")
            time.sleep(0.05)
        port, self._path = file.read_text().splitlines()
        self._address = f"ws://127.0.0.1:{port}"

    def tab(self) -> Tab:
        """Opens an empty tab."""
        with contextlib.closing(connect(f"{self._address}{self._path}", max_size=None)) as socket:
            socket.send(json.dumps({"id": 1, "method": "Target.createTarget", "params": {"url": "about:blank"}}))
            while (message := json.loads(socket.recv(timeout=60.0))).get("id") != 1:
                pass
        tab = Tab(f"{self._address}/devtools/page/{message['result']['targetId']}")
        tab.call(
            "Emulation.setDeviceMetricsOverride",
            width=self._size[0],
            height=self._size[1],
            deviceScaleFactor=1,
            mobile=False,
        )
        return tab

    def close(self) -> None:
        """Ends the browser and all of its processes."""
        os.killpg(self.process.pid, signal.SIGTERM)
        try:
            self.process.wait(10.0)
        except subprocess.TimeoutExpired:
            os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()
        self._folder.cleanup()


@contextlib.contextmanager
def browser(width: int = 1280, height: int = 800) -> Iterator[Browser]:
    """Runs a browser inside the context."""
    running = Browser(width, height)
    try:
        yield running
    finally:
        running.close()
