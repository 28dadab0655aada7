"""A viewer of the live view without a browser: speaks viser's protocol, and keeps what a page would show."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any
from urllib.parse import urlsplit

import msgspec
import viser
import zstandard
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

CAMERA = {
    "type": "ViewerCameraMessage",
    "wxyz": (1.0, 0.0, 0.0, 0.0),
    "position": (1.0, 1.0, 1.0),
    "fov": 0.8,
    "near": 0.01,
    "far": 100.0,
    "image_height": 600,
    "image_width": 800,
    "look_at": (0.0, 0.0, 0.0),
    "up_direction": (0.0, 0.0, 1.0),
}
"""First message of every page."""


class Viewer:
    """Connects to a view.

    Args:
        link: Address of the view.
        headers: Additional headers of the request.
        is_reading: Whether the viewer reads at all; one that stalls does not.

    Attributes:
        nodes: Properties of the nodes of the scene, with `position`, `wxyz` and `visible`, indexed by name.
        fields: Fields of the panel, with `label` and `value`, indexed by viser's identifier.
        notes: Titles and texts of the messages that were shown.
        counts: Number of received messages, indexed by type.
    """

    def __init__(self, link: str, headers: dict[str, str] | None = None, is_reading: bool = True) -> None:
        address = urlsplit(link)
        self.nodes: dict[str, dict[str, Any]] = {}
        self.fields: dict[str, dict[str, Any]] = {}
        self.notes: list[tuple[str, str]] = []
        self.counts: dict[str, int] = {}
        self.bytes = 0
        self._socket = connect(
            f"ws://{address.netloc}/",
            subprotocols=[f"viser-v{viser.__version__}"],  # type: ignore[list-item]
            additional_headers=headers or {},
            compression=None,
            close_timeout=1.0,
            max_size=None,
        )
        self.send(CAMERA)
        self._thread = threading.Thread(target=self._read, daemon=True)
        if is_reading:
            self._thread.start()

    def __enter__(self) -> Viewer:
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()

    @property
    def is_connected(self) -> bool:
        """Whether the view has not closed the connection."""
        return self._thread.is_alive()

    def send(self, message: dict[str, Any] | bytes | str) -> None:
        """Sends a message, or anything else."""
        self._socket.send(msgspec.msgpack.encode(message) if isinstance(message, dict) else message)

    def set(self, label: str, value: Any) -> None:
        """Changes the value of a field, or presses a button."""
        self.wait(lambda: self.find(label))
        field = self.find(label)
        assert field is not None
        field["value"] = value
        self.send({"type": "GuiUpdateMessage", "uuid": field["uuid"], "updates": {"value": value}})

    def press(self, label: str) -> None:
        """Presses a button, which may be one of a group."""

        def group_of() -> dict[str, Any] | None:
            return next((each for each in list(self.fields.values()) if label in each.get("options", ())), None)

        self.wait(lambda: self.find(label) or group_of())
        group = group_of()
        if group is None or self.find(label) is not None:
            self.set(label, True)
        else:
            self.send({"type": "GuiUpdateMessage", "uuid": group["uuid"], "updates": {"value": label}})

    def find(self, label: str) -> dict[str, Any] | None:
        """Returns the field with a label; None if there is none."""
        return next((each for each in list(self.fields.values()) if each.get("label") == label), None)

    def offers(self, label: str, option: str) -> bool:
        """Returns whether a field offers an option."""
        return option in (self.find(label) or {}).get("options", ())

    def value(self, label: str) -> Any:
        """Returns the value of a field; None without the field."""
        return (self.find(label) or {}).get("value")

    def wait(self, condition: Callable[[], Any], timeout_s: float = 60.0) -> Any:
        """Waits until a condition holds, and returns its value."""
        end_s = time.monotonic() + timeout_s
        while not (value := condition()):
            if time.monotonic() > end_s:
                raise TimeoutError(f"not within {timeout_s:g} s; notes: {self.notes}; nodes: {sorted(self.nodes)}")
            time.sleep(0.02)
        return value

    def wait_for_note(self, title: str, text: str = "") -> str:
        """Waits for a message with a title and a part of its text, and returns the text."""
        return str(self.wait(lambda: next((each for head, each in self.notes if head == title and text in each), "")))

    def _read(self) -> None:
        try:
            while True:
                data = self._socket.recv()
                assert isinstance(data, bytes)
                self.bytes += len(data)
                size = int.from_bytes(data[8:16], "little")
                content = msgspec.msgpack.decode(zstandard.ZstdDecompressor().decompress(data[16 : 16 + size]))
                for message in content["messages"]:
                    self._apply(message)
        except ConnectionClosed:
            return

    def _apply(self, message: dict[str, Any]) -> None:
        kind = message["type"]
        self.counts[kind] = self.counts.get(kind, 0) + 1
        name, props = message.get("name"), message.get("props")
        if kind == "NotificationShowMessage":
            self.notes.append((props["title"], props["body"]))
        elif kind == "RemoveSceneNodeMessage":
            for node in [each for each in self.nodes if f"{each}/".startswith(f"{name}/")]:
                del self.nodes[node]
        elif kind in ("SetPositionMessage", "SetOrientationMessage", "SetSceneNodeVisibilityMessage"):
            self.nodes.setdefault(name, {}).update({key: message[key] for key in message.keys() - {"type", "name"}})
        elif kind == "SceneNodeUpdateMessage":
            self.nodes.setdefault(name, {}).update(message["updates"])
        elif kind == "GuiUpdateMessage":
            self.fields.setdefault(message["uuid"], {}).update(message["updates"])
        elif kind == "GuiRemoveMessage":
            self.fields.pop(message["uuid"], None)
        elif kind.startswith("Gui") and "uuid" in message and isinstance(props, dict):
            self.fields[message["uuid"]] = {"uuid": message["uuid"], "value": message.get("value"), **props}
        elif name is not None and isinstance(props, dict):
            self.nodes[name] = {**self.nodes.get(name, {}), **props, "type": kind}
