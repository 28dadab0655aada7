"""The command `launch`: runs an example, a user's world or a launch file."""

from __future__ import annotations

import argparse
import re
import sys
import threading
import time
from collections.abc import Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import rosgraph
import roslaunch
from rosgraph.network import parse_http_host_and_port
from roslaunch.arg_dump import get_args
from roslaunch.parent import ROSLaunchParent
from roslaunch.pmon import ProcessListener
from roslaunch.rlutil import resolve_launch_arguments

from custom_ros_tools.config import load_config
from custom_ros_tools.console.argument import Argument
from custom_ros_tools.console.modules import workspace
from custom_ros_tools.errors import InterfaceError, UnknownNameError
from custom_ros_tools.foreign import printable_lines
from custom_ros_tools.ros.lifecycle.timed_master import unused_port
from robot_model.asset_files import find_file
from rpbi_examples.ros.running_simulators import (
    clocks,
    master_of,
    running_simulators,
    simulator_namespace,
)

WORLDS = (".yaml", ".yml")
WORLD = "world"
"""Name of the launch file that runs a user's world."""
PRINTS = ("--files", "--args", "--nodes", "--find-node", "--dump-params", "--ros-args")
"""Options with which `roslaunch` only prints information and does not start nodes."""
ANNOUNCE_PERIOD_S = 0.5
_COMMENT = re.compile(r"<!--\s*(.*?)\s*-->", re.DOTALL)


def launch(
    example: Annotated[str, Argument("EXAMPLE", offers="examples", files="*.@(launch|yaml)", is_raw=True)] = "",
    *arguments: Annotated[str, Argument("[ARGUMENT ...]", offers="launch_arguments", is_raw=True)],
) -> int:
    """Runs an example, a world file or a launch file until Ctrl-C. Without a name, lists the examples.

    Arguments that the launch file does not declare are rejected; the message lists the declared arguments. The exit
    code is 1 if a node with required="true" has ended with an error.

    ROS stops a running node when another node with the same name starts. Therefore, a second simulator with the same
    name is rejected. Start the second simulator on a separate ROS master, or start both simulators in namespaces.
    Use separate masters for examples, since TF frames of examples have the same names. Only world files, which
    `world.launch` runs, have a prefix for TF frames:

        ./rpbi launch grasp_example -p 11312
        export ROS_MASTER_URI=http://localhost:11312      # in each terminal that uses this master
        ./rpbi launch world.yaml --ns left                # two world files on one master
        ./rpbi launch world.yaml --ns right

    Usage:
        ./rpbi launch [EXAMPLE | WORLD.yaml | FILE.launch | PACKAGE FILE.launch [NAME:=VALUE ...]]

    Args:
        NAME:=VALUE: value of an argument of the launch file; most examples have headless, rviz, gui,
            real_time_factor and start; world files also have controls
        --ns NAMESPACE: runs all nodes in this namespace and with wall time; TF frames of a world file get the
            prefix NAMESPACE
        --replace: stops a running simulator with the same name and its roslaunch, and waits until both have ended
        -p PORT: port of a separate ROS master on this machine
        --ros-args: lists the arguments of the launch file and their meanings
        --screen: shows the output of all nodes; other options of roslaunch are also accepted
    """
    given = [example, *arguments] if example else []
    examples = {path.stem: path for path in sorted((workspace() / "src/rpbi_examples/launch").glob("*.launch"))}
    if not given:
        print("Examples, for ./rpbi launch EXAMPLE [name:=value ...]; --ros-args instead of values lists the names:")
        for name, path in examples.items():
            print(f"  {name:<28} {_purpose(path)}")
        return 0
    options, (name, *rest) = _options().parse_known_args(given)
    try:
        if name.endswith(WORLDS):
            name, rest = WORLD, [f"config:={name}", *_controls_of(name, rest), *rest]
        file, rest = _launch_file(name, rest, examples)
        known = sorted(get_args([str(file)]))
        _check_arguments(file, rest, known)
        rest += _arguments_of(options, rest, known)
        sys.argv = ["roslaunch", str(file), *rest]  # roslaunch takes values of arguments from there
        if not any(argument.partition("=")[0] in PRINTS for argument in rest):
            _make_way(file, options)
    except (InterfaceError, roslaunch.RLException) as error:
        print(f"launch: {printable_lines(str(error))}", file=sys.stderr)
        return 2
    parents: list[_Parent] = []
    roslaunch.parent.ROSLaunchParent = partial(_Parent, parents)  # roslaunch itself returns 0 whatever happened
    roslaunch.main(sys.argv)
    return int(any(parent.has_failed for parent in parents))


def _launch_file(name: str, rest: list[str], examples: Mapping[str, Path]) -> tuple[Path, list[str]]:
    """Finds the launch file to run.

    Args:
        name: Name of an example or a package, or path of a launch file.
        rest: Words after `name` on the command line. For a package, the first word is its launch file.
        examples: Launch files of the examples, indexed by name.

    Returns:
        The launch file, and the remaining words.

    Raises:
        UnknownNameError: If `name` is neither a launch file nor an example, and the next word is not a launch file.
        RLException: If the package does not exist, or does not have the file.
    """
    if name.endswith(".launch") and Path(name).is_file():
        return Path(name), rest
    if name.removesuffix(".launch") in examples:
        return examples[name.removesuffix(".launch")], rest
    if rest and rest[0].endswith(".launch"):
        return Path(resolve_launch_arguments([name, rest[0]])[0]), rest[1:]
    raise UnknownNameError("example", name, list(examples))


class _Parent(ROSLaunchParent, ProcessListener):
    """A roslaunch parent that records whether a required node has ended with an error.

    Args:
        parents: List to which the new `_Parent` appends itself.
    """

    def __init__(self, parents: list[_Parent], *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, process_listeners=[self], **options)
        self.has_failed = False
        self._usual_master = rosgraph.get_master_uri()
        parents.append(self)

    def start(self, *arguments: Any, **options: Any) -> None:
        """Starts the nodes. Also starts a thread that prints a line when a simulator is running."""
        super().start(*arguments, **options)
        threading.Thread(target=self._announce, daemon=True).start()

    def _announce(self) -> None:
        """Waits until a simulator is running, and prints the commands for a running world."""
        nodes = {rosgraph.names.ns_join(node.namespace, node.name) for node in self.config.nodes}
        while self.pm is not None and not self.pm.is_shutdown:
            if (namespace := simulator_namespace(nodes, self.config.master.uri)) is not None:
                option = f" --ns {namespace}" if namespace else ""
                uri = self.config.master.uri
                ports = {parse_http_host_and_port(each)[1] for each in (uri, self._usual_master)}
                master = f", with ROS_MASTER_URI={uri}" if len(ports) > 1 else ""
                print(f"running: ./rpbi list, move, view{option}{master}", flush=True)
                return
            time.sleep(ANNOUNCE_PERIOD_S)

    def process_died(self, process_name: str, exit_code: int | None) -> None:
        """Records whether a required node has ended with an error. A process is named NODE-NUMBER."""
        required = {f"{node.namespace}{node.name}".strip("/") for node in self.config.nodes if node.required}
        self.has_failed |= bool(exit_code) and process_name.rpartition("-")[0] in required


def _controls_of(world: str, given: Iterable[str]) -> list[str]:
    """Returns the launch arguments that correspond to the key `controls` of a world's file.

    The list is empty if the given arguments already have `controls`. It is also empty if the file cannot be loaded; the
    simulator reports the error then.
    """
    try:
        config = load_config(find_file(world, str(Path.cwd() / world)))
    except (InterfaceError, ValueError):
        return []
    controls = config.get("controls")
    if not isinstance(controls, Mapping) or any(argument.startswith("controls:=") for argument in given):
        return []
    robot = controls.get("robot_name")
    return ["controls:=true", *([f"controls_robot:={robot}"] if robot else [])]


def _purpose(path: Path) -> str:
    """Returns the first comment of a launch file as one line."""
    comment = _COMMENT.search(path.read_text(encoding="utf-8"))
    return " ".join(comment[1].split()) if comment else ""


def _options() -> argparse.ArgumentParser:
    """Returns the parser of the options that `launch` itself interprets."""
    parser = argparse.ArgumentParser(prog="launch", add_help=False, allow_abbrev=False)
    parser.add_argument("--ns")
    parser.add_argument("--replace", action="store_true")
    parser.add_argument("-p", "--port", type=int)
    return parser


def _check_arguments(path: Path, arguments: Iterable[str], known: Iterable[str]) -> None:
    """Raises an UnknownNameError for an argument that the launch file does not declare. roslaunch would ignore it."""
    for argument in arguments:
        name, is_given, _ = argument.partition(":=")
        if is_given and name not in known and not name.startswith("_"):  # reserved by ROS, such as __ns
            raise UnknownNameError(f"argument of {path.stem}", name, known)


def _arguments_of(options: argparse.Namespace, given: Iterable[str], known: Iterable[str]) -> list[str]:
    """Translates options of `launch` to arguments for roslaunch.

    Args:
        options: Parsed options.
        given: Arguments from the command line, which take precedence.
        known: Names of the arguments that the launch file declares.
    """
    added = [] if options.port is None else ["-p", str(options.port)]
    if options.ns is None:
        return added
    namespace = options.ns.strip("/")
    # a master has one clock, and TF has no namespaces
    values = {"tf_prefix": namespace, "use_sim_time": "false"}
    names = {argument.partition(":=")[0] for argument in given}
    missing = [f"{name}:={value}" for name, value in values.items() if name in known and name not in names]
    return [*added, f"__ns:=/{namespace}", *missing]


def _make_way(file: Path, options: argparse.Namespace) -> None:
    """Checks that the launch would not stop a running simulator. With `--replace`, stops such a simulator first.

    Raises:
        InterfaceError: If the launch would stop a simulator, and `--replace` is not given. Also if `--ns` is given
            although a node on the same master publishes `/clock`.
    """
    master = master_of(options.port)
    if options.ns is not None and (clock := clocks(master)):
        raise InterfaceError(
            f"{clock[0].name} is the clock of the ROS master at {master}: for --ns, run both with use_sim_time:=false, "
            f"or use a master of its own with -p {unused_port()}"
        )
    for simulator in running_simulators(str(file), master):
        if not options.replace:
            raise InterfaceError(
                f"{simulator.name} runs already on the ROS master at {master}, and this would stop it: run this on a "
                f"master of its own with -p {unused_port()}, or in a namespace with --ns NAME if both have "
                "use_sim_time:=false; --replace stops the one that runs"
            )
        simulator.stop(master)
