"""The commands from `list` to `gravity`: the running world by plain command lines."""

import argparse
import math
import re
import sys
import time
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import rospy
from cob_srvs.srv import SetString
from custom_srvs.srv import SetTransform
from geometry_msgs.msg import Quaternion, Transform, Twist, Vector3, Wrench
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from custom_ros_tools.config import config_to_str, load_config
from custom_ros_tools.errors import InterfaceError, UnknownNameError
from custom_ros_tools.transforms import quat_of
from ros_pybullet_interface.msg import Attachment, CalculateInverseKinematicsProblem, PybulletObject
from ros_pybullet_interface.srv import (
    AddPybulletObject,
    ApplyWrench,
    Attach,
    ResetEffState,
    ResetJointState,
    RobotInfo,
    SetGravity,
)
from rpbi.config.asset_files import find_file
from rpbi.config.object_entry import FILE

from .running_simulator import RunningSimulator

KINDS = ("visual", "collision", "dynamic", "robot", "urdf", "soft")
"""Types of objects, which PybulletObject has as numbers."""
CAMERA = "camera"
SEND_HZ = 50.0
CONNECT_S = 5.0
"""How long to wait until the simulator listens [s]."""
_NEGATIVE = re.compile(r"-[\d.]")


def main(argv: Sequence[str] | None = None) -> int:
    """Runs one of the commands, by default with the arguments of the process.

    Returns:
        The exit code: 0, or 1 with what is wrong on stderr.
    """
    # Words of ROS such as __name:=x are not ours; rospy.myargv would drop JOINT:=VALUE, too
    words = [word for word in sys.argv[1:] if not word.startswith("__")] if argv is None else argv
    # To argparse, a word with a space before it is no option
    arguments = _parser().parse_args([f" {word}" if _NEGATIVE.match(word) else word for word in words])
    try:
        print(arguments.run(RunningSimulator(arguments.ns), arguments))
    except (InterfaceError, ValueError, OSError) as error:
        print(f"{arguments.command}: {error}", file=sys.stderr)
        return 1
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="./rpbi", description="Asks something of the running world.")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)

    def add(name: str, run: Any, purpose: str) -> argparse.ArgumentParser:
        command = commands.add_parser(name, help=purpose, description=purpose)
        command.add_argument("--ns", metavar="NAMESPACE", help="of the simulator")
        command.set_defaults(run=run)
        return command

    add("list", _list, "Lists what is in the running world.")

    spawn = add("spawn", _spawn, "Puts an object, a robot or a camera into the running world.")
    spawn.add_argument("file", metavar="FILE", help="YAML or URDF")
    spawn.add_argument("--name", help="another name than in the file")
    spawn.add_argument("--at", nargs=3, type=number, metavar=("X", "Y", "Z"), help="where [m]")
    spawn.add_argument("--rpy", nargs=3, type=number, metavar=("R", "P", "Y"), help="how turned [rad], or as 90deg")
    spawn.add_argument("--type", choices=(*KINDS, CAMERA), help="without it, the keys of the file decide")

    remove = add("remove", _remove, "Takes objects or cameras out of the running world.")
    remove.add_argument("names", nargs="+", metavar="NAME")

    move = add("move", _move, "Moves a robot in a given time, or puts an object somewhere at once.")
    move.add_argument("name", metavar="NAME", help="a robot, a link as ROBOT/LINK, or an object")
    move.add_argument("goal", nargs="*", metavar="GOAL", help="JOINT:=POSITION ..., or X Y Z [ROLL PITCH YAW]")
    move.add_argument("--in", dest="duration_s", type=number, default=2.0, metavar="S", help="how long it takes [s]")
    instead = move.add_mutually_exclusive_group()
    instead.add_argument("--home", action="store_true", help="to where its joints started")
    instead.add_argument("--stop", action="store_true", help="ends a motion")

    send = add("send", _send, "Sends targets to joints, a velocity to a base, or a force to anything.")
    send.add_argument("name", metavar="NAME", help="a robot, an object, or a link as OBJECT/LINK")
    send.add_argument("targets", nargs="*", metavar="JOINT:=VALUE")
    what = send.add_mutually_exclusive_group()
    what.add_argument("--velocity", action="store_true", help="the values are velocities")
    what.add_argument("--effort", action="store_true", help="the values are efforts")
    what.add_argument("--drive", nargs=3, type=number, metavar=("VX", "VY", "TURN"), help="[m/s, m/s, rad/s]")
    what.add_argument("--push", nargs=3, type=number, metavar=("FX", "FY", "FZ"), help="[N], in the world's axes")
    send.add_argument("--for", dest="duration_s", type=number, default=1.0, metavar="S", help="how long [s]")

    attach = add("attach", _attach, "Holds one thing to another, until it is detached or breaks off.")
    attach.add_argument("child", metavar="CHILD", help="what is held: an object, or a link as OBJECT/LINK")
    attach.add_argument("parent", metavar="PARENT", help="what holds it, likewise")
    attach.add_argument("--name", help="by which it is detached; without it, the child's")
    attach.add_argument("--ball", action="store_true", help="the position alone is held")
    attach.add_argument("--max-force", type=number, default=0.0, metavar="N", help="beyond it, it breaks off [N]")

    detach = add("detach", _detach, "Lets go of what was attached.")
    detach.add_argument("names", nargs="+", metavar="NAME")

    gravity = add("gravity", _gravity, "Changes gravity, until the next reset.")
    for axis in "xyz":
        gravity.add_argument(axis, type=number, metavar=axis.upper(), help="[m/s^2]")
    return parser


# --- The commands; each returns what to print


def _list(simulator: RunningSimulator, _: argparse.Namespace) -> str:
    objects = simulator.objects()
    width = max(map(len, objects), default=0)
    return "\n".join(f"{name:<{width}}  {kind}" for name, kind in objects.items()) or "nothing"


def _spawn(simulator: RunningSimulator, arguments: argparse.Namespace) -> str:
    path = find_file(arguments.file, str(Path.cwd() / FILE))
    is_urdf = Path(path).suffix == ".urdf"
    data = _urdf_object(path, arguments.type) if is_urdf else load_config(path)
    kind = arguments.type or kind_in(data)
    changes = {} if arguments.name is None else {"name": arguments.name}
    changes |= _placement(data, arguments.at, arguments.rpy)
    if kind == CAMERA:
        if arguments.at or arguments.rpy:
            raise InterfaceError(f"{arguments.file}: a camera is where its object_tf says, not --at or --rpy")
        return str(simulator.call("rpbi/add_rgbd_sensor", SetString, config_to_str({FILE: path, **changes})).message)
    asked = PybulletObject(object_type=getattr(PybulletObject, kind.upper()))
    if is_urdf:
        asked.config = config_to_str(
            {**data, **changes, "loadURDF": {**data["loadURDF"], **changes.get("loadURDF", {})}}
        )
    elif changes:
        asked.config = config_to_str({FILE: path, **changes})
    else:
        asked.filename = path
    return str(simulator.call("rpbi/add_pybullet_object", AddPybulletObject, asked).message)


def _remove(simulator: RunningSimulator, arguments: argparse.Namespace) -> str:
    objects = simulator.objects()
    for name in arguments.names:
        if name not in objects:
            raise UnknownNameError("object", name, list(objects))
    return "\n".join(simulator.call("rpbi/remove_pybullet_object", SetString, name).message for name in arguments.names)


def _move(simulator: RunningSimulator, arguments: argparse.Namespace) -> str:
    body, _, link = arguments.name.partition("/")
    duration_s = arguments.duration_s
    if arguments.stop or arguments.home:
        if arguments.goal or link:
            raise InterfaceError(f"--{'stop' if arguments.stop else 'home'} takes the name of a robot and nothing else")
        if arguments.stop:
            return str(simulator.call(simulator.require(body, "stop_motion", "a robot"), Trigger).message)
        home = simulator.require(body, "move_to_initial_joint_state", "a robot")
        return str(simulator.call(home, ResetJointState, JointState(), duration_s).message)
    if any(":=" in word for word in arguments.goal):
        move = simulator.require(body, "move_to_joint_state", "a robot")
        goal = _joint_values(simulator, body, arguments.goal)
        state = JointState(name=list(goal), position=list(goal.values()))
        return str(simulator.call(move, ResetJointState, state, duration_s).message)
    if len(arguments.goal) not in (3, 6):
        expected = "JOINT:=POSITION ..., X Y Z, X Y Z ROLL PITCH YAW, --home or --stop"
        raise InterfaceError(f"expected {expected}; got {' '.join(map(str.strip, arguments.goal)) or 'nothing'}")
    numbers = list(map(number, arguments.goal))
    quat = quat_of(numbers[3:]).tolist() if numbers[3:] else []
    if link:
        move = simulator.require(body, "move_to_eff_state", "a robot")
        problem = CalculateInverseKinematicsProblem(
            link_name=link, targetPosition=numbers[:3], targetOrientation=quat, residualThreshold=1e-5
        )
        return str(simulator.call(move, ResetEffState, problem, duration_s).message)
    pose = Transform(Vector3(*numbers[:3]), Quaternion(*(quat or (0.0, 0.0, 0.0, 1.0))))
    return str(simulator.call(simulator.require(body, "set_pose", "an object"), SetTransform, pose).message)


def _send(simulator: RunningSimulator, arguments: argparse.Namespace) -> str:
    body, _, link = arguments.name.partition("/")
    duration_s = arguments.duration_s
    if (arguments.drive or arguments.push) and arguments.targets:
        raise InterfaceError(
            f"expected --drive, --push or targets of joints, got {' '.join(arguments.targets)} as well"
        )
    if arguments.push:
        push = Wrench(force=Vector3(*arguments.push))
        fields = {"object_name": arguments.name, "wrench": push, "frame": "world", "duration": duration_s}
        return str(simulator.call("rpbi/apply_wrench", ApplyWrench, **fields).message)
    if link:
        raise InterfaceError(f"'{arguments.name}': only --push takes a link")
    if arguments.drive:
        topic = simulator.require(body, "cmd_vel", "a robot with planar_base")
        vx, vy, turn = arguments.drive
        _publish(simulator, topic, Twist(Vector3(vx, vy, 0.0), Vector3(z=turn)), duration_s, Twist())
        return f"drove for {duration_s:g} s"
    topic = simulator.require(body, "joint_states/target", "a robot")
    targets = _joint_values(simulator, body, arguments.targets)
    names, values = list(targets), list(targets.values())
    if arguments.velocity or arguments.effort:
        field = "velocity" if arguments.velocity else "effort"
        still = JointState(name=names, **{field: [0.0] * len(names)})
        _publish(simulator, topic, JointState(name=names, **{field: values}), duration_s, still)
        return f"sent for {duration_s:g} s"
    _publish(simulator, topic, JointState(name=names, position=values))
    return "sent"


def _attach(simulator: RunningSimulator, arguments: argparse.Namespace) -> str:
    attachment = Attachment(
        name=arguments.name or arguments.child.partition("/")[0],
        parent=arguments.parent,
        child=arguments.child,
        kind="ball" if arguments.ball else "fixed",
        max_force=arguments.max_force,
    )
    return str(simulator.call("rpbi/attach", Attach, attachment).message)


def _detach(simulator: RunningSimulator, arguments: argparse.Namespace) -> str:
    return "\n".join(simulator.call("rpbi/detach", SetString, name).message for name in arguments.names)


def _gravity(simulator: RunningSimulator, arguments: argparse.Namespace) -> str:
    return str(simulator.call("rpbi/set_gravity", SetGravity, Vector3(arguments.x, arguments.y, arguments.z)).message)


# --- What they are made of


def kind_in(data: Mapping[str, Any]) -> str:
    """Returns what kind of thing an object's YAML describes, by the keys that only this kind has."""
    if "intrinsics" in data:
        return CAMERA
    if "loadSoftBody" in data:
        return "soft"
    if "loadURDF" in data:
        is_robot = {"setJointMotorControlArray", "is_visual_robot"} & data.keys()
        return "robot" if is_robot else "urdf"
    if "baseMass" in data:
        return "dynamic"
    return "collision" if "createCollisionShape" in data else "visual"


def _urdf_object(path: str, kind: str | None) -> dict[str, Any]:
    """Returns the YAML of a URDF that has none."""
    name = re.sub(r"\W", "_", Path(path).stem)
    if kind != "robot":
        return {"name": name, "loadURDF": {"fileName": path}}
    motors = {"controlMode": "POSITION_CONTROL"}
    return {"name": name, "loadURDF": {"fileName": path, "useFixedBase": True}, "setJointMotorControlArray": motors}


def _placement(data: Mapping[str, Any], at: list[float] | None, rpy: list[float] | None) -> dict[str, Any]:
    """Returns the keys by which an object is put somewhere, where its kind has them."""
    keys: dict[str, Any] = {} if at is None else {"basePosition": at}
    if rpy is not None:
        keys["baseOrientation"] = quat_of(rpy).tolist()
    inner = next((key for key in ("loadURDF", "loadSoftBody") if key in data), None)
    return {inner: keys} if inner and keys else keys


def _joint_values(simulator: RunningSimulator, robot: str, words: Sequence[str]) -> dict[str, float]:
    """Returns values by joint, from words like `JOINT:=VALUE`."""
    known = simulator.call(simulator.require(robot, "robot_info", "a robot"), RobotInfo).current_joint_state.name
    values = {}
    for word in words:
        joint, is_value, value = word.partition(":=")
        if not is_value:
            raise InterfaceError(f"expected JOINT:=VALUE, got {word.strip()}")
        if joint not in known:
            raise UnknownNameError("joint", joint, known)
        values[joint] = number(value)
    if not values:
        raise InterfaceError(f"expected JOINT:=VALUE ...; the joints of '{robot}' are {', '.join(known)}")
    return values


def number(text: str) -> float:
    """Returns a number; `30deg` is one in radians.

    Raises:
        ValueError: If it is none, or not finite.
    """
    is_angle = text.endswith("deg")
    try:
        number = float(text.removesuffix("deg"))
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise ValueError(f"expected a number, got {text.strip()}")
    return math.radians(number) if is_angle else number


def _publish(simulator: RunningSimulator, topic: str, message: Any, duration_s: float = 0.0, last: Any = None) -> None:
    """Sends a message once, or again and again for a time [s] of the wall clock and then the last one."""
    rospy.init_node("rpbi_world", anonymous=True, disable_signals=True, disable_rostime=True)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # without a queue, a message has gone when `publish` returns
            publisher = rospy.Publisher(simulator.full_name(topic), type(message), queue_size=None)
        end_s = time.monotonic() + CONNECT_S
        while not publisher.get_num_connections():
            if time.monotonic() > end_s:
                raise InterfaceError(f"the simulator does not listen to {simulator.full_name(topic)}")
            time.sleep(0.01)
        publisher.publish(message)
        end_s = time.monotonic() + duration_s
        while last is not None and time.monotonic() < end_s:
            time.sleep(min(1.0 / SEND_HZ, duration_s))
            publisher.publish(message if time.monotonic() < end_s else last)
    finally:
        rospy.signal_shutdown("sent")
