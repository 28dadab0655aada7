"""Comparison of a data set with the recordings that it was made from."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from episodes.datasets.format import DatasetError
from episodes.datasets.provenance import file_digest, is_exported, read_episode, read_export
from episodes.errors import EpisodeError
from episodes.folder import BAG, EpisodeFolder


def source_faults(dataset: Path, folder: EpisodeFolder) -> Iterator[str]:
    """Yields a sentence for each recording that is missing or was changed since the export.

    Raises:
        DatasetError: If the data set was not exported from episodes.
    """
    if not is_exported(dataset):
        raise DatasetError(dataset, "has no rpbi/: it was not exported from episodes")
    try:
        numbers = read_export(dataset).get("episodes", [])
    except ValueError:  # which is named anyway
        return
    for index, number in enumerate(numbers):
        try:
            folder.read(number)
            bag = folder.folder_of(number) / BAG
            if file_digest(bag) != read_episode(dataset, index)["source"]["bag_sha256"]:
                yield f"{bag}: is not the recording that episode {index} was exported from"
        except (EpisodeError, OSError) as error:
            yield f"episode {index}: its recording cannot be read: {error}"
        except (ValueError, KeyError, TypeError):  # named by the check of the data set
            continue
