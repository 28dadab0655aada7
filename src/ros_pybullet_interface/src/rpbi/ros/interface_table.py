"""Which topics and services a world has, without starting anything."""

from __future__ import annotations

from typing import NamedTuple

from ros_pybullet_interface.msg import ResetDebugVisualizerCamera
from ros_pybullet_interface.srv import GetDebugVisualizerCamera

from ..inputs import PoseInput
from ..sensors import LinkPoseSensor
from ..world import World
from .body_services import BODY_SERVICES
from .body_topics import BODY_TOPICS
from .camera_services import CAMERA_SERVICES
from .camera_topics import camera_topics
from .debug_camera import GET_SERVICE, RESET_TOPIC
from .dynamics_services import DYNAMICS_SERVICES
from .inputs import TOPIC_INPUTS
from .outlets import TOPICS
from .services import NODE_SERVICES
from .time_services import TIME_SERVICES
from .trajectory_commands import action_suffixes
from .trajectory_messages import FollowJointTrajectoryAction
from .window_topics import published_topics
from .world_markers import MARKERS_TOPIC


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
        Endpoint("publishes", "rpbi/state", "ros_pybullet_interface/SimulationState", f"{config.state_hz:g} Hz"),
        Endpoint("publishes", "rpbi/commands", "ros_pybullet_interface/WorldCommands", "what enters, by tick"),
        Endpoint("publishes", "rpbi/world_description", "std_msgs/String", "latched; for replays"),
        Endpoint("publishes", "/diagnostics", "diagnostic_msgs/DiagnosticArray", "1 Hz"),
    ]
    listed.append(Endpoint("publishes", "/clock", "rosgraph_msgs/Clock", "if use_sim_time"))
    if config.markers_hz:
        listed.append(Endpoint("publishes", MARKERS_TOPIC, "visualization_msgs/MarkerArray", "latched; for RViz"))
    for topic_name, message_type in published_topics(config).items():
        listed.append(Endpoint("publishes", topic_name, message_type._type, "PyBullet's window"))
    for name in world.bodies:
        for sensor in world.sensors_of(name):
            sample_topic = TOPICS.get(sensor.sample_type)
            if sample_topic is not None:
                topic_name = sample_topic.topic.format(name=sensor.name)
                listed.append(Endpoint("publishes", topic_name, sample_topic.message_type._type, f"{sensor.hz:g} Hz"))
            elif isinstance(sensor, LinkPoseSensor):
                listed.append(Endpoint("publishes", "/tf", "tf2_msgs/TFMessage", f"{sensor.hz:g} Hz; {name}"))
    for camera in world.cameras.values():
        for full_name, topic in camera_topics(camera.topic_name, camera.config.pointcloud).items():
            listed.append(Endpoint("publishes", full_name, topic.message_type._type, f"{camera.hz:g} Hz"))
    for slot, taken in world.inputs.items():
        name, key = slot.split("/")
        if isinstance(taken, PoseInput):
            listed.append(Endpoint("listens to TF", taken.tf_id, "", f"{taken.hz:g} Hz; {name}"))
        else:
            topic_input = TOPIC_INPUTS[key]
            type_name = topic_input.message_type._type
            listed.append(Endpoint("subscribes", topic_input.topic.format(name=name), type_name))
    listed.append(Endpoint("subscribes", RESET_TOPIC, ResetDebugVisualizerCamera._type, "PyBullet's window"))
    listed.append(Endpoint("serves", GET_SERVICE, GetDebugVisualizerCamera._type, "PyBullet's window"))
    for name, service_type in {**NODE_SERVICES, **CAMERA_SERVICES, **DYNAMICS_SERVICES, **TIME_SERVICES}.items():
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
