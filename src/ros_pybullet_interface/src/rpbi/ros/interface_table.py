"""Which topics and services a world has, without starting anything."""

from __future__ import annotations

from typing import NamedTuple

from ..inputs import PoseInput
from ..sensors import LinkPoseSensor
from ..world import World
from .body_services import BODY_SERVICES
from .body_topics import BODY_TOPICS
from .camera_topics import CAMERA_TOPICS, camera_prefix
from .dynamics_services import DYNAMICS_SERVICES
from .inputs import TOPIC_INPUTS
from .outlets import TOPICS
from .services import NODE_SERVICES
from .trajectory_commands import action_suffixes
from .trajectory_messages import FollowJointTrajectoryAction


class Endpoint(NamedTuple):
    """A topic or service.

    Attributes:
        kind: `publishes`, `subscribes`, `serves` or `listens to TF`.
        name: Its relative name, or the TF frame.
        type: Its ROS type.
        note: Rate or purpose.
    """

    kind: str
    name: str
    type: str
    note: str = ""


def endpoints(world: World) -> list[Endpoint]:
    """Lists what the node opens for a world."""
    config = world.config
    listed = [
        Endpoint("publishes", "rpbi/status", "std_msgs/Int64", f"{config.status_hz:g} Hz; 1 running, 0 stopped"),
        Endpoint("publishes", "/diagnostics", "diagnostic_msgs/DiagnosticArray", "1 Hz"),
    ]
    listed.append(Endpoint("publishes", "/clock", "rosgraph_msgs/Clock", "if use_sim_time"))
    for name in world.bodies:
        for sensor in world.sensors_of(name):
            sample_topic = TOPICS.get(sensor.sample_type)
            if sample_topic is not None:
                topic_name = sample_topic.topic.format(name=sensor.name)
                listed.append(Endpoint("publishes", topic_name, sample_topic.message_type._type, f"{sensor.hz:g} Hz"))
            elif isinstance(sensor, LinkPoseSensor):
                listed.append(Endpoint("publishes", "/tf", "tf2_msgs/TFMessage", f"{sensor.hz:g} Hz; {name}"))
    for index, (name, camera) in enumerate(world.cameras.items()):
        for topic in CAMERA_TOPICS:
            full_name = f"{camera_prefix(name, index)}/{topic.suffix}"
            listed.append(Endpoint("publishes", full_name, topic.message_type._type, f"{camera.hz:g} Hz"))
    for slot, taken in world.inputs.items():
        name, key = slot.split("/")
        if isinstance(taken, PoseInput):
            listed.append(Endpoint("listens to TF", taken.tf_id, "", f"{taken.hz:g} Hz; {name}"))
        else:
            topic_input = TOPIC_INPUTS[key]
            type_name = topic_input.message_type._type
            listed.append(Endpoint("subscribes", topic_input.topic.format(name=name), type_name))
    for name, service_type in {**NODE_SERVICES, **DYNAMICS_SERVICES}.items():
        listed.append(Endpoint("serves", name, service_type._type))
    for name, body in world.bodies.items():
        for topic in BODY_TOPICS:
            for suffix in topic.suffixes(body):
                listed.append(Endpoint("subscribes", f"rpbi/{name}/{suffix}", topic.message_type._type))
        for suffix in action_suffixes(body):
            listed.append(Endpoint("serves", f"rpbi/{name}/{suffix}", FollowJointTrajectoryAction._type, "action"))
        for service in BODY_SERVICES:
            for suffix in service.suffixes(body):
                listed.append(Endpoint("serves", f"rpbi/{name}/{suffix}", service.service_type._type))
    return listed
