"""A viewer that speaks the Foxglove protocol, as Foxglove and Lichtblick do."""

from __future__ import annotations

import itertools
import json
import socket
import struct
import threading
from collections import defaultdict
from typing import Any

import rospy
from ros_system import wait_until

try:
    from websockets.client import ClientProtocol
    from websockets.exceptions import ConnectionClosed
    from websockets.sync.client import connect
    from websockets.uri import parse_uri
except ImportError:
    from custom_ros_tools.errors import MissingDependency

    raise MissingDependency("websockets", "./rpbi setup html") from None

SUBPROTOCOL = "foxglove.sdk.v1"
MESSAGE, TIME, RESPONSE, ASSET = 1, 2, 3, 4
"""First bytes of binary frames from the server."""


class FoxgloveClient:
    """A viewer with a thread that reads all that the server sends.

    Args:
        port: Port of the server.
        host: Its address.

    Attributes:
        info: The server's first message.
        channels: Offered channels by topic.
        services: Offered services by name.
        messages: Time [ns] and bytes of messages, by topic.
        times_ns: Times that the server has sent [ns].
        statuses: Warnings and errors that the server has sent.
        parameters: Names and values of parameters, as they came.
    """

    def __init__(self, port: int, host: str = "127.0.0.1") -> None:
        self._socket = connect(f"ws://{host}:{port}", subprotocols=[SUBPROTOCOL], max_size=None, compression=None)
        self.info: dict[str, Any] = {}
        self.channels: dict[str, dict[str, Any]] = {}
        self.services: dict[str, dict[str, Any]] = {}
        self.messages: dict[str, list[tuple[int, bytes]]] = defaultdict(list)
        self.times_ns: list[int] = []
        self.statuses: list[str] = []
        self.parameters: list[tuple[str, Any]] = []
        self.is_closed = False
        self._answers: dict[int, bytes | str] = {}
        self._subscriptions: dict[int, str] = {}
        self._numbers = itertools.count(1)
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()
        wait_until(lambda: self.info, "the server says who it is")

    def __enter__(self) -> FoxgloveClient:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Leaves."""
        self._socket.close()

    def op(self, name: str, **fields: Any) -> None:
        """Sends a message in JSON."""
        self._socket.send(json.dumps({"op": name, **fields}))

    def send_bytes(self, data: bytes) -> None:
        """Sends a binary frame."""
        self._socket.send(data)

    def send_text(self, text: str) -> None:
        """Sends a text frame."""
        self._socket.send(text)

    def subscribe(self, *topics: str) -> None:
        """Subscribes to topics as soon as they are offered."""
        for topic in topics:
            wait_until(lambda topic=topic: topic in self.channels, f"{topic} is offered")
            number = next(self._numbers)
            self._subscriptions[number] = topic
            self.op("subscribe", subscriptions=[{"id": number, "channelId": self.channels[topic]["id"]}])

    def unsubscribe(self, topic: str) -> None:
        """Leaves a topic."""
        (number,) = [number for number, name in self._subscriptions.items() if name == topic]
        del self._subscriptions[number]
        self.op("unsubscribe", subscriptionIds=[number])

    def advertise(self, topic: str, type_name: str, encoding: str = "ros1", number: int | None = None) -> int:
        """Announces a topic; returns the number of its channel."""
        number = next(self._numbers) if number is None else number
        channel = {"id": number, "topic": topic, "encoding": encoding, "schemaName": type_name}
        self.op("advertise", channels=[channel])
        return number

    def publish(self, channel: int, data: bytes) -> None:
        """Sends a message on an announced topic."""
        self.send_bytes(struct.pack("<BI", 1, channel) + data)

    def call(self, service: str, request: bytes, encoding: str = "ros1", timeout_s: float = 60.0) -> bytes:
        """Calls a service; returns the serialised response.

        Raises:
            ValueError: If the server answers that the call has failed.
        """
        wait_until(lambda: service in self.services, f"{service} is offered")
        number, name = next(self._numbers), encoding.encode()
        header = struct.pack("<BIII", 2, self.services[service]["id"], number, len(name))
        self.send_bytes(header + name + request)
        answer = wait_until(lambda: self._answers.get(number), f"{service} answers", timeout_s)
        if isinstance(answer, str):
            raise ValueError(answer)
        return answer[1:]

    def fetch(self, uri: str) -> bytes | None:
        """Returns a file; None if the server refuses it."""
        number = next(self._numbers)
        self.op("fetchAsset", uri=uri, requestId=number)
        answer = wait_until(lambda: self._answers.get(number), f"{uri} is answered")
        assert isinstance(answer, bytes)
        return answer[1:] if answer[0] == 0 else None

    def get_parameters(self, *names: str) -> dict[str, Any]:
        """Returns parameters; all without a name."""
        request = f"r{next(self._numbers)}"
        count = len(self.parameters)
        self.op("getParameters", parameterNames=[*names], id=request)
        wait_until(lambda: ("", request) in self.parameters[count:], "parameters come")
        return {name: value for name, value in self.parameters[count:] if name}

    def _read(self) -> None:
        try:
            for frame in self._socket:
                if isinstance(frame, str):
                    self._on_text(json.loads(frame))
                else:
                    self._on_bytes(frame)
        except ConnectionClosed:
            pass
        finally:
            self.is_closed = True

    def _on_bytes(self, frame: bytes) -> None:
        if frame[0] == MESSAGE:
            number, time_ns = struct.unpack_from("<IQ", frame, 1)
            topic = self._subscriptions.get(number)
            if topic is not None:
                self.messages[topic].append((time_ns, frame[13:]))
        elif frame[0] == TIME:
            self.times_ns.append(struct.unpack_from("<Q", frame, 1)[0])
        elif frame[0] == RESPONSE:
            _, number, length = struct.unpack_from("<III", frame, 1)
            self._answers[number] = b"\0" + frame[13 + length :]
        elif frame[0] == ASSET:
            number, status, length = struct.unpack_from("<IBI", frame, 1)
            self._answers[number] = bytes([status]) + frame[10 + length :]

    def _on_text(self, message: dict[str, Any]) -> None:
        op = message["op"]
        if op == "serverInfo":
            self.info = message
        elif op == "advertise":
            self.channels.update({each["topic"]: each for each in message["channels"]})
        elif op == "unadvertise":
            gone = set(message["channelIds"])
            self.channels = {name: each for name, each in self.channels.items() if each["id"] not in gone}
        elif op == "advertiseServices":
            self.services.update({each["name"]: each for each in message["services"]})
        elif op == "unadvertiseServices":
            gone = set(message["serviceIds"])
            self.services = {name: each for name, each in self.services.items() if each["id"] not in gone}
        elif op == "serviceCallFailure":
            self._answers[message["callId"]] = message["message"]
        elif op == "parameterValues":
            self.parameters += [(each["name"], each.get("value")) for each in message["parameters"]]
            self.parameters.append(("", message.get("id")))
        elif op == "status":
            self.statuses.append(message["message"])


class StalledViewer:
    """A viewer that subscribes to a channel, and then takes nothing from the network.

    Args:
        port: Port of the server.
        channel: Number of the channel.
    """

    def __init__(self, port: int, channel: int) -> None:
        protocol = ClientProtocol(parse_uri(f"ws://127.0.0.1:{port}"), subprotocols=[SUBPROTOCOL])
        self._socket = socket.create_connection(("127.0.0.1", port))
        protocol.send_request(protocol.connect())
        self._socket.sendall(b"".join(protocol.data_to_send()))
        protocol.receive_data(self._socket.recv(1000))
        subscription = {"op": "subscribe", "subscriptions": [{"id": 1, "channelId": channel}]}
        protocol.send_text(json.dumps(subscription).encode())
        self._socket.sendall(b"".join(protocol.data_to_send()))

    def close(self) -> None:
        """Leaves without a word."""
        self._socket.close()


def lost(ros: Any, viewer: FoxgloveClient, topic: str, count: int) -> tuple[int, int, int]:
    """Compares the messages that a viewer and a subscriber receive of a topic whose type has a header.

    Args:
        ros: Subscribes to the topic.
        viewer: The viewer.
        topic: Name of the topic.
        count: Number of messages to wait for.

    Returns:
        Number of messages from the first to the last that both received, how many of them the viewer lost, and how many
        have other bytes.
    """
    direct = ros.listen(topic, rospy.AnyMsg)
    direct.wait_for()
    viewer.subscribe(topic)
    wait_until(lambda: viewer.messages[topic], f"{topic} comes")
    sent = direct.wait_for(len(direct.messages) + count, 600.0)
    ours = {_number(each._buff): each._buff for each in list(sent)}
    last = max(ours)
    wait_until(lambda: _number(viewer.messages[topic][-1][1]) >= last, "the viewer has the last one")
    theirs = {_number(data): data for _, data in list(viewer.messages[topic])}
    direct.close()
    both = range(max(min(ours), min(theirs)), last + 1)
    missing = [each for each in both if each not in theirs]
    return len(both), len(missing), sum(theirs[each] != ours[each] for each in both if each in theirs and each in ours)


def _number(data: bytes) -> int:
    """Returns `header.seq` of a message."""
    return int(struct.unpack_from("<I", data)[0])
