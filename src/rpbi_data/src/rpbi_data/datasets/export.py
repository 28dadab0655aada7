"""Exports a folder of episodes as a data set."""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from custom_ros_tools.errors import InterfaceError
from rpbi_data.episodes.errors import DISK_FULL, EpisodeError
from rpbi_data.episodes.folder import BAG, Episode, EpisodeFolder, file_in

from .format import (
    ACTION,
    STAMP,
    STAMP_NAMES,
    STATE,
    TIME_ERROR,
    CameraFeature,
    DatasetError,
    DatasetFormat,
    Feature,
    Schema,
)
from .provenance import remove_episode, write_episode, write_export
from .signals import RowOptions, Signal
from .source import SourceEpisode

MAX_KEPT_BYTES = 1_000_000_000
"""Maximum memory of tables that are kept between planning and writing [bytes]. Further tables are read twice."""


class ExportOptions(NamedTuple):
    """The user's options of an export.

    Attributes:
        fps: Number of rows per second.
        task: Description of the task in words.
        labels: Labels of the episodes to export; empty for all.
        row_options: The user's choice of the content of rows.
        disk_reserve_mb: Free disk space below which no further episode is exported [MB].
        any_size: Whether bags may exceed the limits of `BagReader`.
        max_time_error_s: Largest time between a row and the nearest message of an observation [s]. Episodes that exceed
            this time are not exported.
    """

    fps: int
    task: str
    labels: tuple[str, ...] = ()
    row_options: RowOptions = RowOptions()
    disk_reserve_mb: float = 200.0
    any_size: bool = False
    max_time_error_s: float = float("inf")


@dataclass
class Result:
    """Result of an export.

    Attributes:
        exported: Numbers of the exported episodes, in the order of the data set.
        faults: Messages about episodes that were not exported.
    """

    exported: list[int] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)


class _Plan(NamedTuple):
    """Episodes to export, and the content of the data set's rows.

    Attributes:
        sources: The episodes.
        signals: Features, with the table columns from which they are computed; empty for a format without rows.
        schema: Content of the rows; None for a format without rows.
    """

    sources: list[SourceEpisode]
    signals: tuple[Signal, ...] = ()
    schema: Schema | None = None


def export_folder(
    folder: EpisodeFolder,
    target: Path,
    name: str,
    format_: DatasetFormat,
    options: ExportOptions,
    report: Callable[[str], None],
) -> Result:
    """Exports the episodes of a folder as a data set.

    Episodes that cannot be exported are skipped. The data set is written to a temporary folder, which is renamed to
    `target` when the data set is complete. After an error, the temporary folder is removed.

    Args:
        folder: The episodes.
        target: Folder of the data set; must not exist.
        name: Name of the format, which is stored with the data set.
        format_: The format, which writes the data set.
        options: Options of the export.
        report: Function that is called with a message for each exported episode.

    Raises:
        EpisodeError: If the folder of episodes does not exist, the target exists, no episode can be exported, or the
            data set cannot be completed.
        OSError: If the temporary folder or the first files cannot be written.
    """
    if target.exists():
        raise DatasetError(target, "exists already: name a folder that does not")
    result = Result()
    plan = _plan(folder, format_, options, result)
    target.parent.mkdir(parents=True, exist_ok=True)
    part = target.parent / f".{target.name}.part"
    shutil.rmtree(part, ignore_errors=True)  # left by a killed export
    part.mkdir()
    try:
        format_.open(part, plan.schema)
        _add_all(part, format_, plan, options.disk_reserve_mb, result, report)
        if not result.exported:
            raise EpisodeError(folder.path, "\n".join(["no episode was exported", *result.faults]))
        try:
            _complete(part, format_, result, lambda: _facts(folder, name, options, plan, result))
        except OSError as error:
            raise DatasetError(target, f"cannot be completed: {error}") from error
        part.rename(target)
    finally:
        shutil.rmtree(part, ignore_errors=True)
    return result


def _plan(folder: EpisodeFolder, format_: DatasetFormat, options: ExportOptions, result: Result) -> _Plan:
    """Returns the episodes to export, and the most frequent set of features and cameras of these episodes.

    Adds a message to `result.faults` for each episode that cannot be exported.
    """
    sources: list[SourceEpisode] = []
    kept_bytes = 0
    for number in folder.numbers():
        try:
            episode = folder.read(number)
            if options.labels and episode.label not in options.labels:
                continue
            _require_complete(folder, episode)
            limits = options.any_size, options.max_time_error_s
            source = SourceEpisode(folder, episode, options.row_options, options.task, *limits, format_.has_rows)
            if format_.has_rows:
                _content(source)
                kept_bytes += source.table_bytes
                if kept_bytes > MAX_KEPT_BYTES:
                    kept_bytes -= source.table_bytes
                    source.release()
            elif episode.set_back_s:
                raise EpisodeError(source.bag, f"a clock was set back by {episode.set_back_s:.6g} s")
            else:
                source.check()
            sources.append(source)
        except Exception as error:  # an episode may have anything in it
            result.faults.append(_fault(number, error))
    if not sources:
        wanted = f" with the label {' or '.join(options.labels)}" if options.labels else ""
        raise EpisodeError(folder.path, "\n".join([f"no episode{wanted} can be exported", *result.faults]))
    if not format_.has_rows:
        return _Plan(sources)
    most, _ = Counter(map(_content, sources)).most_common(1)[0]
    signals = next(each.signals for each in sources if _content(each) == most)
    features, cameras = most
    keys = {feature.key for feature in features}
    for key, option in ((STATE, "--state"), (ACTION, "--action")):
        if key not in keys:
            raise EpisodeError(folder.path, f"no topic for '{key}' in the recordings: name one by {option} TOPIC")
    errors = (*(feature.key for feature in features), *(camera.key for camera in cameras))
    own = (Feature(STAMP, STAMP_NAMES, "int64"), Feature(TIME_ERROR, errors))
    return _Plan(sources, signals, Schema(options.fps, (*features, *own), cameras))


def _content(source: SourceEpisode) -> tuple[tuple[Feature, ...], tuple[CameraFeature, ...]]:
    """Reads the bag of an episode, and returns the episode's features and cameras."""
    return tuple(signal.feature for signal in source.signals), source.cameras


def _require_complete(folder: EpisodeFolder, episode: Episode) -> None:
    if episode.state == "incomplete":
        raise EpisodeError(folder.folder_of(episode.number), f"is incomplete: {episode.note}")
    place = folder.folder_of(episode.number)
    if file_in(place, BAG) is None:
        raise EpisodeError(place / BAG, "there is none")


def _add_all(
    part: Path,
    format_: DatasetFormat,
    plan: _Plan,
    disk_reserve_mb: float,
    result: Result,
    report: Callable[[str], None],
) -> None:
    """Adds the planned episodes to the data set, until the disk is full; updates `result`."""
    place = EpisodeFolder(part)
    for position, source in enumerate(plan.sources):
        number, index = source.episode.number, len(result.exported)
        if (free := place.free_mb()) < disk_reserve_mb:
            left = ", ".join(str(each.episode.number) for each in plan.sources[position:])
            full = f"{free:.0f} MB free on the disk, less than the reserve of {disk_reserve_mb:.0f} MB"
            result.faults.append(f"{full}: episodes {left} are not exported")
            return
        try:
            if plan.schema is not None:
                source.use(plan.schema, plan.signals)
            facts = source.facts()
            facts |= format_.add(index, source)
        except Exception as error:  # see `_plan`
            result.faults.append(_fault(number, error))
            if getattr(error, "errno", None) in DISK_FULL:
                result.faults += _not_exported(plan.sources[position + 1 :])
                return
            continue
        finally:
            source.release()
        images = facts.pop("images", {})
        try:
            write_episode(part, index, facts, images)
        except OSError as error:
            _take_back(part, format_, index)
            result.faults += [_fault(number, error), *_not_exported(plan.sources[position + 1 :])]
            return
        result.exported.append(number)
        report(_line(source, index, facts))


def _not_exported(sources: Sequence[SourceEpisode]) -> list[str]:
    numbers = ", ".join(str(each.episode.number) for each in sources)
    return [f"episodes {numbers} are not exported"] if numbers else []


def _complete(part: Path, format_: DatasetFormat, result: Result, facts: Callable[[], dict[str, object]]) -> None:
    """Completes the data set. If the disk is full, removes the last episode to free space, and tries once again."""
    try:
        write_export(part, facts())
        format_.close()
    except OSError as error:
        if error.errno not in DISK_FULL or len(result.exported) < 2:
            raise
        result.faults.append(_fault(result.exported.pop(), error))
        _take_back(part, format_, len(result.exported))
        write_export(part, facts())
        format_.close()


def _take_back(part: Path, format_: DatasetFormat, index: int) -> None:
    """Removes the episode that was added last, which has the given index, from the data set."""
    format_.take_back(index)
    remove_episode(part, index)


def _line(source: SourceEpisode, index: int, facts: dict[str, object]) -> str:
    note = f" ({sum(source.episode.lost.values())} messages lost in the recording)" if source.episode.lost else ""
    if "cut" in facts and source.cut is not None:
        note += f" (from its last reset on, at {source.cut.stamp_ns / 1e9:.9g} s)"
    size = f"{facts['frames']} frames" if "frames" in facts else "all messages"
    return f"episode {source.episode.number}: {size}, as {index}{note}"


def _fault(number: int, error: Exception) -> str:
    kind = "" if isinstance(error, (InterfaceError, OSError, ValueError)) else f"{type(error).__name__}: "
    return f"episode {number}: {kind}{'; '.join(str(error).splitlines())}"


def _facts(folder: EpisodeFolder, name: str, options: ExportOptions, plan: _Plan, result: Result) -> dict[str, object]:
    schema = plan.schema or Schema(0, ())
    return {
        "format": name,
        "source": str(folder.path.absolute()),
        "episodes": result.exported,
        "left_out": result.faults,
        "task": options.task,
        "fps": schema.fps or None,
        "features": {each.key: list(each.names) for each in schema.features},
        "cameras": {each.key: [each.height, each.width, 3] for each in schema.cameras},
        "topics": {each.feature.key: sorted({table for table, _ in each.columns}) for each in plan.signals},
        "methods": {each.feature.key: each.method for each in plan.signals},
        "action": {"pose": options.row_options.is_pose, "deltas": options.row_options.is_delta} if schema.fps else None,
    }
