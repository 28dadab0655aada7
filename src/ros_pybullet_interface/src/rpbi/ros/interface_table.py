"""Lists all topics, services and parameters of a world, without opening them."""

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

from custom_ros_tools.errors import ConfigError, Problem
from rpbi.bodies import Body
from rpbi.engine.inputs import PoseInput
from rpbi.ros.cameras.topics import camera_topics
from rpbi.ros.publishers.commands import COMMANDS, DESCRIPTION
from rpbi.ros.publishers.sample_topics import sample_topic
from rpbi.ros.publishers.status import CLOCK, DIAGNOSTICS, STATE, STATUS
from rpbi.ros.publishers.transforms import TF, TF_STATIC
from rpbi.ros.publishers.world_markers import MARKERS
from rpbi.ros.services.body_endpoints import BODY_SERVICES, BODY_TOPICS
from rpbi.ros.services.node_services import NODE_SERVICES
from rpbi.ros.services.trajectory_action import ACTION
from rpbi.sensors.link_pose import LinkPoseSensor
from rpbi.world import World

from .attachments import ATTACHMENTS
from .endpoints import Service, Topic
from .inputs import topic_input
from .window_topics import GET, RESET, published_topics

NODE_TOPICS = (STATUS, STATE, ATTACHMENTS, COMMANDS, DESCRIPTION, MARKERS, DIAGNOSTICS, CLOCK)
"""Topics that the node publishes."""
ACTION_MEANING = "An action: the robot follows a trajectory and reports its errors."
PUBLISHES = "publishes"
SUBSCRIBES = "subscribes"
SERVES = "serves"
FOLLOWS = "listens to TF"
OF_WINDOW = "PyBullet's window"
"""Note of the topics and services of PyBullet's window."""


class NodeParameter(NamedTuple):
    """A parameter of the node.

    Attributes:
        name: Name of the parameter, with `NAME` in place of a robot's name.
        is_set: Whether the node sets the parameter; otherwise the node reads it.
        meaning: Purpose of the parameter, in a sentence.
    """

    name: str
    is_set: bool
    meaning: str


PARAMETERS = (
    NodeParameter(
        "~config_file", False, "The main YAML file; a relative path is resolved against `~working_directory`."
    ),
    NodeParameter("~working_directory", False, "Folder that a relative `~config_file` is in."),
    NodeParameter("~state_folder", False, "Folder of `rpbi/save` and `rpbi/restore`; the user's home by default."),
    NodeParameter(
        "~max_predicted_ticks",
        False,
        "Largest number of ticks of a request of `rpbi/predict`, over all candidates; default: 1,000,000.",
    ),
    NodeParameter(
        "~real_time_priority",
        False,
        "Whether the node runs with real-time priority while it needs less than half a processor; true by default.",
    ),
    NodeParameter(
        "~config",
        False,
        "The main YAML file as a mapping; with `~config_file`, keys that replace those of the file. Set at least one.",
    ),
    NodeParameter(
        "use_sim_time", False, "Whether stamps are the world's time, else wall time; from here or a namespace above."
    ),
    NodeParameter(
        "robot_description",
        False,
        "URDF of robots whose `fileName` is `robot_description`; from here or a namespace above.",
    ),
    NodeParameter("rpbi/NAME/robot_description", True, "URDF of a robot, for RViz and robot_state_publisher."),
)


class Endpoint(NamedTuple):
    """A topic, a service or a followed TF frame.

    Attributes:
        kind: Action of the node: `publishes`, `subscribes`, `serves` or `listens to TF`.
        name: Relative ROS name, or name of the TF frame.
        type: ROS type; empty for a TF frame.
        note: Remark: the rate in this world, the name of the body, or both; `action` for an action; `OF_WINDOW` for
            an endpoint of PyBullet's window. May be empty.
        meaning: Purpose, in a sentence.
    """

    kind: str
    name: str
    type: str
    note: str = ""
    meaning: str = ""


def endpoints(world: World) -> list[Endpoint]:
    """Lists all topics, services and followed TF frames that the node opens for a world.

    Raises:
        ConfigError: If the `ros_topic` of a class from another package cannot be found, or two topics or two services
            would have the same name.
    """
    listed = [*_node_topics(world), *_window(world)]
    if world.config.poses:
        listed.append(_topic(PUBLISHES, TF_STATIC, ""))
    for name, body in world.bodies.items():
        listed += of_body(world, name, body)
    for name in world.cameras:
        listed += of_camera(world, name)
    listed += [_service(each) for each in NODE_SERVICES]
    _refuse_clashes(world.loaded.file, listed)
    return listed


def _refuse_clashes(file: str, listed: Iterable[Endpoint]) -> None:
    """Raises a ConfigError if two topics or two services have the same name; all bodies may share `/tf`."""
    by_name: dict[tuple[str, str], Endpoint] = {}
    problems = []
    for each in listed:
        first = by_name.setdefault((each.kind, each.name), each)
        if first is not each and each.kind != FOLLOWS and each.name != TF.name:
            types = f"as {first.type} and as {each.type}" if first.type != each.type else f"twice as {each.type}"
            message = f"the node {each.kind} {each.name} {types}: give what it is named after another name"
            problems.append(Problem(file, "", message))
    if problems:
        raise ConfigError(problems)


def of_body(world: World, name: str, body: Body) -> Iterator[Endpoint]:
    """Yields the topics, services and followed TF frames of a body."""
    for sensor in world.sensors_of(name):
        published = sample_topic(sensor)
        rate = f"{sensor.hz:g} Hz"
        if published is not None:
            yield _topic(PUBLISHES, published, rate, sensor.name)
        elif isinstance(sensor, LinkPoseSensor):
            yield _topic(PUBLISHES, TF, f"{rate}; {name}")
    yield from _inputs(world, name)
    for topic in BODY_TOPICS:
        yield from (_topic(SUBSCRIBES, topic, "", owner) for owner in topic.owners(body))
    for owner in ACTION.owners(body):
        yield _service(ACTION, owner, "action")._replace(meaning=ACTION_MEANING)
    for service in BODY_SERVICES:
        yield from (_service(service, owner) for owner in service.owners(body))


def of_camera(world: World, name: str) -> Iterator[Endpoint]:
    """Yields the topics and followed TF frame of a camera."""
    camera = world.cameras[name]
    for _, topic in camera_topics(camera.topic_name, camera.config.pointcloud).values():
        yield _topic(PUBLISHES, topic, f"{camera.hz:g} Hz", camera.topic_name)
    yield from _inputs(world, name)


def _node_topics(world: World) -> Iterator[Endpoint]:
    for topic in NODE_TOPICS:
        rate = getattr(world.config, topic.key) if topic.key else None
        if topic is not MARKERS or rate:
            yield _topic(PUBLISHES, topic, f"{rate:g} Hz" if rate else "")


def _window(world: World) -> Iterator[Endpoint]:
    yield from (_topic(PUBLISHES, topic, OF_WINDOW) for topic in published_topics(world.config))
    yield _topic(SUBSCRIBES, RESET, OF_WINDOW)
    yield _service(GET, note=OF_WINDOW)


def _inputs(world: World, name: str) -> Iterator[Endpoint]:
    for slot, taken in world.inputs.items():
        owner, key = slot.split("/", 1)
        if owner != name:
            continue
        if isinstance(taken, PoseInput):
            yield Endpoint(FOLLOWS, taken.tf_id, "", f"{taken.hz:g} Hz; {name}")
        else:
            yield _topic(SUBSCRIBES, topic_input(key, taken), "", taken.owner or name)


def _topic(kind: str, row: Topic, note: str, owner: str = "") -> Endpoint:
    message_type: Any = row.message_type
    return Endpoint(kind, row.name.format(name=owner), message_type._type, note, row.meaning)


def _service(row: Service, owner: str = "", note: str = "") -> Endpoint:
    return Endpoint(SERVES, row.name.format(name=owner), row.service_type._type, note, row.meaning)
