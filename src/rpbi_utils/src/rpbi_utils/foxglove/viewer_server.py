"""The server of the Foxglove protocol, by foxglove-sdk, with limits for each viewer."""

from __future__ import annotations

import errno
import socket
import threading
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from custom_ros_tools.errors import InterfaceError, MissingDependency, shortened
from robot_model.asset_files import resolve_package

try:
    import foxglove
    from foxglove.websocket import (
        Capability,
        MessageSchema,
        Parameter,
        Service,
        ServiceHandler,
        ServiceSchema,
        WebSocketServer,
    )
except ImportError:
    raise MissingDependency("foxglove-sdk", "./rpbi setup foxglove") from None

Definition = tuple[str, str]
"""Name and text of a message definition."""
ENCODING = "ros1"
"""Name of ROS 1's serialisation in the Foxglove protocol."""
SCHEMA_ENCODING = "ros1msg"
"""Name of ROS 1's message definitions in the Foxglove protocol."""
# Not the connection graph, nor changes of parameters: foxglove-sdk 0.30.3 calls Python with the locks held that its
# methods `publish_connection_graph` and `publish_parameter_values` wait for, so that both would wait forever.
CAPABILITIES = (
    Capability.ClientPublish,
    Capability.Parameters,
    Capability.Services,
    Capability.Time,
)
PACKAGE = "package://"
ASSET_SUFFIXES = (".bmp", ".dae", ".glb", ".gltf", ".jpeg", ".jpg", ".mtl", ".obj", ".png", ".stl", ".tga", ".urdf")
"""Suffixes of the files that viewers may read from ROS packages: meshes, pictures and URDFs."""
MAX_ASSET_BYTES = 50_000_000


BACKLOG = 256
"""Number of messages that wait for a slow viewer, after which the oldest are dropped. Joint states at 1 kHz fill it in
0.25 s, and images of 640x480 then take 240 MB."""
TIME_HZ = 30.0
"""Rate at which viewers are sent the time [Hz]."""


class PortError(InterfaceError):
    """The server cannot listen at its address."""


def check_address(host: str, port: int) -> None:
    """Checks that a server can listen at an address.

    Raises:
        PortError: If the port is in use, or the host is none of this computer.
    """
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, kind, protocol) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(address)
    except OSError as error:
        if error.errno == errno.EADDRINUSE:
            text = f"port {port} of {host} is in use, perhaps by another foxglove_node: choose one with port:=NUMBER"
            raise PortError(text) from None
        raise PortError(f"cannot listen at {shortened(host)}, port {port}: {error.strerror or error}") from None


class Viewers:
    """The server that viewers connect to, and what it sends to all of them.

    Args:
        host: Address of this computer at which the server listens.
        port: Port; 0 for any free one.
    """

    def __init__(self, host: str, port: int) -> None:
        self._host, self._port = host, port
        self._context = foxglove.Context()
        self._server: WebSocketServer | None = None

    def start(self, listener: Any) -> int:
        """Starts the server, and returns its port.

        Args:
            listener: Object with the methods of `foxglove.websocket.ServerListener`.

        Raises:
            PortError: If the server cannot listen at the address.
        """
        # The SDK calls Python's logging with its locks held, so that threads would wait for each other forever. It
        # also reports each faulty message of a viewer, which would fill the log file.
        foxglove.set_log_level("CRITICAL")
        try:
            self._server = foxglove.start_server(
                name="ROS",
                host=self._host,
                port=self._port,
                capabilities=list(CAPABILITIES),
                server_listener=listener,
                supported_encodings=[ENCODING],
                asset_handler=read_asset,
                context=self._context,
                message_backlog_size=BACKLOG,
            )
        except (OSError, RuntimeError) as error:
            raise PortError(f"cannot listen at {shortened(self._host)}, port {self._port}: {error}") from None
        return self._server.port

    def stop(self) -> None:
        """Stops the server."""
        if self._server is not None:
            self._server.stop()

    def offer_service(
        self, name: str, type_name: str, request: Definition, response: Definition, call: ServiceHandler
    ) -> None:
        """Offers a service.

        Args:
            name: Name of the service.
            type_name: Name of its type.
            request: Name and text of the definition of the request.
            response: Name and text of the definition of the response.
            call: Returns the serialised response to a request, or raises an error whose text the viewer receives.
        """
        schema = ServiceSchema(name=type_name, request=_message_schema(request), response=_message_schema(response))
        if self._server is not None:
            self._server.add_services([Service(name=name, schema=schema, handler=call)])

    def withdraw_services(self, names: Iterable[str]) -> None:
        """Withdraws services."""
        if self._server is not None:
            self._server.remove_services(sorted(names))

    def send_time(self, time_ns: int) -> None:
        """Sends the time [ns]."""
        if self._server is not None:
            self._server.broadcast_time(time_ns)

    def channel(self, topic: str, type_name: str, definition: str) -> Any:
        """Offers a topic to the viewers.

        Args:
            topic: Name of the topic.
            type_name: Name of its message type.
            definition: Text of the message definition.
        """
        schema = _schema((type_name, definition))
        return foxglove.Channel(topic, message_encoding=ENCODING, schema=schema, context=self._context)


def _schema(definition: Definition) -> foxglove.Schema:
    return foxglove.Schema(name=definition[0], encoding=SCHEMA_ENCODING, data=definition[1].encode())


def _message_schema(definition: Definition) -> MessageSchema:
    return MessageSchema(encoding=ENCODING, schema=_schema(definition))


def parameter(name: str, value: Any) -> Parameter:
    """Returns a parameter as viewers receive it; a value of a type that the protocol lacks becomes a text."""
    try:
        return Parameter(name, value=value)
    except (TypeError, ValueError, OverflowError):
        return Parameter(name, value=str(value))


def read_asset(uri: str) -> bytes | None:
    """Returns a mesh, picture or URDF of a ROS package; None for anything else.

    Args:
        uri: Address of the file, as `package://PACKAGE/PATH`.
    """
    if not uri.startswith(PACKAGE) or not uri.lower().endswith(ASSET_SUFFIXES):
        return None
    try:
        folder = resolve_package(f"{PACKAGE}{uri.removeprefix(PACKAGE).split('/')[0]}/").resolve()
        path = resolve_package(uri).resolve()
        if path.is_relative_to(folder) and path.is_file() and path.stat().st_size <= MAX_ASSET_BYTES:
            return Path(path).read_bytes()
    except (OSError, ValueError):
        pass
    return None


class RateLimit:
    """Limits how often, and with how many bytes, each viewer may do something. Thread-safe.

    Each viewer has a store of one second, which is refilled continuously.

    Args:
        count_hz: Largest rate [Hz].
        bytes_hz: Largest data rate [bytes/s].
        clock: Returns the time [s].
    """

    def __init__(
        self, count_hz: float, bytes_hz: float = float("inf"), clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._rates, self._clock = (count_hz, bytes_hz), clock
        self._lock = threading.Lock()
        self._stores: dict[int, tuple[float, float, float]] = {}
        """Time of the last call [s], count and bytes left, by viewer; viewers with full stores are left out."""

    def allows(self, viewer: int, size: int = 0) -> bool:
        """Returns whether a viewer may do it now, with a number of bytes; counts it if so."""
        now_s = self._clock()
        with self._lock:
            if len(self._stores) > 1000:
                self._stores = {key: store for key, store in self._stores.items() if now_s - store[0] < 1.0}
            last_s, *left = self._stores.get(viewer, (now_s, *self._rates))
            count, room = (
                min(rate, each + rate * (now_s - last_s)) if rate < float("inf") else rate
                for rate, each in zip(self._rates, left, strict=True)
            )
            is_allowed = count >= 1.0 and room >= size
            self._stores[viewer] = (now_s, count - is_allowed, room - size * is_allowed)
        return is_allowed
