"""The scene of an EXOTica problem: the robot's joints, and frames on it and around it."""

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
    """A frame that moves with a link of the robot.

    Attributes:
        link: The link.
        pose: Its pose in the link.
    """

    link: str
    pose: Pose


@contextmanager
def errors_of(key: str) -> Iterator[None]:
    """Converts a `ValueError` or an unknown name to a `KeyedError` of a key."""
    try:
        yield
    except KeyedError:
        raise
    except (UnknownNameError, ValueError) as error:
        raise KeyedError(key, str(error)) from None


class ExoticaScene:
    """The robot of a problem, the joints of its group, and the frames of the scene.

    Args:
        config: The scene as the XML has it.

    Attributes:
        robot: The robot.
        joints: The n joints of the group.

    Raises:
        KeyedError: If something does not fit the robot.
        ConfigError: If URDF or SRDF cannot be read.
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
        """Returns the location of a frame: on a moving link, or fixed as a pose in the robot's root.

        Args:
            name: A link of the robot, a frame of the scene, or empty for the root.
            frames: Frames of the scene that have been attached elsewhere.

        Raises:
            UnknownNameError: If there is no such frame.
            ValueError: If frames are attached in a circle.
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
        """Returns the pose of a frame in the robot's root.

        Raises:
            UnknownNameError: If there is no such frame.
            ValueError: If joints move it.
        """
        place = self.place(name, frames)
        if isinstance(place, OnLink):
            raise ValueError(f"expected a frame that no joint moves, got '{name}'")
        return place

    def moving(self, name: str) -> OnLink:
        """Returns the link that a frame moves with.

        Raises:
            UnknownNameError: If there is no such frame.
            ValueError: If no joint moves it.
        """
        place = self.place(name)
        if not isinstance(place, OnLink):
            raise ValueError(f"expected a frame that joints move, got '{name}'")
        return place

    def check_attached(self, frames: Mapping[str, AttachedFrame]) -> None:
        """Checks frames of a problem.

        Raises:
            UnknownNameError: If the scene lacks one of them, or the object that it is attached to.
            ValueError: If joints would move one; frames on the robot are those of the XML.
        """
        for name in frames:
            if name not in self._attached:
                raise UnknownNameError("frame of the scene", name, self._attached)
            if isinstance(self.place(name), OnLink) or isinstance(self.place(name, frames), OnLink):
                raise ValueError(f"the frame '{name}' cannot be attached at run time to what joints move")


def _world_names(srdf: Element, file: str) -> set[str]:
    """Returns the SRDF's names of the frame in which the root is fixed."""
    names = set()
    for joint in srdf.iter("virtual_joint"):
        if joint.get("type") != "fixed":
            message = f"virtual joint '{joint.get('name')}': expected type fixed, got {joint.get('type')}"
            raise ConfigError([Problem(file, "", f"{message}; use the solver 'tasks' for a base that floats")])
        names.add(joint.get("parent_frame", ""))
    return names


def _joints_of_group(srdf: Element, name: str, robot: RobotModel, inside: tuple[str, ...] = ()) -> set[str]:
    """Returns the joints of a group, fixed ones included."""
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
