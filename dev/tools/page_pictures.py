"""Takes pictures of a page of `./rpbi view` at some times, in headless Chromium without a network.

apt-get install chromium
./rpbi shell -c "python3 dev/tools/page_pictures.py episode.html docs/images/episode.png 9.5"
"""

import asyncio
import base64
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any
from urllib.request import urlopen

from websockets.client import connect

from custom_ros_tools.ros.lifecycle.timed_master import unused_port

FLAGS = (
    "--headless --no-sandbox --disable-gpu --no-first-run --disable-background-networking --disable-component-update"
)
FLAGS += " --disable-sync --disable-quic --use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader"
WIDTH, HEIGHT = 1280, 900
OPENS_S, DRAWS_S = 120.0, 2.0
"""Longest time until the page plays or shows another time, and time between two looks at it [s]."""
TIME = "document.querySelector('#root [role=slider]')?.getAttribute('aria-valuenow')"
CLOSE_HINT = "document.querySelector('.mantine-Notification-closeButton')?.click()"
SEEK = """(() => { const input = document.querySelector('#root input[inputmode]');
Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, 'value').set.call(input, '%s');
input.dispatchEvent(new Event('input', { bubbles: true })); })()"""


async def main(page: Path, out: Path, times: list[str]) -> None:
    """Opens the page from its file; with several times, the pictures are `OUT_TIME.png`.

    Raises:
        RuntimeError: If the page requests anything but its own file and its content.
    """
    with tempfile.TemporaryDirectory() as profile:
        port = unused_port()
        command = ["chromium", *FLAGS.split(), f"--user-data-dir={profile}", f"--remote-debugging-port={port}"]
        browser = subprocess.Popen([*command, "about:blank"], stderr=subprocess.DEVNULL)
        try:
            async with connect(_address(port), max_size=None) as socket:
                await _take(Tab(socket), page.resolve().as_uri(), out, times)
        finally:
            browser.terminate()
            browser.wait()


async def _take(tab: "Tab", address: str, out: Path, times: list[str]) -> None:
    for domain in ("Page", "Network", "Runtime"):
        await tab.call(f"{domain}.enable")
    await tab.call("Emulation.setDeviceMetricsOverride", width=WIDTH, height=HEIGHT, deviceScaleFactor=1, mobile=False)
    await tab.call("Page.navigate", url=address)
    end_s = time.monotonic() + OPENS_S
    while not await tab.value(TIME):
        if time.monotonic() > end_s:
            raise RuntimeError(f"{address} does not play")
        await asyncio.sleep(0.2)
    await asyncio.sleep(DRAWS_S)
    await tab.value(CLOSE_HINT)
    for each in times:
        await tab.value(SEEK % each)
        picture = await tab.picture()
        path = out if len(times) == 1 else out.with_name(f"{out.stem}_{each}.png")
        path.write_bytes(base64.b64decode(picture))
        print(f"{path}: at {await tab.value(TIME)} s")
    asked = [each for each in tab.requests if each != address and not each.startswith(("data:", "blob:"))]
    if asked:
        raise RuntimeError(f"the page asks for {', '.join(asked)}")


class Tab:
    """A tab of the browser, and the addresses that it has asked for."""

    def __init__(self, socket: Any) -> None:
        self._socket, self._number = socket, 0
        self.requests: list[str] = []

    async def call(self, method: str, **parameters: Any) -> Any:
        """Calls the browser and returns its answer."""
        self._number += 1
        await self._socket.send(json.dumps({"id": self._number, "method": method, "params": parameters}))
        while True:
            message = json.loads(await self._socket.recv())
            if message.get("method") == "Network.requestWillBeSent":
                self.requests.append(message["params"]["request"]["url"])
            if message.get("id") == self._number:
                return message["result"]

    async def picture(self) -> str:
        """Returns a picture that no longer changes; a browser that draws in software needs a while."""
        before, end_s = "", time.monotonic() + OPENS_S
        while time.monotonic() < end_s:
            await asyncio.sleep(DRAWS_S)
            now = str((await self.call("Page.captureScreenshot", format="png"))["data"])
            if now == before:
                break
            before = now
        return before

    async def value(self, script: str) -> Any:
        """Returns the value of a script."""
        return (await self.call("Runtime.evaluate", expression=script))["result"].get("value")


def _address(port: int) -> str:
    """Returns the address of the browser's tab as soon as the browser has started."""
    listing, end_s = f"http://127.0.0.1:{port}/json", time.monotonic() + OPENS_S
    while True:
        try:
            return next(each["webSocketDebuggerUrl"] for each in json.load(urlopen(listing)) if each["type"] == "page")
        except (OSError, StopIteration):
            if time.monotonic() > end_s:
                raise
            time.sleep(0.1)


if __name__ == "__main__":
    asyncio.run(main(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3:]))
