"""Files that are replaced as a whole: readers never see a partly written file."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def atomic_file(path: Path) -> Iterator[Path]:
    """Yields a path of the same name to write to, in a hidden folder next to the file; `*.csv` does not match it.

    At the end of the context, the written file replaces the former one. If the context fails, the written file is
    removed and the former one stays unchanged. Symbolic links at either path are removed first.
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
