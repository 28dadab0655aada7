"""The command `plot`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated

from matplotlib.figure import Figure
from pandas import DataFrame

from custom_ros_tools.console.argument import Argument
from custom_ros_tools.files import atomic_file
from custom_ros_tools.plot_style import plot_style
from rpbi_data.bags.bag_reader import bag_to_dataframes
from rpbi_data.bags.limits import BagError
from rpbi_data.bags.plots import plot_tables


def plot(
    bag: Annotated[Path, Argument("BAG", parse=Path, files="*.bag")],
    *,
    topics: Annotated[Sequence[str], Argument("TOPIC ...")] = (),
    out: Annotated[Path | None, Argument("FOLDER", parse=Path)] = None,
    window: Annotated[bool, Argument("")] = False,
    any_size: Annotated[bool, Argument("")] = False,
) -> str:
    """Draws the data of a bag: joint states, wrenches, positions of frames, contacts, rates and latencies.

    Prints the names of the written files. Time 0 of the plots is the time of the first message.

    Args:
        bag: the bag
        topics: draws only these topics
        out: folder of the PNG files; default: BAG_plots next to BAG.bag
        window: shows the plots in windows instead of writing files, until the windows are closed
        any_size: also reads a bag whose unpacked size exceeds both 1 GiB and 255 times its file size
    """
    with plot_style():
        return _plotted(bag, bag_to_dataframes(bag, topics or None, any_size=any_size), out, window)


def _plotted(bag: Path, tables: Mapping[str, DataFrame], out: Path | None, window: bool) -> str:
    if window:
        from matplotlib import pyplot  # needs a screen

        shown = [name for name, _ in plot_tables(tables, pyplot.figure)]
        pyplot.show()
        return "\n".join(shown)
    folder = out or bag.with_name(f"{bag.stem}_plots")
    written = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, figure in plot_tables(tables, Figure):
            written.append(folder / f"{name}.png")
            with atomic_file(written[-1]) as part:
                figure.savefig(part)
    except OSError as error:
        raise BagError(bag, f"a figure cannot be written: {error}") from error
    return "\n".join(map(str, written)) or f"{bag}: nothing to draw"
