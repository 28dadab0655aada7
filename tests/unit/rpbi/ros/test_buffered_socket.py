"""Sending without waiting, over a real pair of sockets."""

import socket

import pytest

from custom_ros_tools.sockets import MAX_TOGETHER, BufferedSocket, flush_buffered_sockets


@pytest.fixture
def pair():
    ours, theirs = socket.socketpair()
    ours.settimeout(60.0)  # as rospy's are
    ours.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 8192)
    yield ours, theirs
    ours.close()
    theirs.close()


def _received(theirs):
    theirs.setblocking(False)
    data = b""
    try:
        while chunk := theirs.recv(65536):
            data += chunk
    except BlockingIOError:
        pass
    return data


def _message(number):
    return b"%06d" % number * 500


def test_messages_go_together_with_the_next_flush(pair):
    buffered = BufferedSocket(pair[0], limit=10)
    buffered.sendall(b"hello ")
    buffered.sendall(b"world")
    assert _received(pair[1]) == b""
    flush_buffered_sockets()
    assert _received(pair[1]) == b"hello world"


def test_many_messages_do_not_wait_for_a_flush(pair):
    buffered = BufferedSocket(pair[0], limit=1000)
    for _ in range(MAX_TOGETHER):
        buffered.sendall(b"x")
    assert _received(pair[1]) == b"x" * MAX_TOGETHER


def test_sockets_are_flushed_in_the_order_in_which_messages_came(pair):
    class Noting(BufferedSocket):
        def flush(self):
            flushed.append(self)
            super().flush()

    flushed = []
    others = socket.socketpair()
    first, second = Noting(pair[0], limit=10), Noting(others[0], limit=10)
    for each in (second, first, second):
        each.sendall(b"x")
    flush_buffered_sockets()
    flush_buffered_sockets()
    assert flushed == [second, first]
    for each in others:
        each.close()


def test_slow_reader_blocks_no_sender_and_receives_everything_in_order(pair):
    buffered = BufferedSocket(pair[0], limit=1000)
    for number in range(100):  # far more than the socket's buffer takes
        buffered.sendall(_message(number))
    data = _received(pair[1])
    assert len(data) < 100 * len(_message(0)), "the buffer took all: this test shows nothing"
    while chunk := (buffered.flush(), _received(pair[1]))[1]:
        data += chunk
    assert data == b"".join(map(_message, range(100)))


def test_oldest_whole_messages_are_dropped_beyond_the_limit(pair):
    buffered = BufferedSocket(pair[0], limit=5)
    for number in range(100):
        buffered.sendall(_message(number))
    data = _received(pair[1])
    while chunk := (buffered.flush(), _received(pair[1]))[1]:
        data += chunk
    length = len(_message(0))
    numbers = [int(data[start : start + 6]) for start in range(0, len(data), length)]
    assert data == b"".join(map(_message, numbers))
    assert numbers == sorted(numbers)
    assert numbers[-5:] == [95, 96, 97, 98, 99]
    assert len(numbers) < 100


def test_closed_reader_raises_an_error_at_the_next_message(pair):
    buffered = BufferedSocket(pair[0], limit=5)
    pair[1].close()
    buffered.sendall(b"x")
    flush_buffered_sockets()
    with pytest.raises(BrokenPipeError):
        buffered.sendall(b"x")
    flush_buffered_sockets()


def test_it_is_otherwise_the_socket(pair):
    assert BufferedSocket(pair[0], limit=5).fileno() == pair[0].fileno()


def test_message_does_not_wait_for_the_acknowledgement_of_its_predecessor():
    with socket.create_server(("127.0.0.1", 0)) as server, socket.create_connection(server.getsockname()) as ours:
        assert not ours.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
        BufferedSocket(ours, limit=10)
        assert ours.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
