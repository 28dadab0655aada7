"""Features of a data set, derived from the topics of a recording."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import pandas as pd

from custom_ros_tools.errors import UnknownNameError
from episodes.datasets.format import ACTION, IMAGES, QUATERNION, STATE, Feature
from rpbi_utils.bags.images import COMPRESSED_TYPE, RAW_TYPE
from rpbi_utils.bags.row_plan import RECORD_TIME
from rpbi_utils.bags.transforms import ROTATION, TRANSLATION

JOINTS, WRENCH, CONTACTS = "sensor_msgs/JointState", "geometry_msgs/WrenchStamped", "ros_pybullet_interface/Contacts"
TRANSFORMS = "tf2_msgs/TFMessage"
OTHER_ACTIONS = {
    "geometry_msgs/Twist", "geometry_msgs/TwistStamped", "geometry_msgs/Pose", "geometry_msgs/PoseStamped",
    "geometry_msgs/TransformStamped", "geometry_msgs/WrenchStamped", "std_msgs/Float64", "std_msgs/Float64MultiArray",
    "std_msgs/Float32MultiArray",
}  # fmt: skip
"""Types of topics that are actions if their name ends as `ACTION_NAME` says, beside those of joints."""
ACTION_NAME = re.compile(r"(.*)/(target|command|cmd_vel)")
STATES_NAME = re.compile(r"(.*)/joint_states")
TARGETS_NAME = re.compile(r"(.*/joint_states)/target")
_KINDS = ("position", "velocity", "effort")
_JOINT = re.compile(r"^(position|velocity|effort)/(?![xyzw]$)")
_OF_ROBOT = re.compile(r"/joint_states(/target)?$")
_AXES = ("x", "y", "z")

Tables = Mapping[str, pd.DataFrame]
"""Tables by name: a topic, or the topic of transforms, `#` and a frame."""


class Column(NamedTuple):
    """Source of the numbers of a feature.

    Attributes:
        table: Name of the table.
        name: Column of the table.
    """

    table: str
    name: str


class Signal(NamedTuple):
    """A feature and its sources.

    Attributes:
        feature: The feature.
        columns: Source of each of its numbers.
        method: Method of resampling, see `rpbi_utils.resample`.
        held: For actions of joints, columns that are the values before the first message; empty for none.
    """

    feature: Feature
    columns: tuple[Column, ...]
    method: str = "linear"
    held: tuple[Column, ...] = ()

    @property
    def begins_at_once(self) -> bool:
        """Whether rows begin with its first message; actions and contacts may come later."""
        return self.method != "previous"


class Choice(NamedTuple):
    """Topics that the user names; with None they are derived.

    Attributes:
        state: Topics of `observation.state`.
        action: Topics of `action`.
        images: Topics of images.
    """

    state: tuple[str, ...] | None = None
    action: tuple[str, ...] | None = None
    images: tuple[str, ...] | None = None


def wanted_topics(types: Mapping[str, str], choice: Choice) -> list[str]:
    """Returns the topics whose tables are needed.

    Args:
        types: Types of messages by topic.
        choice: Topics that the user names.

    Raises:
        UnknownNameError: If there is no topic that was named.
    """
    named = {*(choice.state or ()), *(choice.action or ()), *(choice.images or ())}
    for topic in sorted(named - types.keys()):
        raise UnknownNameError("topic", topic, types)
    derived = {topic for topic, kind in types.items() if _has_features(topic, kind)}
    return sorted((derived | named) - {topic for topic in types if is_image(types[topic])})


def _has_features(topic: str, kind: str) -> bool:
    return (
        kind in (JOINTS, WRENCH, CONTACTS)
        or (kind == TRANSFORMS and topic == "/tf")
        or (kind in OTHER_ACTIONS and ACTION_NAME.fullmatch(topic) is not None)
    )


def is_used(topic: str, kinds: Collection[str], choice: Choice) -> bool:
    """Returns whether messages of a topic, of one type or several, would be a feature."""
    named = {*(choice.state or ()), *(choice.action or ()), *(choice.images or ())}
    return topic in named or any(
        _has_features(topic, kind) or (is_image(kind) and choice.images is None) for kind in kinds
    )


def is_image(kind: str) -> bool:
    """Returns whether a type of message is an image."""
    return kind in (RAW_TYPE, COMPRESSED_TYPE)


def image_topics(types: Mapping[str, str], choice: Choice) -> dict[str, str]:
    """Returns the topics of images by key of the feature; of a raw topic and its compressed one, the raw one."""
    topics = choice.images
    if topics is None:
        found = {topic for topic, kind in types.items() if is_image(kind)}
        topics = tuple(sorted(topic for topic in found if topic.removesuffix("/compressed") not in found - {topic}))
    return {IMAGES + label(re.sub(r"/image(/compressed)?$", "", topic)): topic for topic in topics}


def by_frame(tables: Tables, topic: str = "/tf") -> dict[str, pd.DataFrame]:
    """Returns tables with a table for each frame of TF, in place of the one of all frames."""
    found = {name: table for name, table in tables.items() if name != topic}
    if topic in tables:
        frames = tables[topic].groupby(["parent", "child"], sort=True)
        found |= {f"{topic}#{parent}#{child}": table for (parent, child), table in frames}
    return found


def derive(
    tables: Tables, types: Mapping[str, str], namespace: str, fixed: Collection[str], choice: Choice
) -> list[Signal]:
    """Returns the features of a recording.

    Args:
        tables: Its tables, those of TF by frame.
        types: Types of messages by topic.
        namespace: Namespace of the simulator.
        fixed: Names of joints that cannot move, which are left out.
        choice: Topics that the user names.
    """
    return [
        *_states(tables, types, fixed, choice),
        *_actions(tables, types, fixed, choice),
        *_wrenches(tables, types, choice),
        *_contacts(tables, types),
        *_poses(tables, namespace),
    ]


def label(topic: str) -> str:
    """Returns a topic as a part of a key: without `rpbi`, with `_` for all that is no letter or number."""
    return re.sub(r"\W+", "_", "/".join(part for part in topic.split("/") if part != "rpbi")).strip("_")


def _states(tables: Tables, types: Mapping[str, str], fixed: Collection[str], choice: Choice) -> Iterator[Signal]:
    if choice.state is not None:
        yield _generic(STATE, tables, choice.state)
        return
    topics = [topic for topic in tables if types.get(topic) == JOINTS and STATES_NAME.fullmatch(topic)]
    for kind, key in zip(_KINDS, (STATE, "observation.velocity", "observation.effort")):
        columns = [Column(topic, name) for topic in topics for name in _joint_columns(tables[topic], kind, fixed)]
        if columns:
            yield Signal(Feature(key, _names(columns)), tuple(columns))


def _actions(tables: Tables, types: Mapping[str, str], fixed: Collection[str], choice: Choice) -> Iterator[Signal]:
    topics = list(choice.action or ())
    if choice.action is None:
        joints = [topic for topic in tables if types.get(topic) == JOINTS]
        topics = [topic for topic in joints if TARGETS_NAME.fullmatch(topic)]
        others = [*joints, *(topic for topic in tables if types.get(topic) in OTHER_ACTIONS)]
        topics = topics or [topic for topic in others if ACTION_NAME.fullmatch(topic)]
    if not topics:
        return
    columns: list[Column] = []
    held: list[Column] = []
    for topic in topics:
        match = TARGETS_NAME.fullmatch(topic)
        states = match[1] if match else ""
        if types.get(topic) == JOINTS and states in tables:
            kind = next((each for each in _KINDS if _joint_columns(tables[topic], each, ())), "position")
            names = _joint_columns(tables[states], "position", fixed)
            columns += [Column(topic, name.replace("position", kind, 1)) for name in names]
            held += [Column(states if kind == "position" else "", name) for name in names]
        else:
            found = [Column(topic, name) for name in _numbers(tables[topic])]
            columns += found
            held += [Column("", name) for _, name in found]
    yield Signal(Feature(ACTION, _names(columns)), tuple(columns), "previous", tuple(held))


def _wrenches(tables: Tables, types: Mapping[str, str], choice: Choice) -> Iterator[Signal]:
    used = {*(choice.action or ()), *(choice.state or ())}
    for topic in tables:
        if types.get(topic) == WRENCH and topic not in used and not ACTION_NAME.fullmatch(topic):
            columns = [Column(topic, f"wrench/{part}/{axis}") for part in ("force", "torque") for axis in _AXES]
            names = tuple(f"{part}.{axis}" for part in ("force", "torque") for axis in _AXES)
            yield Signal(Feature(f"observation.wrench.{label(topic)}", names), tuple(columns))


def _contacts(tables: Tables, types: Mapping[str, str]) -> Iterator[Signal]:
    for topic in tables:
        if types.get(topic) == CONTACTS:
            columns = tuple(Column(topic, f"force/{axis}") for axis in _AXES)
            key = f"observation.contact_force.{label(topic.removesuffix('/contacts'))}"
            yield Signal(Feature(key, tuple(f"force.{axis}" for axis in _AXES)), columns, "nearest")


def _poses(tables: Tables, namespace: str) -> Iterator[Signal]:
    """Yields the poses of the bodies of the world that have a frame of their own."""
    prefix = f"{namespace.strip('/')}/rpbi/".lstrip("/")
    for table in tables:
        _, _, frames = table.partition("#")
        parent, _, child = frames.partition("#")
        if parent in (f"{prefix}world", "rpbi/world") and re.fullmatch(rf"({re.escape(prefix)}|rpbi/)[^/]+", child):
            columns = tuple(Column(table, name) for name in (*TRANSLATION, *ROTATION))
            yield Signal(Feature(f"observation.pose.{label(child)}", (*_AXES, *QUATERNION)), columns)


def _generic(key: str, tables: Tables, topics: Sequence[str]) -> Signal:
    columns = [Column(topic, name) for topic in topics for name in _numbers(tables[topic])]
    return Signal(Feature(key, _names(columns)), tuple(columns))


def _numbers(table: pd.DataFrame) -> list[str]:
    """Returns the columns with numbers of messages, without header and time of recording."""
    return [
        name
        for name in table.columns
        if table[name].dtype.kind in "iufb" and name != RECORD_TIME and not name.startswith("header/")
    ]


def _joint_columns(table: pd.DataFrame, kind: str, fixed: Collection[str]) -> list[str]:
    names = [name for name in table.columns if name.startswith(f"{kind}/")]
    return [name for name in names if name.partition("/")[2] not in fixed and table[name].notna().any()]


def _names(columns: Iterable[Column]) -> tuple[str, ...]:
    """Returns names of numbers: joints by name, else the path; with the robot or topic where that is not unique."""
    columns = list(columns)
    short = [
        re.sub(rf"^({'|'.join(_KINDS)})/(?!([xyzw]|covariance)$)", "", name).replace("/", ".") for _, name in columns
    ]
    if len(set(short)) == len(short):
        return tuple(short)
    robots = [label(_OF_ROBOT.sub("", table)) for table, _ in columns]
    return tuple(f"{robot}.{name}" for robot, name in zip(robots, short))
