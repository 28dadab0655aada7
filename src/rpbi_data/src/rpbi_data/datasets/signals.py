"""Features of a data set, derived from the topics of a recording."""

from __future__ import annotations

import fnmatch
import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import pandas as pd

from custom_ros_tools.errors import UnknownNameError
from rpbi_data.bags.images import COMPRESSED_TYPE, RAW_TYPE
from rpbi_data.bags.row_plan import RECORD_TIME
from rpbi_data.bags.transforms import ROTATION, TRANSLATION

from .format import IMAGES, QUATERNION, STATE, Feature

JOINTS, WRENCH, CONTACTS = "sensor_msgs/JointState", "geometry_msgs/WrenchStamped", "ros_pybullet_interface/Contacts"
TRANSFORMS = "tf2_msgs/TFMessage"
OTHER_ACTIONS = {
    "geometry_msgs/Twist", "geometry_msgs/TwistStamped", "geometry_msgs/Pose", "geometry_msgs/PoseStamped",
    "geometry_msgs/TransformStamped", "geometry_msgs/WrenchStamped", "std_msgs/Float64", "std_msgs/Float64MultiArray",
    "std_msgs/Float32MultiArray",
}  # fmt: skip
"""Message types, in addition to joint states, whose topics are actions if the topic name matches `ACTION_NAME`."""
ACTION_NAME = re.compile(r"(.*)/(target|command|cmd_vel)")
STATES_NAME = re.compile(r"(.*)/joint_states")
TARGETS_NAME = re.compile(r"(.*/joint_states)/target")
KINDS = ("position", "velocity", "effort")
_JOINT = re.compile(r"^(position|velocity|effort)/(?![xyzw]$)")
_OF_ROBOT = re.compile(r"/joint_states(/target)?$")
AXES = ("x", "y", "z")

NEXT, PREVIOUS = "next", "previous"
"""Values of `RowOptions.timing`."""
GRIPPER, END_EFFECTOR = "observation.gripper", "observation.end_effector"
_ALWAYS = (STATE, GRIPPER, END_EFFECTOR)

Tables = Mapping[str, pd.DataFrame]
"""Tables, indexed by topic. A table of transforms is indexed by `TOPIC#PARENT#CHILD`, see `by_frame`."""


class Column(NamedTuple):
    """A column of a table.

    Attributes:
        table: Name of the table, see `Tables`.
        name: Name of the column.
    """

    table: str
    name: str


class Signal(NamedTuple):
    """A feature and the columns from which it is computed.

    Attributes:
        feature: The feature.
        columns: Column of each number of the feature.
        method: Method of resampling, see `rpbi_data.resample`. For actions: NEXT or PREVIOUS.
        held: For actions: column of the joint's measured position for each number. The table name is empty if the
            position is not measured.
        deltas: For actions: number of leading columns that are changes from the values measured at the row.
    """

    feature: Feature
    columns: tuple[Column, ...]
    method: str = "linear"
    held: tuple[Column, ...] = ()
    deltas: int = 0

    @property
    def begins_at_once(self) -> bool:
        """Whether rows may only begin when this feature's first message has arrived. False for actions."""
        return self.method not in (NEXT, PREVIOUS)


class RowOptions(NamedTuple):
    """The user's choice of the content of rows.

    Attributes:
        state: Topics of `observation.state`; None to derive them from the names and types of the recorded topics.
        action: Topics of `action`; None to derive them.
        images: Topics of images; None for all images.
        features: Wildcard patterns for further observations, named without `observation.`; None for all.
        end_effector: Frame of the end effector, such as `arm/tool`; empty for none.
        gripper: Names of the gripper's joints. They are a separate observation, and come last in actions.
        timing: NEXT: actions are the newest commands before the next row. PREVIOUS: the newest commands at the row.
        is_pose: Whether actions are the end effector's pose at the next row instead of commands.
        is_delta: Whether actions, except those of the gripper, are changes from the values measured at the row.
    """

    state: tuple[str, ...] | None = None
    action: tuple[str, ...] | None = None
    images: tuple[str, ...] | None = None
    features: tuple[str, ...] | None = None
    end_effector: str = ""
    gripper: tuple[str, ...] = ()
    timing: str = NEXT
    is_pose: bool = False
    is_delta: bool = False


def wanted_topics(types: Mapping[str, str], row_options: RowOptions) -> list[str]:
    """Returns the topics whose tables are needed to compute features.

    Args:
        types: Message types, indexed by topic.
        row_options: Topics that the user chooses.

    Raises:
        UnknownNameError: If a topic that the user chooses is not recorded.
    """
    named = {*(row_options.state or ()), *(row_options.action or ()), *(row_options.images or ())}
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


def is_used(topic: str, kinds: Collection[str], row_options: RowOptions) -> bool:
    """Returns whether a topic is used for a feature. `kinds` are the message types of the topic."""
    named = {*(row_options.state or ()), *(row_options.action or ()), *(row_options.images or ())}
    return topic in named or any(
        _has_features(topic, kind) or (is_image(kind) and row_options.images is None) for kind in kinds
    )


def is_image(kind: str) -> bool:
    """Returns True for the message types of raw images and of compressed images."""
    return kind in (RAW_TYPE, COMPRESSED_TYPE)


def image_topics(types: Mapping[str, str], row_options: RowOptions) -> dict[str, str]:
    """Returns image topics, indexed by feature key. If a raw topic is recorded, its compressed topic is left out."""
    topics = row_options.images
    if topics is None:
        found = {topic for topic, kind in types.items() if is_image(kind)}
        topics = tuple(sorted(topic for topic in found if topic.removesuffix("/compressed") not in found - {topic}))
    return {IMAGES + label(re.sub(r"/image(/compressed)?$", "", topic)): topic for topic in topics}


def by_frame(tables: Tables, topic: str = "/tf") -> dict[str, pd.DataFrame]:
    """Splits the table of TF into a table for each pair of parent and child frame, and returns all tables."""
    found = {name: table for name, table in tables.items() if name != topic}
    if topic in tables:
        frames = tables[topic].groupby(["parent", "child"], sort=True)
        found |= {f"{topic}#{parent}#{child}": table for (parent, child), table in frames}
    return found


def derive(
    tables: Tables, types: Mapping[str, str], namespace: str, fixed: Collection[str], row_options: RowOptions
) -> list[Signal]:
    """Returns the observations that can be computed from a recording.

    Args:
        tables: Tables of the recording, as returned by `by_frame`.
        types: Message types, indexed by topic.
        namespace: Namespace of the simulator.
        fixed: Names of joints that cannot move, which are left out.
        row_options: Content that the user chooses.

    Raises:
        UnknownNameError: If a feature, a gripper joint or the end effector's frame is not in the recording.
    """
    found = [
        *_states(tables, types, fixed, row_options),
        *_wrenches(tables, types, row_options),
        *_contacts(tables, types),
        *_poses(tables, namespace),
    ]
    if row_options.end_effector:
        columns = end_effector_columns(tables, namespace, row_options.end_effector)
        found.append(Signal(Feature(END_EFFECTOR, (*AXES, *QUATERNION)), columns))
    if row_options.features is None:
        return found
    names = {signal.feature.key: signal.feature.key.partition(".")[2] for signal in found}
    for pattern in row_options.features:
        if not fnmatch.filter(names.values(), pattern):
            raise UnknownNameError("feature", pattern, names.values())
    chosen = {
        key for key, name in names.items() if any(fnmatch.fnmatchcase(name, each) for each in row_options.features)
    }
    return [signal for signal in found if signal.feature.key in (*_ALWAYS, *chosen)]


def label(topic: str) -> str:
    """Converts the name of a topic to a part of a feature's key.

    The part `rpbi` of the name is removed, and characters other than letters and digits become `_`.
    """
    return re.sub(r"\W+", "_", "/".join(part for part in topic.split("/") if part != "rpbi")).strip("_")


def _states(
    tables: Tables, types: Mapping[str, str], fixed: Collection[str], row_options: RowOptions
) -> Iterator[Signal]:
    if row_options.state is not None:
        yield _generic(STATE, tables, row_options.state)
        return
    topics = [topic for topic in tables if types.get(topic) == JOINTS and STATES_NAME.fullmatch(topic)]
    for kind, key in zip(KINDS, (STATE, "observation.velocity", "observation.effort")):
        columns = [Column(topic, name) for topic in topics for name in joint_columns(tables[topic], kind, fixed)]
        if key == STATE and row_options.gripper:
            known = {joint_of(column): column for column in columns}
            for name in row_options.gripper:
                if name not in known:
                    raise UnknownNameError("joint of the gripper", name, known)
            gripper = tuple(known[name] for name in row_options.gripper)
            yield Signal(Feature(GRIPPER, names_of(gripper)), gripper)
            columns = [column for column in columns if column not in gripper]
        if columns:
            yield Signal(Feature(key, names_of(columns)), tuple(columns))


def _wrenches(tables: Tables, types: Mapping[str, str], row_options: RowOptions) -> Iterator[Signal]:
    used = {*(row_options.action or ()), *(row_options.state or ())}
    for topic in tables:
        if types.get(topic) == WRENCH and topic not in used and not ACTION_NAME.fullmatch(topic):
            columns = [Column(topic, f"wrench/{part}/{axis}") for part in ("force", "torque") for axis in AXES]
            names = tuple(f"{part}.{axis}" for part in ("force", "torque") for axis in AXES)
            yield Signal(Feature(f"observation.wrench.{label(topic)}", names), tuple(columns))


def _contacts(tables: Tables, types: Mapping[str, str]) -> Iterator[Signal]:
    for topic in tables:
        if types.get(topic) == CONTACTS:
            columns = tuple(Column(topic, f"force/{axis}") for axis in AXES)
            key = f"observation.contact_force.{label(topic.removesuffix('/contacts'))}"
            yield Signal(Feature(key, tuple(f"force.{axis}" for axis in AXES)), columns, "nearest")


def _poses(tables: Tables, namespace: str) -> Iterator[Signal]:
    """Yields the poses of all bodies, which are the child frames of the world frame without a slash in their names."""
    for name, table in _frames(tables, namespace).items():
        if "/" not in name:
            yield Signal(
                Feature(f"observation.pose.{label(table.rpartition('#')[2])}", (*AXES, *QUATERNION)),
                _pose_columns(table),
            )


def end_effector_columns(tables: Tables, namespace: str, frame: str) -> tuple[Column, ...]:
    """Returns the columns of a frame's pose in the world frame.

    Raises:
        UnknownNameError: If TF has no transform from the world frame to the frame.
    """
    frames = _frames(tables, namespace)
    name = frame.rpartition("rpbi/")[2]
    if name not in frames:
        raise UnknownNameError("frame on TF", frame, frames)
    return _pose_columns(frames[name])


def _frames(tables: Tables, namespace: str) -> dict[str, str]:
    """Returns the name of each table that has the poses of a frame in the world frame.

    The keys are the frames' names without prefix, such as `arm/tool`.
    """
    prefix = f"{namespace.strip('/')}/rpbi/".lstrip("/")
    found = {}
    for table in tables:
        _, _, frames = table.partition("#")
        parent, _, child = frames.partition("#")
        match = re.fullmatch(rf"(?:{re.escape(prefix)}|rpbi/)(.+)", child)
        if match and parent in (f"{prefix}world", "rpbi/world"):
            found[match[1]] = table
    return found


def _pose_columns(table: str) -> tuple[Column, ...]:
    return tuple(Column(table, name) for name in (*TRANSLATION, *ROTATION))


def _generic(key: str, tables: Tables, topics: Sequence[str]) -> Signal:
    columns = [Column(topic, name) for topic in topics for name in numbers_of(tables[topic])]
    return Signal(Feature(key, names_of(columns)), tuple(columns))


def numbers_of(table: pd.DataFrame) -> list[str]:
    """Returns the names of a table's numeric columns, except for header fields and the recording time."""
    return [
        name
        for name in table.columns
        if table[name].dtype.kind in "iufb" and name != RECORD_TIME and not name.startswith("header/")
    ]


def joint_of(column: Column) -> str:
    """Returns the joint name of a column of joint states."""
    return column.name.partition("/")[2]


def joint_columns(table: pd.DataFrame, kind: str, fixed: Collection[str]) -> list[str]:
    """Returns the names of the columns `KIND/JOINT`, except for fixed joints and columns without values."""
    names = [name for name in table.columns if name.startswith(f"{kind}/")]
    return [name for name in names if name.partition("/")[2] not in fixed and table[name].notna().any()]


def names_of(columns: Iterable[Column]) -> tuple[str, ...]:
    """Returns a name for each column: the joint name, or the path of the field if the column is not of joint states.

    If the names are not unique, each name is prefixed with the robot or topic.
    """
    columns = list(columns)
    short = [
        re.sub(rf"^({'|'.join(KINDS)})/(?!([xyzw]|covariance)$)", "", name).replace("/", ".") for _, name in columns
    ]
    if len(set(short)) == len(short):
        return tuple(short)
    robots = [label(_OF_ROBOT.sub("", table)) for table, _ in columns]
    return tuple(f"{robot}.{name}" for robot, name in zip(robots, short))
