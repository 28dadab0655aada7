"""A node with rclpy, which tests of the bridge drive through a socket: `ros2_peer.py SOCKET`; needs ROS 2."""

from __future__ import annotations

import gc
import os
import sys
import threading
import time
import traceback
from array import array
from collections.abc import Callable
from importlib import import_module
from multiprocessing.connection import Listener
from typing import Any

import numpy as np
import rclpy
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message


def class_of(name: str) -> Any:
    """Returns a class of an interface, such as `std_msgs/msg/String`."""
    package, kind, interface = name.split("/")
    return getattr(import_module(f"{package}.{kind}"), interface)


def plain(value: Any) -> Any:
    """Returns a message as dictionaries, lists and values."""
    if hasattr(value, "get_fields_and_field_types"):
        return {name: plain(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if isinstance(value, (list, tuple, array, np.ndarray)):
        return bytes(value) if isinstance(value, array) and value.typecode == "B" else [plain(each) for each in value]
    return value.item() if isinstance(value, np.generic) else value


def filled(message: Any, values: dict[str, Any]) -> Any:
    """Sets fields of a message from dictionaries; lists of messages have a class for their elements."""
    types = message.get_fields_and_field_types()
    for name, value in values.items():
        field = getattr(message, name)
        if hasattr(field, "get_fields_and_field_types"):
            filled(field, value)
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            element = class_of(types[name].split("<")[1].rstrip(">").split("[")[0].replace("/", "/msg/"))
            setattr(message, name, [filled(element(), each) for each in value])
        else:
            setattr(message, name, value)
    return message


class Peer(Node):
    """The node; tests call its methods by name."""

    def __init__(self) -> None:
        super().__init__("peer")
        self._messages: dict[str, list[Any]] = {}
        self._arrivals: dict[str, list[float]] = {}
        self._readers: dict[str, Any] = {}
        self._writers: dict[str, Any] = {}
        self._called: dict[str, Any] = {}

    def listen(
        self, topic: str, type_name: str, depth: int = 10, best_effort: bool = False, keeps: bool = False
    ) -> None:
        """Keeps the messages of a topic, with the times of their arrival."""
        messages, arrivals = self._messages.setdefault(topic, []), self._arrivals.setdefault(topic, [])

        def on_message(message: Any) -> None:
            arrivals.append(time.time())
            messages.append(message)

        qos = _qos(depth, best_effort, keeps)
        self._readers[topic] = self.create_subscription(class_of(type_name), topic, on_message, qos)

    def forget(self, topic: str) -> None:
        """Listens to a topic no more."""
        self.destroy_subscription(self._readers.pop(topic))

    def relay(self, source: str, target: str, type_name: str) -> None:
        """Sends the messages of a topic to another one, as rclpy read them."""
        message_class = class_of(type_name)
        writer = self.create_publisher(message_class, target, _qos(1000))
        self.create_subscription(message_class, source, writer.publish, _qos(1000))

    def count(self, topic: str) -> int:
        return len(self._messages[topic])

    def arrivals(self, topic: str) -> list[float]:
        return self._arrivals[topic]

    def stamps(self, topic: str) -> list[float]:
        return [each.header.stamp.sec + each.header.stamp.nanosec * 1e-9 for each in self._messages[topic]]

    def messages(self, topic: str) -> list[Any]:
        return [plain(each) for each in list(self._messages[topic])]

    def last(self, topic: str) -> Any:
        return plain(self._messages[topic][-1])

    def serialized(self, topic: str) -> list[bytes]:
        return [bytes(serialize_message(each)) for each in list(self._messages[topic])]

    def write(self, topic: str, type_name: str, best_effort: bool = False) -> None:
        """Opens a publisher."""
        self._writers[topic] = self.create_publisher(class_of(type_name), topic, _qos(100, best_effort)), type_name

    def readers(self, topic: str) -> int:
        """Returns the number of readers of a publisher."""
        return self._writers[topic][0].get_subscription_count()

    def publish(self, topic: str, values: dict[str, Any] | bytes) -> None:
        """Publishes a message, given by its fields or as serialised."""
        writer, type_name = self._writers[topic]
        writer.publish(values if isinstance(values, bytes) else filled(class_of(type_name)(), values))

    def topics(self) -> dict[str, list[str]]:
        return dict(self.get_topic_names_and_types())

    def known_services(self) -> dict[str, list[str]]:
        return dict(self.get_service_names_and_types())

    def endpoints(self, topic: str) -> list[tuple[str, str, str]]:
        """Returns reliability, durability and hash of the type of each publisher of a topic."""
        found = self.get_publishers_info_by_topic(topic)
        return [
            (each.qos_profile.reliability.name, each.qos_profile.durability.name, str(each.topic_type_hash))
            for each in found
        ]

    def use_sim_time(self, is_used: bool) -> None:
        self.set_parameters([Parameter("use_sim_time", Parameter.Type.BOOL, is_used)])

    def now(self) -> float:
        return self.get_clock().now().nanoseconds * 1e-9

    def call(self, service: str, type_name: str, values: dict[str, Any], timeout_s: float = 60.0) -> Any:
        """Calls a service."""
        if service not in self._called:
            self._called[service] = self.create_client(class_of(type_name), service)
        client = self._called[service]
        assert client.wait_for_service(timeout_s), f"no service {service}"
        return plain(_result(client.call_async(filled(class_of(type_name).Request(), values)), timeout_s))

    def act(self, action: str, type_name: str, values: dict[str, Any], cancel_after: int = 0) -> Any:
        """Sends a goal, cancels it after some feedbacks if asked; returns status, result, and number of feedbacks."""
        feedbacks: list[Any] = []
        client = ActionClient(self, class_of(type_name), action)
        assert client.wait_for_server(60.0), f"no action {action}"
        goal = filled(class_of(type_name).Goal(), values)
        handle = _result(client.send_goal_async(goal, feedback_callback=lambda each: feedbacks.append(each.feedback)))
        ended = handle.get_result_async()
        while cancel_after and len(feedbacks) < cancel_after and not ended.done():
            time.sleep(0.01)
        if cancel_after:
            _result(handle.cancel_goal_async())
        answer = _result(ended)
        return answer.status, plain(answer.result), [plain(each) for each in feedbacks]


def _qos(depth: int, best_effort: bool = False, keeps: bool = False) -> QoSProfile:
    return QoSProfile(
        depth=depth,
        reliability=ReliabilityPolicy.BEST_EFFORT if best_effort else ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if keeps else DurabilityPolicy.VOLATILE,
    )


def _result(future: Any, timeout_s: float = 60.0) -> Any:
    ended = threading.Event()
    future.add_done_callback(lambda _: ended.set())
    assert ended.wait(timeout_s), "no answer"
    return future.result()


def main() -> None:
    rclpy.init()
    gc.disable()  # the messages that are kept would be visited again and again
    peer, executor = Peer(), SingleThreadedExecutor()
    executor.add_node(peer)

    def spin() -> None:
        try:
            executor.spin()
        except BaseException:
            traceback.print_exc()
            os._exit(1)  # the test's next call fails

    threading.Thread(target=spin, daemon=True).start()
    with Listener(sys.argv[1]) as listener, listener.accept() as connection:
        while True:
            try:
                name, arguments, fields = connection.recv()
            except EOFError:
                os._exit(0)
            method: Callable[..., Any] = getattr(peer, name)
            try:
                connection.send((True, method(*arguments, **fields)))
            except Exception as error:
                connection.send((False, f"{type(error).__name__}: {error}"))


if __name__ == "__main__":
    main()
