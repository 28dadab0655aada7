"""Who connects to a node and says nothing, or something else, holds up nobody."""

from __future__ import annotations

import contextlib
import logging
import socket
import struct
import threading
from collections.abc import Callable, Iterator

import pytest
from ros_system import wait_until
from rospy.impl.tcpros_base import TCPROSServer, TCPServer

from custom_ros_tools import sockets as server_socket
from custom_ros_tools.ros.rospy_internals import keep_accepting
from custom_ros_tools.sockets import PEEKED, ServerSocket

SOON_S = 60.0


class Node:
    """Accepts connections in a thread, as rospy does, and reads of each the header that it finds there at once."""

    def __init__(self) -> None:
        server = socket.create_server(("127.0.0.1", 0))
        self.address = server.getsockname()
        self._server = ServerSocket(server)
        self._headers: list[bytes] = []
        self._news = threading.Condition()
        threading.Thread(target=self._run, daemon=True).start()

    def _run(self) -> None:
        while True:
            connection, _ = self._server.accept()
            with connection, self._news:
                self._headers.append(connection.recv(PEEKED, socket.MSG_DONTWAIT))
                self._news.notify_all()

    def heard(self, count: int) -> list[bytes]:
        """Waits until it has heard so many, and returns what they said."""
        with self._news:
            assert self._news.wait_for(lambda: len(self._headers) >= count, SOON_S)
            return list(self._headers)


@pytest.fixture
def node() -> Node:
    return Node()


@pytest.fixture
def connect(node: Node) -> Iterator[Callable[[bytes], socket.socket]]:
    """Connects to the node, and says something."""
    with contextlib.ExitStack() as stack:

        def connected(said: bytes) -> socket.socket:
            connection = stack.enter_context(socket.create_connection(node.address, SOON_S))
            connection.sendall(said)
            return connection

        yield connected


def header(size: int = 20) -> bytes:
    return struct.pack("<I", size) + b"x" * size


def is_closed(connection: socket.socket) -> bool:
    try:
        return connection.recv(1) == b""
    except ConnectionResetError:
        return True


def test_complete_headers_are_served_while_silent_clients_are_connected(node, connect):
    silent = [connect(said) for said in (b"", b"\x10", header()[:-1])]
    for count in range(1, 20):
        connect(header(count))
        assert node.heard(count)[-1] == header(count)
    for connection, rest in zip(silent, (header(30), header(0x10)[1:], header()[-1:])):
        connection.sendall(rest)
    assert sorted(node.heard(22)[19:]) == sorted((header(30), header(0x10), header()))


def test_header_larger_than_the_peeked_size_is_received(node, connect):
    connect(header(4 * PEEKED))
    assert node.heard(1)[0] == header(4 * PEEKED)[:PEEKED]


@pytest.mark.parametrize("said", [b"GET / HTTP/1.1\r\n\r\n", b"\0\0\0\0", b"\xff" * 4])
def test_another_protocol_is_sent_away_at_once(node, connect, caplog, said):
    connection = connect(said)
    assert is_closed(connection)
    connect(header())
    node.heard(1)
    assert [record.levelno for record in caplog.records] == [logging.WARNING]
    assert "closed: it does not speak TCPROS" in caplog.text


def test_who_says_nothing_for_long_is_sent_away(monkeypatch, caplog):
    monkeypatch.setattr(server_socket, "HEADER_TIMEOUT_S", 0.1)
    node = Node()
    with socket.create_connection(node.address, SOON_S) as silent:
        assert is_closed(silent)
    wait_until(lambda: "closed: no header came within 0.1 s" in caplog.text, "the log has the reason")


def test_who_goes_without_a_word_is_forgotten(node, connect):
    for _ in range(50):
        connect(b"").close()
        connect(b"\x10").close()
    connect(header())
    assert node.heard(1) == [header()]


@pytest.mark.parametrize("is_mended", [True, False])
def test_rospy_serves_others_meanwhile_and_by_itself_does_not(monkeypatch, is_mended):
    monkeypatch.setattr(TCPServer, "_create_server_sock", TCPServer._create_server_sock)
    if is_mended:
        keep_accepting()
    is_heard = threading.Event()
    server = TCPROSServer()

    def serve(connection: socket.socket, *_: object) -> None:
        connection.close()  # else it is closed when the server's thread ends, in some later test
        is_heard.set()

    server.service_connection_handler = serve
    server.start_server()
    address = ("127.0.0.1", server.get_address()[1])
    asked = b"service=/a"
    with socket.create_connection(address) as silent, socket.create_connection(address) as caller:
        caller.sendall(struct.pack("<II", 4 + len(asked), len(asked)) + asked)
        assert is_heard.wait(SOON_S if is_mended else 0.3) == is_mended
        silent.close()
        assert is_heard.wait(SOON_S)
    server.shutdown()
