"""The scene of an EXOTica problem: the robot, its joint group, and additional frames."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import NamedTuple

from custom_ros_tools.errors import ConfigError, Problem, UnknownNameError
from custom_ros_tools.schema import KeyedError
from ik_ros.problem import AttachedFrame
from robot_model.geometry import Pose
from robot_model.model import RobotModel
from robot_model.urdf.document import UrdfDocument
from robot_model.urdf.elements import Element

from .elements import SceneConfig


class OnLink(NamedTuple):
    """A frame that is attached to a moving link of the robot.

    Attributes:
        link: Name of the link.
        pose: Pose of the frame in the link.
    """

    link: str
    pose: Pose


@contextmanager
def errors_of(key: str) -> Iterator[None]:
    """Context that converts a `ValueError` or `UnknownNameError` to a `KeyedError` for the key `key`."""
    try:
        yield
    except KeyedError:
        raise
    except (UnknownNameError, ValueError) as error:
        raise KeyedError(key, str(error)) from None


class ExoticaScene:
    """The robot of a problem, the joints of its joint group, and the additional frames of the scene.

    Args:
        config: The scene, as read from XML.

    Attributes:
        robot: The robot.
        joints: Names of the n moving joints in the group.

    Raises:
        KeyedError: If a field does not fit the robot; the error names the field.
        ConfigError: If the URDF or SRDF file cannot be read.
    """

    def __init__(self, config: SceneConfig) -> None:
        self.robot = RobotModel(config.URDF)
        srdf = UrdfDocument(config.SRDF).root
        self._world_names = _world_names(srdf, config.SRDF)
        with errors_of("JointGroup"):
            members = _joints_of_group(srdf, config.JointGroup, self.robot)
        self.joints = tuple(name for name in self.robot.joint_names if name in members)
        if not self.joints:
            raise KeyedError("JointGroup", f"'{config.JointGroup}' has no joint that moves")
        self._attached: dict[str, AttachedFrame] = {}
        for link in config.Links:
            if link.Name in self.robot.links or link.Name in self._attached:
                raise KeyedError("Links", f"there is another frame '{link.Name}'")
            self._attached[link.Name] = AttachedFrame(link.Parent, link.Transform)
        for name in self._attached:
            with errors_of(f"Links.{name}"):
                self.place(name)

    def place(self, name: str, frames: Mapping[str, AttachedFrame] | None = None) -> OnLink | Pose:
        """Returns where a frame is: on a moving link of the robot, or at a fixed pose.

        Args:
            name: Name of a link, or of a frame of the scene; empty for the root.
            frames: Frames with a parent that differs from the XML, indexed by frame name.

        Returns:
            For a moving frame, the link and the frame's pose in it. For a fixed frame, the frame's pose in the root.

        Raises:
            UnknownNameError: If the frame, or a frame that it is attached to, does not exist.
            ValueError: If frames are attached to each other in a loop.
        """
        attached = {**self._attached, **(frames or {})}
        pose, seen = Pose(), set()
        while name in attached:
            if name in seen:
                raise ValueError(f"the frame '{name}' is attached to itself")
            seen.add(name)
            pose = attached[name].pose @ pose
            name = attached[name].parent
        if name == "" or name in self._world_names:
            return pose
        if name not in self.robot.links:
            raise UnknownNameError("frame", name, (*self.robot.links, *attached))
        if any(joint.is_moving for joint in self.robot.chain(name)):
            return OnLink(name, pose)
        return self.robot.pose([0.0] * len(self.robot.joint_names), name) @ pose

    def fixed(self, name: str, frames: Mapping[str, AttachedFrame] | None = None) -> Pose:
        """Returns the pose of a fixed frame in the robot's root frame; see `place`.

        Raises:
            UnknownNameError: If the frame does not exist.
            ValueError: If joints move the frame.
        """
        place = self.place(name, frames)
        if isinstance(place, OnLink):
            raise ValueError(f"expected a frame that no joint moves, got '{name}'")
        return place

    def moving(self, name: str) -> OnLink:
        """Returns the link that a frame moves with, and the frame's pose in the link; see `place`.

        Raises:
            UnknownNameError: If the frame does not exist.
            ValueError: If the frame is fixed.
        """
        place = self.place(name)
        if not isinstance(place, OnLink):
            raise ValueError(f"expected a frame that joints move, got '{name}'")
        return place

    def check_attached(self, frames: Mapping[str, AttachedFrame]) -> None:
        """Checks the frames that a problem attaches to a new parent.

        Args:
            frames: The frames, indexed by frame name.

        Raises:
            UnknownNameError: If the scene lacks one of the frames or of their parents.
            ValueError: If a frame moves with the robot, either in the XML or with the new parent.
        """
        for name in frames:
            if name not in self._attached:
                raise UnknownNameError("frame of the scene", name, self._attached)
            if isinstance(self.place(name), OnLink) or isinstance(self.place(name, frames), OnLink):
                raise ValueError(f"the frame '{name}' cannot be attached at run time to what joints move")


def _world_names(srdf: Element, file: str) -> set[str]:
    """Returns the names of the parent frames of the SRDF's virtual joints. All stand for the robot's root frame."""
    names = set()
    for joint in srdf.iter("virtual_joint"):
        if joint.get("type") != "fixed":
            message = f"virtual joint '{joint.get('name')}': expected type fixed, got {joint.get('type')}"
            raise ConfigError([Problem(file, "", f"{message}; use the solver 'tasks' for a base that floats")])
        names.add(joint.get("parent_frame", ""))
    return names


def _joints_of_group(srdf: Element, name: str, robot: RobotModel, inside: tuple[str, ...] = ()) -> set[str]:
    """Returns the names of all joints of a group in the SRDF, fixed joints included.

    Args:
        srdf: Top element of the SRDF.
        name: Name of the group.
        robot: The robot.
        inside: Names of the groups that contain this group, to detect a group that contains itself.
    """
    groups = {group.get("name", ""): group for group in srdf.findall("group")}
    if name not in groups:
        raise UnknownNameError("group of the SRDF", name, groups)
    if name in inside:
        raise ValueError(f"the group '{name}' is in itself")
    joints: set[str] = set()
    for part in groups[name]:
        value = part.get("name", "")
        if part.tag == "chain":
            base = {joint.name for joint in robot.chain(robot.check_link(part.get("base_link", "")))}
            tip = robot.chain(robot.check_link(part.get("tip_link", "")))
            joints |= {joint.name for joint in tip} - base
        elif part.tag == "joint":
            if value not in robot.all_joints:
                raise UnknownNameError("joint", value, robot.all_joints)
            joints.add(value)
        elif part.tag == "link":
            joints |= {joint.name for joint in robot.chain(robot.check_link(value))[-1:]}
        elif part.tag == "group":
            joints |= _joints_of_group(srdf, value, robot, (*inside, name))
    return joints
