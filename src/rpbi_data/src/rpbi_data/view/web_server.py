"""Opens the web server of a live view, and keeps out clients that may not see or control the world.

The server is viser's. It is given a socket that is open already, and a class of connections that limits what clients
send. Without a token, the server only listens on the loopback interface, and only answers pages of its own: a page of
another web site, which is open in the user's browser, cannot reach it.
"""

from __future__ import annotations

import asyncio
import contextlib
import io
import logging
import math
import secrets
import socket
import threading
import time
from functools import partial
from http import HTTPStatus
from http.cookies import CookieError, SimpleCookie
from typing import Annotated, Any, ClassVar, Literal
from urllib.parse import parse_qs, urlsplit

from custom_ros_tools.errors import InterfaceError, MissingDependency

try:
    import msgspec
    import viser
    import websockets.asyncio.server as websockets_server
    from websockets.asyncio.server import ServerConnection
    from websockets.datastructures import Headers
    from websockets.exceptions import WebSocketException
    from websockets.http11 import Request, Response
except ImportError as error:
    raise MissingDependency(error.name or "viser", "./rpbi setup html") from None

LOOPBACK = ("localhost", "127.0.0.1", "::1")
MAX_VIEWERS = 16
"""Maximum number of connected viewers."""
MAX_MESSAGE_BYTES = 16_384
"""Maximum size of a message from a viewer; a larger message ends the connection."""
MAX_TEXT, MAX_NUMBERS = 1_000, 4
"""Maximum length of a text, and number of numbers, that a viewer enters in one field."""
MESSAGES_PER_S, BURST = 100.0, 200.0
"""Rate at which messages of one viewer are read, and number of messages that may arrive at once."""
SEND_BUFFER_BYTES = 262_144
"""Size of the buffer of a slow viewer in the kernel; viser drops outdated poses only before this buffer."""
PING_S, MAX_PONG_S = 10.0, 20.0
"""Time between two checks of a connection, and time after which a viewer that does not answer is disconnected [s]."""
MAX_FAREWELL_S = 1.0
"""Longest time to wait for a viewer's answer when its connection is closed [s]."""
REPORT_S = 60.0
"""Shortest time between two warnings about viewers that send other messages [s]."""
COOKIE = "rpbi_view"
FRAMES = "frame-ancestors 'self' http://localhost:* http://127.0.0.1:*"
"""Pages that may contain the view: those of notebooks on this computer."""

_log = logging.getLogger(__name__)
_silent = logging.getLogger(f"{__name__}.websockets")
_silent.setLevel(logging.CRITICAL)  # a faulty client is no error of this program; rospy reports only known levels
_opening = threading.Lock()


class _CameraMessage(msgspec.Struct, tag_field="type", tag="ViewerCameraMessage", forbid_unknown_fields=True):
    wxyz: tuple[float, float, float, float]
    position: tuple[float, float, float]
    fov: float
    near: float
    far: float
    image_height: float
    image_width: float
    look_at: tuple[float, float, float]
    up_direction: tuple[float, float, float]


_Text = Annotated[str, msgspec.Meta(max_length=MAX_TEXT)]
_Numbers = Annotated[list[float], msgspec.Meta(max_length=MAX_NUMBERS)]


class _InputMessage(msgspec.Struct, tag_field="type", tag="GuiUpdateMessage", forbid_unknown_fields=True):
    uuid: _Text
    updates: dict[Literal["value"], bool | float | _Text | _Numbers | None]


_decoder = msgspec.msgpack.Decoder(_CameraMessage | _InputMessage)


def is_allowed(message: bytes | str) -> bool:
    """Returns whether a page of this view sends such a message: the pose of its camera, or the value of a field.

    All other messages of viser are refused, for instance a request to publish the view on the Internet.
    """
    if isinstance(message, str):
        return False
    try:
        decoded = _decoder.decode(message)
    except (msgspec.MsgspecError, ValueError, RecursionError):
        return False
    values = decoded.updates.values() if isinstance(decoded, _InputMessage) else msgspec.structs.astuple(decoded)
    numbers = [each for value in values for each in (value if isinstance(value, list | tuple) else [value])]
    return all(math.isfinite(each) for each in numbers if isinstance(each, float))


class ViewerConnection(ServerConnection):
    """Connection to a viewer, which reads a limited number of messages, and only allowed ones."""

    _budget, _read_s = BURST, 0.0
    _reported_s: ClassVar[float] = -math.inf

    async def recv(self, decode: bool | None = None) -> Any:
        """Returns the next allowed message. While a viewer sends too many messages, its connection is not read."""
        while True:
            message = await super().recv(decode)
            now_s = time.monotonic()
            self._budget = min(BURST, self._budget + (now_s - self._read_s) * MESSAGES_PER_S) - 1.0
            self._read_s = now_s
            if self._budget < 0.0:
                await asyncio.sleep(-self._budget / MESSAGES_PER_S)
            if is_allowed(message):
                return message
            if now_s - ViewerConnection._reported_s > REPORT_S:
                ViewerConnection._reported_s = now_s
                _log.warning("a viewer sends messages that no page of this view sends: they are ignored")


class Gate:
    """Decides which requests are answered.

    Args:
        token: Secret text that a request must have in its address or cookie; None if no token is needed.
    """

    def __init__(self, token: str | None) -> None:
        self._token = token

    def answer(self, request: Request) -> Response | None:
        """Returns the response to a request that is refused or redirected; None if the request is to be served."""
        try:
            fault = self._fault(request)
        except (WebSocketException, ValueError, LookupError, CookieError):  # such as two headers of one name
            fault = "the request is faulty"
        if fault:
            return _response(HTTPStatus.FORBIDDEN, f"{fault}\n")
        if self._token is not None and "token" in _query(request):  # keeps the token out of histories and screenshots
            cookie = f"{COOKIE}={self._token}; HttpOnly; SameSite=Strict; Path=/"
            return _response(HTTPStatus.FOUND, "", ("Location", "/"), ("Set-Cookie", cookie))
        return None

    def _fault(self, request: Request) -> str:
        host, origin = request.headers["Host"], request.headers.get("Origin")
        if self._token is None and urlsplit(f"//{host}").hostname not in LOOPBACK:
            return "this view only answers at localhost"
        if origin is not None and urlsplit(origin).netloc != host:
            return "this view only answers its own page"
        if request.headers.get("Upgrade") and request.headers.get("Sec-WebSocket-Protocol") != _PROTOCOL:
            return f"this view expects the protocol {_PROTOCOL}: load its page again"
        if self._token is not None:
            cookies = SimpleCookie(request.headers.get("Cookie", ""))
            given = [*_query(request).get("token", []), *([cookies[COOKIE].value] if COOKIE in cookies else [])]
            if not any(secrets.compare_digest(each.encode(), self._token.encode()) for each in given):
                return "the address lacks the right token: use the link that was printed"
        return ""


class WebServer:
    """A web server that shows a scene and controls of viser.

    Args:
        host: Address to listen at. Except on the loopback interface, viewers need the token in `link`.
        port: Port to listen at; 0 chooses a free port.

    Attributes:
        viser: The server of viser.
        link: Address of the page, with the token if one is needed.

    Raises:
        InterfaceError: If the address or the port cannot be used, or this version of viser cannot be guarded.
    """

    def __init__(self, host: str, port: int) -> None:
        token = None if host in LOOPBACK else secrets.token_urlsafe(16)
        listening = _listen(host, port)
        self._gate, self._is_guarded = Gate(token), False
        with _opening, contextlib.redirect_stdout(io.StringIO()):  # viser prints its address
            serve = websockets_server.serve
            websockets_server.serve = partial(self._serve, serve, listening)  # type: ignore[misc, assignment]
            try:
                self.viser = viser.ViserServer(host=host, port=port, label="", verbose=False)
            finally:
                websockets_server.serve = serve  # type: ignore[misc]
            if not self._is_guarded:
                self.viser.stop()
                listening.close()
                raise InterfaceError(f"viser {viser.__version__} opens its server in another way: ./rpbi setup html")
        shown = {"0.0.0.0": socket.gethostname(), "::": socket.gethostname()}.get(host, host)
        shown = f"[{shown}]" if ":" in shown else shown
        self.link = f"http://{shown}:{listening.getsockname()[1]}/" + (f"?token={token}" if token else "")

    def close(self) -> None:
        """Ends the server and all connections."""
        with contextlib.redirect_stdout(io.StringIO()):
            self.viser.stop()

    def _serve(self, serve: Any, listening: socket.socket, handler: Any, _: str, __: int, **options: Any) -> Any:
        """Starts the server of `websockets` for viser, with the socket and the limits of this module."""
        page = options.pop("process_request")
        self._is_guarded = True

        def process_request(connection: ServerConnection, request: Request) -> Response | None:
            response = self._gate.answer(request)
            if response is None and request.headers.get("Upgrade"):
                if len(connection.server.connections) >= MAX_VIEWERS:
                    response = _response(HTTPStatus.SERVICE_UNAVAILABLE, f"{MAX_VIEWERS} viewers are connected\n")
            elif response is None:
                response = page(connection, request)
            if response is not None:
                response.headers["Content-Security-Policy"] = FRAMES
            return response

        times = {"ping_interval": PING_S, "ping_timeout": MAX_PONG_S, "close_timeout": MAX_FAREWELL_S}
        limits: dict[str, Any] = {"max_size": MAX_MESSAGE_BYTES, **times}
        return serve(
            handler,
            sock=listening,
            process_request=process_request,
            create_connection=ViewerConnection,
            logger=_silent,
            **{**options, **limits},
        )


_PROTOCOL = f"viser-v{viser.__version__}"


def _listen(host: str, port: int) -> socket.socket:
    try:
        if not 0 <= port < 1 << 16:
            raise OSError("expected a port from 0 to 65535")
        family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)[0]
        listening = socket.create_server(address[:2], family=family)
    except OSError as error:
        reason = getattr(error, "strerror", None) or error
        raise InterfaceError(f"the view cannot listen at {host}, port {port}: {reason}; choose another port") from None
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)
    return listening


def _query(request: Request) -> dict[str, list[str]]:
    return parse_qs(urlsplit(request.path).query, max_num_fields=20)


def _response(status: HTTPStatus, text: str, *headers: tuple[str, str]) -> Response:
    body = text.encode()
    plain = [("Content-Type", "text/plain; charset=utf-8"), ("Content-Length", str(len(body))), ("Connection", "close")]
    return Response(status.value, status.phrase, Headers([*plain, *headers]), body)
