"""The command `launch`: runs an example or a launch file when all of its arguments are arguments of its launch file."""

import argparse
import re
import sys
from collections.abc import Iterable
from pathlib import Path

import roslaunch
from roslaunch.arg_dump import get_args

from custom_ros_tools.errors import InterfaceError, UnknownNameError
from custom_ros_tools.ros.lifecycle.timed_master import unused_port

from .running_simulators import clocks, master_of, running_simulators

WORLDS = (".yaml", ".yml")
WORLD = "world"
"""Launch file that runs a world of the user's."""
PRINTS = ("--files", "--args", "--nodes", "--find-node", "--dump-params", "--ros-args")
"""Options of `roslaunch` with which it prints something and starts nothing."""
_COMMENT = re.compile(r"<!--\s*(.*?)\s*-->", re.DOTALL)


def main() -> int:
    """Runs the command; its first argument is the folder of the launch files. Without others, it lists the examples.

    Returns:
        The exit code: 2 if there is no such example or argument, else that of roslaunch.
    """
    _, folder, *given = sys.argv
    examples = {path.stem: path for path in sorted(Path(folder).glob("*.launch"))}
    if not given:
        print("Examples, for ./rpbi launch EXAMPLE [name:=value ...]; --ros-args instead of values lists the names:")
        for name, path in examples.items():
            print(f"  {name:<28} {_purpose(path)}")
        return 0
    options, (name, *arguments) = _options().parse_known_args(given)
    try:
        if name.endswith(WORLDS):
            name, arguments = WORLD, [f"config:={name}", *arguments]
        is_file = name.endswith(".launch") and Path(name).is_file()
        file = Path(name) if is_file else examples.get(name.removesuffix(".launch"))
        if file is None:
            raise UnknownNameError("example", name, list(examples))
        known = sorted(get_args([str(file)]))
        _check_arguments(file, arguments, known)
        arguments += _arguments_of(options, arguments, known)
        sys.argv = ["roslaunch", str(file), *arguments]  # roslaunch takes values of arguments from there
        if not any(argument.partition("=")[0] in PRINTS for argument in arguments):
            _make_way(file, options)
    except (InterfaceError, roslaunch.RLException) as error:
        print(f"launch: {error}", file=sys.stderr)
        return 2
    roslaunch.main(sys.argv)
    return 0


def _purpose(path: Path) -> str:
    """Returns what the first comment of a launch file says."""
    comment = _COMMENT.search(path.read_text(encoding="utf-8"))
    return " ".join(comment[1].split()) if comment else ""


def _options() -> argparse.ArgumentParser:
    """Returns the parser of the options that are not roslaunch's alone."""
    parser = argparse.ArgumentParser(prog="launch", add_help=False, allow_abbrev=False)
    parser.add_argument("--ns")
    parser.add_argument("--replace", action="store_true")
    parser.add_argument("-p", "--port", type=int)
    return parser


def _check_arguments(path: Path, arguments: Iterable[str], known: Iterable[str]) -> None:
    """Raises an UnknownNameError for an argument that a launch file lacks, which roslaunch would take no notice of."""
    for argument in arguments:
        name, is_given, _ = argument.partition(":=")
        if is_given and name not in known and not name.startswith("_"):  # those are ROS's own, such as __ns
            raise UnknownNameError(f"argument of {path.stem}", name, known)


def _arguments_of(options: argparse.Namespace, given: Iterable[str], known: Iterable[str]) -> list[str]:
    """Returns the arguments of roslaunch that make up for the options."""
    added = [] if options.port is None else ["-p", str(options.port)]
    if options.ns is None:
        return added
    namespace = options.ns.strip("/")
    # a master has one clock, and TF no namespaces
    values = {"tf_prefix": namespace, "use_sim_time": "false"}
    names = {argument.partition(":=")[0] for argument in given}
    missing = [f"{name}:={value}" for name, value in values.items() if name in known and name not in names]
    return [*added, f"__ns:=/{namespace}", *missing]


def _make_way(file: Path, options: argparse.Namespace) -> None:
    """Sees to it that the launch file stops no simulator that runs, unless it is to replace that.

    Raises:
        InterfaceError: If it would stop one, or run beside one that is the clock of their master.
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
