"""The command `bag_to_table`: converts a bag to one file per topic."""

import argparse
import logging
import sys
from collections.abc import Sequence
from pathlib import Path

import pandas as pd
import rospy

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.foreign import printable_lines

from .bag_reader import bag_to_dataframes
from .limits import BagError
from .tables import FORMATS, file_stems, write_table

_NAME = "bag_to_table"


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the command.

    Args:
        argv: Command-line arguments; by default the arguments of the process.

    Returns:
        The exit code: 0, or 1 with one line on stderr that states the error.
    """
    arguments = _parser().parse_args(rospy.myargv(sys.argv)[1:] if argv is None else argv)
    _log_to_stderr(logging.WARNING if arguments.quiet else logging.INFO)
    try:
        written = _convert(arguments)
    except (InterfaceError, OSError) as error:
        print(f"{_NAME}: {printable_lines(str(error))}", file=sys.stderr)
        return 1
    if not arguments.quiet:
        print(printable_lines(_text(written)) if len(written) else "no topic to write")
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog=_NAME, description="Writes each topic of a bag as a table.")
    parser.add_argument("bag", type=Path, metavar="BAG")
    parser.add_argument("--topics", nargs="+", metavar="TOPIC", help="default: all that hold no binary data")
    parser.add_argument("--format", choices=FORMATS, default=FORMATS[0], help="default: %(default)s")
    parser.add_argument("--out", type=Path, metavar="DIR", help="default: BAG_tables, in the folder of BAG.bag")
    parser.add_argument("--images", action="store_true", help="topics with binary data too (not CSV)")
    parser.add_argument("--any-size", action="store_true", help="also if it unfolds to 255 times its size and 1 GiB")
    parser.add_argument("--quiet", action="store_true", help="no progress bar and no list of files")
    return parser


def _log_to_stderr(level: int) -> None:
    """Prints the log of this package to stderr. The root logger is not used, since it includes the log of rospy."""
    handler = logging.StreamHandler()
    handler.setFormatter(logging.Formatter(f"{_NAME}: %(message)s"))
    log = logging.getLogger("rpbi_data")
    log.addHandler(handler)
    log.setLevel(level)


def _convert(arguments: argparse.Namespace) -> pd.DataFrame:
    """Reads the bag, writes a file for each topic, and returns a table with one row per file."""
    bag: Path = arguments.bag
    progress = not arguments.quiet
    tables = bag_to_dataframes(
        bag, arguments.topics, images=arguments.images, any_size=arguments.any_size, progress=progress
    )
    folder: Path = arguments.out or bag.with_name(f"{bag.stem}_tables")
    folder.mkdir(parents=True, exist_ok=True)
    rows = []
    for topic, stem in file_stems(tables).items():
        path = folder / f"{stem}.{arguments.format}"
        try:
            write_table(tables[topic], path)
        except ValueError as error:
            raise BagError(bag, f"{topic}: {error}") from error
        rows.append((topic, *tables[topic].shape, _size(path), path))
    return pd.DataFrame(rows, columns=["topic", "rows", "columns", "size", "file"])


def _text(written: pd.DataFrame) -> str:
    """Formats the table of written files as text, with left-aligned names."""
    widths = {name: written[name].astype(str).str.len().max() for name in ("topic", "file")}
    left = {name: f"{{!s:<{width}}}".format for name, width in widths.items()}
    return str(written.to_string(index=False, justify="left", formatters=left))


def _size(path: Path) -> str:
    size = float(path.stat().st_size)
    for unit in ("B", "kB", "MB"):
        if size < 1000:
            return f"{size:.3g} {unit}"
        size /= 1000
    return f"{size:.3g} GB"
