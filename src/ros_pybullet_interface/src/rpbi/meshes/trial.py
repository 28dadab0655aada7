"""Tries meshes: before a mesh is used for the first time, a separate process loads the mesh as a test.

PyBullet's loaders of OBJ, STL and COLLADA do not check files, so a broken file may crash the process. The user's cache
folder keeps the hashes of meshes that passed the test, so that each mesh is tried only once.
"""

import enum
import logging
import os
import resource
import signal
import subprocess
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from custom_ros_tools.child_process import limit_resource, python_module, start_child
from robot_model.mesh_cache import cache_folder, content_hash

TRIAL = 3
"""Version of the trial. Meshes that passed another version are tried again."""
MAX_BYTES = 2 * 2**30
"""Memory limit of the trial process [bytes]; further allocations fail."""
MAX_CPU_S = 20
"""Processor time [s] of the trial process after which a mesh is refused."""
LONGEST_TRIAL_S = 45.0
"""Wall time [s] of the trial process after which a mesh is refused."""
MAX_BATCH = 100
"""Largest number of meshes that one trial process loads."""

log = logging.getLogger(__name__)


class Use(enum.Enum):
    """Use of a mesh; PyBullet loads a mesh differently for each use."""

    VISUAL = "visual"
    COLLISION = "collision"
    HEIGHT_FIELD = "height_field"
    SOFT = "soft"
    URDF_VISUAL = "urdf_visual"
    URDF_COLLISION = "urdf_collision"


class Mesh(NamedTuple):
    """A mesh file, and what PyBullet uses the file for."""

    use: Use
    file: str


_tried: set[tuple[Mesh, int, int]] = set()
"""Meshes that this process has checked, each with file size [bytes] and time of the last change [ns].

A file is not read again unless size or time changes.
"""


def limit_resources(cpu_s: int) -> None:
    """Limits memory and processor time of this process, and disables core dumps.

    Args:
        cpu_s: Limit of the processor time [s].
    """
    for limit, most in ((resource.RLIMIT_AS, MAX_BYTES), (resource.RLIMIT_CPU, cpu_s), (resource.RLIMIT_CORE, 0)):
        limit_resource(limit, most)


def faults_in(meshes: Iterable[Mesh]) -> dict[Mesh, str]:
    """Tries each mesh that has not passed a trial yet; returns an error message for each that PyBullet cannot load."""
    faults: dict[Mesh, str] = {}
    unknown: dict[Mesh, Path] = {}
    for mesh in dict.fromkeys(meshes):
        try:
            status = os.stat(mesh.file)
            key = mesh, status.st_size, status.st_mtime_ns
            if key not in _tried:
                record = cache_folder() / f"{mesh.use.value}-{content_hash(mesh.file, TRIAL)}"
                if not _exists(record):
                    unknown[mesh] = record
                _tried.add(key)
        except OSError as error:
            faults[mesh] = (error.strerror or str(error)).lower()
    for mesh, fault in zip(unknown, _try(list(unknown))):
        if fault:
            faults[mesh] = fault
        else:
            _remember(unknown[mesh])
    _tried.difference_update([key for key in _tried if key[0] in faults])
    return faults


def _try(meshes: Sequence[Mesh]) -> Iterator[str]:
    """Tries meshes in child processes. Yields one message per mesh, empty if PyBullet can load the mesh."""
    done = 0
    while done < len(meshes):
        batch = meshes[done : done + MAX_BATCH]
        lines, end = _run(batch)
        yield from lines
        done += len(lines)
        if len(lines) < len(batch):
            yield end
            done += 1


def _run(meshes: Sequence[Mesh]) -> tuple[list[str], str]:
    """Runs one trial process.

    Returns:
        A list with one message for each mesh that the process finished, and a message for the first unfinished mesh.
        The latter has no meaning if the process finished all meshes.
    """
    reading, writing = os.pipe()
    command = python_module(__name__.rpartition(".")[0], str(writing))
    with open(reading, "rb") as report:
        try:
            process = start_child(
                [*command, *(part for mesh in meshes for part in (mesh.use.value, mesh.file))],
                signal.SIGKILL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                pass_fds=[writing],
            )
        finally:
            os.close(writing)
        try:
            process.wait(LONGEST_TRIAL_S)
            end = _reason(process.returncode)
        except subprocess.TimeoutExpired:
            end = f"PyBullet takes more than {LONGEST_TRIAL_S:g} s to load it"
        finally:
            process.kill()
            process.wait()
            assert process.stdin is not None
            process.stdin.close()
        lines = report.read().decode(errors="replace").splitlines()
    return [f"PyBullet cannot load it: {line}" if line else "" for line in lines], end or "the trial could not be run"


def _reason(returncode: int) -> str:
    """Returns an error message for the exit code of a trial process; empty for success."""
    if returncode == -signal.SIGXCPU or returncode == -signal.SIGKILL:
        return f"PyBullet takes more than {MAX_CPU_S} s to load it"
    if returncode < 0:
        return f"PyBullet crashes when it loads it ({signal.Signals(-returncode).name})"
    return f"PyBullet cannot load it (exit code {returncode})" if returncode else ""


def _exists(record: Path) -> bool:
    with suppress(OSError):
        return record.exists()
    return False


def _remember(record: Path) -> None:
    try:
        record.parent.mkdir(parents=True, exist_ok=True)
        record.touch()
    except OSError as error:
        log.info("meshes that passed cannot be cached, and are tried again next time: %s", error)
