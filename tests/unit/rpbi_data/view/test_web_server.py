"""The web server of a live view: whom it answers, and that hostile and slow viewers cost others nothing."""

from __future__ import annotations

import http.client
import socket
import subprocess
import sys
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any
from urllib.parse import urlsplit

import msgspec
import numpy as np
import pytest
import viser
from viewer import CAMERA, Viewer
from websockets.exceptions import InvalidStatus

from custom_ros_tools.errors import InterfaceError
from rpbi_data.view.web_server import BURST, MAX_MESSAGE_BYTES, MAX_VIEWERS, WebServer, is_allowed

ADDRESS = "127.0.0.2"
"""An address of this computer that is no loopback address for the server, so that it needs a token."""


@pytest.fixture
def server() -> Iterator[WebServer]:
    running = WebServer("127.0.0.1", 0)
    yield running
    running.close()


@pytest.fixture
def guarded() -> Iterator[WebServer]:
    """A server that needs a token."""
    running = WebServer(ADDRESS, 0)
    yield running
    running.close()


def get(link: str, path: str | None = None, **headers: str) -> http.client.HTTPResponse:
    """Asks for a page; other headers replace those of a browser."""
    address = urlsplit(link)
    connection = http.client.HTTPConnection(address.hostname, address.port, timeout=20.0)
    connection.request("GET", path or f"{address.path}?{address.query}", headers=headers)
    return connection.getresponse()


def update(**fields: Any) -> bytes:
    """Returns a message with the new value of a field."""
    return msgspec.msgpack.encode({"type": "GuiUpdateMessage", "uuid": "a", "updates": {"value": 1.0}} | fields)


def test_page_is_served_on_loopback(server: WebServer) -> None:
    response = get(server.link)
    assert response.status == 200 and b"<html" in response.read()
    assert "localhost" in response.headers["Content-Security-Policy"]
    assert "token" not in server.link


@pytest.mark.parametrize("headers", [{"Host": "evil.example"}, {"Origin": "http://evil.example"}, {"Origin": "null"}])
def test_pages_of_other_sites_get_nothing(server: WebServer, headers: dict[str, str]) -> None:
    assert get(server.link, **headers).status == 403
    with pytest.raises(InvalidStatus):
        Viewer(server.link, headers)


def test_own_page_is_answered(server: WebServer) -> None:
    host = urlsplit(server.link).netloc
    assert get(server.link, Origin=f"http://{host}").status == 200
    with Viewer(server.link, {"Origin": f"http://{host}"}) as viewer:
        viewer.wait(lambda: viewer.counts)


def test_other_address_needs_the_token(guarded: WebServer) -> None:
    assert get(guarded.link, "/").status == get(guarded.link, "/?token=wrong").status == 403
    with pytest.raises(InvalidStatus):
        Viewer(guarded.link)


def test_link_with_token_sets_a_cookie(guarded: WebServer) -> None:
    response = get(guarded.link)
    assert (response.status, response.headers["Location"]) == (302, "/")
    cookie = response.headers["Set-Cookie"].partition(";")[0]
    assert get(guarded.link, "/", Cookie=cookie).status == 200
    assert get(guarded.link, "/", Cookie=f"{cookie}x").status == 403
    with Viewer(guarded.link, {"Cookie": cookie}) as viewer:
        viewer.wait(lambda: viewer.counts)


def test_port_in_use_is_refused_in_one_line(server: WebServer) -> None:
    port = urlsplit(server.link).port
    with pytest.raises(InterfaceError, match=f"port {port}: .*in use.*another port") as refused:
        WebServer("127.0.0.1", port or 0)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(("host", "port"), [("no.such.host.invalid", 0), ("127.0.0.1", 70_000), ("203.0.113.1", 0)])
def test_impossible_address_is_refused(host: str, port: int) -> None:
    with pytest.raises(InterfaceError, match="the view cannot listen at"):
        WebServer(host, port)


@pytest.mark.parametrize("value", [True, 2.5, 3, "text", [1.0, 2.0, 3.0], None])
def test_values_of_fields_are_allowed(value: Any) -> None:
    assert is_allowed(update(updates={"value": value})) and is_allowed(msgspec.msgpack.encode(CAMERA))


@pytest.mark.parametrize(
    "message",
    [
        "text",
        b"",
        b"\xc1" * 100,
        b"\x91" * 5_000,
        update(type="ShareUrlRequest"),
        msgspec.msgpack.encode({"type": "ShareUrlRequest"}),
        msgspec.msgpack.encode({"type": "GuiFormDirtyMessage", "uuid": "a"}),
        msgspec.msgpack.encode(CAMERA | {"wxyz": (1.0, 0.0)}),
        msgspec.msgpack.encode(CAMERA | {"fov": float("nan")}),
        msgspec.msgpack.encode(CAMERA | {"more": 1}),
        update(updates={"value": float("inf")}),
        update(updates={"value": [float("nan")]}),
        update(updates={"value": [0.0] * 5}),
        update(updates={"value": "x" * 1_001}),
        update(updates={"value": {"a": 1}}),
        update(updates={"update_cb": []}),
        update(uuid="u" * 1_001),
    ],
)
def test_other_messages_are_refused(message: bytes | str) -> None:
    assert not is_allowed(message)


def test_hostile_viewer_changes_nothing_for_others(server: WebServer) -> None:
    slider = server.viser.gui.add_slider("speed", 0.0, 1.0, 0.1, 0.5)
    hostile = Viewer(server.link)
    with Viewer(server.link) as viewer:
        viewer.wait(lambda: viewer.find("speed"))
        for message in (b"\xc1", "text", update(type="GuiFormDirtyMessage"), b"\x91" * 5_000):
            hostile.send(message)
        uuid = viewer.find("speed")["uuid"]  # type: ignore[index]
        hostile.send({"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"update_cb": []}})
        hostile.send(b"\xc1" * (MAX_MESSAGE_BYTES + 1))
        viewer.wait(lambda: not hostile.is_connected)
        viewer.set("speed", 0.75)
        viewer.wait(lambda: slider.value == 0.75)


def test_flood_is_read_slowly(server: WebServer) -> None:
    presses: list[int] = []
    button = server.viser.gui.add_button("press")
    button.on_click(lambda _: presses.append(1))
    flood = Viewer(server.link)
    flood.wait(lambda: flood.find("press"))
    count = 3 * int(BURST)
    for _ in range(count):
        flood.press("press")
    with Viewer(server.link) as viewer:
        slider = server.viser.gui.add_slider("speed", 0.0, 1.0, 0.1, 0.5)
        viewer.set("speed", 0.75)
        viewer.wait(lambda: slider.value == 0.75)
    assert len(presses) < count


def test_stalled_viewer_costs_others_nothing(server: WebServer) -> None:
    stalled = Viewer(server.link, is_reading=False)
    box = server.viser.scene.add_box("/box", dimensions=(1.0, 1.0, 1.0))
    cloud = server.viser.scene.add_mesh_simple("/mesh", np.zeros((3, 3)), np.zeros((1, 3)))
    with Viewer(server.link) as viewer:
        for number in range(1, 201):
            box.position = (float(number), 0.0, 0.0)
            cloud.vertices = np.full((100_000, 3), number, np.float32)  # far more than the stalled viewer's buffers
        viewer.wait(lambda: viewer.nodes.get("/box", {}).get("position") == [200.0, 0.0, 0.0])
    buffer = server.viser._websock_server.get_message_buffer()
    assert sum(type(each).__name__ == "SetPositionMessage" for each in buffer.message_from_id.values()) < 10
    stalled._socket.close()


def test_number_of_viewers_is_limited(server: WebServer) -> None:
    viewers = [Viewer(server.link) for _ in range(MAX_VIEWERS)]
    viewers[0].wait(lambda: len(server.viser.get_clients()) == MAX_VIEWERS)
    with pytest.raises(InvalidStatus):
        Viewer(server.link)
    viewers.pop()._socket.close()
    viewers[0].wait(lambda: len(server.viser.get_clients()) < MAX_VIEWERS)
    with Viewer(server.link) as viewer:
        viewer.wait(lambda: viewer.counts)
    for each in viewers:
        each._socket.close()


def test_silent_connections_do_not_keep_others_out(server: WebServer) -> None:
    address = urlsplit(server.link)
    silent = [socket.create_connection((address.hostname, address.port)) for _ in range(50)]
    silent[0].sendall(b"GET / HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n")
    assert b"403" in silent[0].recv(100)
    assert get(server.link).status == 200
    for each in silent:
        each.close()


def test_server_that_cannot_be_guarded_is_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rpbi_data.view.web_server.websockets_server", SimpleNamespace(serve=None))
    with pytest.raises(InterfaceError, match="in another way"):
        WebServer("127.0.0.1", 0)


def test_missing_extra_is_named_with_its_command() -> None:
    script = "import sys; sys.modules['viser'] = None; import rpbi_data.view.web_server"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.stderr.splitlines()[-1].endswith("'viser' is not installed: ./rpbi setup html")


def test_page_of_another_version_is_refused(server: WebServer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(viser, "__version__", "0.0.1\x1b[31m")
    with pytest.raises((InvalidStatus, ValueError)):
        Viewer(server.link)
