"""Files that are whole whenever they have their name."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def atomic_file(path: Path) -> Iterator[Path]:
    """Yields a path beside a file to write to, with the same ending.

    What is written there gets the name of the file at the end of the context, in place of the former one. If the
    context fails, it is removed, and the former file stays as it was.
    """
    part = path.with_name(f".{path.stem}.part{path.suffix}")
    try:
        yield part
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)
