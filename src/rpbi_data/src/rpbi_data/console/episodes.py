"""The command `episodes`."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from custom_ros_tools.console.argument import Argument, UsageError
from rpbi_data.episodes.bags import repair_all
from rpbi_data.episodes.folder import EpisodeFolder, is_held
from rpbi_data.episodes.listing import details_of, table_of


def episodes(
    folder: Annotated[Path, Argument("DIR", parse=Path)],
    *,
    show: Annotated[int | None, Argument("N", parse=int, excludes="action")] = None,
    discard: Annotated[int | None, Argument("N", parse=int, excludes="action")] = None,
    relabel: Annotated[Sequence[str], Argument("N LABEL", excludes="action")] = (),
    repair: Annotated[bool, Argument("", excludes="action")] = False,
) -> str:
    """Lists the episodes of a folder; with an option, shows, discards, relabels or repairs episodes.

    Args:
        folder: the folder of the episodes
        show: prints the stored data of episode N, including its topics
        discard: moves episode N into DIR/discarded
        relabel: changes the label of episode N
        repair: completes episodes whose recorder was killed; skips episodes that are still being recorded
    """
    given = EpisodeFolder(folder)
    if show is not None:
        return details_of(given.read(show))
    if discard is not None:
        return f"episode {discard} is in {given.discard(discard)}"
    if relabel:
        if not relabel[0].isdecimal():
            raise UsageError(f"--relabel: expected the number of an episode, got {relabel[0]}")
        episode = given.relabel(int(relabel[0]), relabel[1])
        return f"episode {episode.number}: {episode.label}"
    if repair:
        return "\n".join(repair_all(given)) or "nothing to repair"
    text = table_of(given.all())
    parts = given.partial()
    active = sum(map(is_held, parts))
    lines = [f"{active} more: being recorded"] if active else []
    if killed := len(parts) - active:
        lines.append(f"{killed} more: the recorder was killed (--repair)")
    return "\n".join([text, *lines])
