"""The command `launch`: runs an example or a launch file when all of its arguments are arguments of its launch file."""

import re
import sys
from collections.abc import Iterable
from pathlib import Path

import roslaunch
from roslaunch.arg_dump import get_args

from custom_ros_tools.errors import InterfaceError, UnknownNameError

WORLDS = (".yaml", ".yml")
WORLD = "world"
"""Launch file that runs a world of the user's."""
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
    name, *arguments = given
    try:
        if name.endswith(WORLDS):
            name, arguments = WORLD, [f"config:={name}", *arguments]
        is_file = name.endswith(".launch") and Path(name).is_file()
        file = Path(name) if is_file else examples.get(name.removesuffix(".launch"))
        if file is None:
            raise UnknownNameError("example", name, list(examples))
        sys.argv = ["roslaunch", str(file), *arguments]  # roslaunch takes values of arguments from there
        _check_arguments(file, arguments)
    except (InterfaceError, roslaunch.RLException) as error:
        print(f"launch: {error}", file=sys.stderr)
        return 2
    roslaunch.main(sys.argv)
    return 0


def _purpose(path: Path) -> str:
    """Returns what the first comment of a launch file says."""
    comment = _COMMENT.search(path.read_text(encoding="utf-8"))
    return " ".join(comment[1].split()) if comment else ""


def _check_arguments(path: Path, arguments: Iterable[str]) -> None:
    """Raises an UnknownNameError for an argument that a launch file lacks, which roslaunch would take no notice of."""
    known = sorted(get_args([str(path)]))
    for argument in arguments:
        name, is_given, _ = argument.partition(":=")
        if is_given and name not in known and not name.startswith("_"):  # those are ROS's own, such as __ns
            raise UnknownNameError(f"argument of {path.stem}", name, known)
