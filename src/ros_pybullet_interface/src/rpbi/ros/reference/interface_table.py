"""Which topics and services a world has, without starting anything."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

from tf2_msgs.msg import TFMessage

from ros_pybullet_interface.msg import ResetDebugVisualizerCamera
from ros_pybullet_interface.srv import GetDebugVisualizerCamera
from rpbi.bodies import Body
from rpbi.engine.inputs import PoseInput
from rpbi.ros.cameras.topics import camera_topics
from rpbi.ros.inputs import topic_input
from rpbi.ros.node_topics import NODE_TOPICS
from rpbi.ros.publishers.sample_topics import sample_topic
from rpbi.ros.publishers.world_markers import MARKERS_TOPIC
from rpbi.ros.robots.trajectory_commands import action_suffixes
from rpbi.ros.robots.trajectory_messages import FollowJointTrajectoryAction
from rpbi.ros.services.body_services import BODY_SERVICES
from rpbi.ros.services.body_topics import BODY_TOPICS
from rpbi.ros.services.camera_services import CAMERA_SERVICES
from rpbi.ros.services.dynamics_services import DYNAMICS_SERVICES
from rpbi.ros.services.node_services import NODE_SERVICES
from rpbi.ros.services.time_services import TIME_SERVICES
from rpbi.ros.window.debug_camera import GET_SERVICE, RESET_TOPIC
from rpbi.ros.window.topics import published_topics
from rpbi.sensors.link_pose import LinkPoseSensor
from rpbi.world import World

PUBLISHES = "publishes"
SUBSCRIBES = "subscribes"
SERVES = "serves"
FOLLOWS = "listens to TF"
OF_WINDOW = "PyBullet's window"
"""Note of what belongs to it."""


class Endpoint(NamedTuple):
    """A topic or service.

    Attributes:
        kind: `publishes`, `subscribes`, `serves` or `listens to TF`.
        name: Its relative name, or the TF frame.
        type: Its ROS type.
        note: Its rate in this world, or what it belongs to.
        meaning: What it tells or does, in a sentence.
    """

    kind: str
    name: str
    type: str
    note: str = ""
    meaning: str = ""


def endpoints(world: World) -> list[Endpoint]:
    """Lists what the node opens for a world.

    Raises:
        ConfigError: If a class of another package has no topic that can be found.
    """
    listed = [*_node_topics(world), *_window(world)]
    for name, body in world.bodies.items():
        listed += of_body(world, name, body)
    for name in world.cameras:
        listed += of_camera(world, name)
    services = {**NODE_SERVICES, **CAMERA_SERVICES, **DYNAMICS_SERVICES, **TIME_SERVICES}
    return listed + [_endpoint(SERVES, name, each.service_type, "", each.meaning) for name, each in services.items()]


def of_body(world: World, name: str, body: Body) -> Iterator[Endpoint]:
    """Yields what belongs to a body."""
    for sensor in world.sensors_of(name):
        published = sample_topic(sensor)
        rate = f"{sensor.hz:g} Hz"
        if published is not None:
            topic_name = published.topic.format(name=sensor.name)
            yield _endpoint(PUBLISHES, topic_name, published.message_type, rate, published.meaning)
        elif isinstance(sensor, LinkPoseSensor):
            yield _endpoint(PUBLISHES, "/tf", TFMessage, f"{rate}; {name}", "Where it is, see [frames](#frames).")
    yield from _inputs(world, name)
    for topic in BODY_TOPICS:
        for suffix in topic.suffixes(body):
            yield _endpoint(SUBSCRIBES, f"rpbi/{name}/{suffix}", topic.message_type, "", topic.meaning)
    for suffix in action_suffixes(body):
        yield _endpoint(SERVES, f"rpbi/{name}/{suffix}", FollowJointTrajectoryAction, "action")
    for service in BODY_SERVICES:
        for suffix in service.suffixes(body):
            yield _endpoint(SERVES, f"rpbi/{name}/{suffix}", service.service_type, "", service.meaning)


def of_camera(world: World, name: str) -> Iterator[Endpoint]:
    """Yields what belongs to a camera."""
    camera = world.cameras[name]
    for full_name, topic in camera_topics(camera.topic_name, camera.config.pointcloud).items():
        yield _endpoint(PUBLISHES, full_name, topic.message_type, f"{camera.hz:g} Hz", topic.meaning)
    yield from _inputs(world, name)


def _node_topics(world: World) -> Iterator[Endpoint]:
    for topic in NODE_TOPICS:
        rate = getattr(world.config, topic.key) if topic.key else None
        if topic.name != MARKERS_TOPIC or rate:
            note = f"{rate:g} Hz" if rate else ""
            yield _endpoint(PUBLISHES, topic.name, topic.message_type, note, topic.meaning)


def _window(world: World) -> Iterator[Endpoint]:
    for topic in published_topics(world.config):
        yield _endpoint(PUBLISHES, topic.name, topic.message_type, OF_WINDOW, topic.meaning)
    yield _endpoint(SUBSCRIBES, RESET_TOPIC, ResetDebugVisualizerCamera, OF_WINDOW, "Where the window shall look from.")
    yield _endpoint(SERVES, GET_SERVICE, GetDebugVisualizerCamera, OF_WINDOW, "Tells where the window looks from.")


def _inputs(world: World, name: str) -> Iterator[Endpoint]:
    for slot, taken in world.inputs.items():
        owner, key = slot.split("/")
        if owner != name:
            continue
        if isinstance(taken, PoseInput):
            yield Endpoint(FOLLOWS, taken.tf_id, "", f"{taken.hz:g} Hz; {name}")
        else:
            topic = topic_input(key, taken)
            yield _endpoint(SUBSCRIBES, topic.topic.format(name=name), topic.message_type, "", topic.meaning)


def _endpoint(kind: str, name: str, ros_type: Any, note: str, meaning: str = "") -> Endpoint:
    return Endpoint(kind, name, ros_type._type, note, meaning)
