"""Files that are whole whenever they have their name."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def atomic_file(path: Path) -> Iterator[Path]:
    """Yields a path of the same name to write to, in a hidden folder beside the file; `*.csv` does not match it.

    What is written there becomes the file at the end of the context, in place of the former one. If the context fails,
    it is removed, and the former file stays as it was. Links that somebody has put in their places are removed first.
    """
    folder = path.with_name(f".{path.name}.part")
    if folder.is_symlink():
        folder.unlink()
    folder.mkdir(exist_ok=True)
    (folder / path.name).unlink(missing_ok=True)
    try:
        yield folder / path.name
        (folder / path.name).replace(path)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
