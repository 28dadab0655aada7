"""Reads hostile `.world` files with each of their readers, and prints a table of the results.

Run by `./rpbi shell -c 'python3 dev/robustness/states.py'`, it reads 300 of them with each reader, each in a process of
its own. `states_in_node.py` has a running simulator restore them. The table in docs/security_tests.md is theirs.
"""

from __future__ import annotations

import argparse
import os
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "dev"), *map(str, (ROOT / "tests/support").iterdir())]

import pybullet  # noqa: E402
from worlds import FLOOR, ball, box, iiwa, write_world  # noqa: E402

from custom_ros_tools.errors import InterfaceError  # noqa: E402
from robustness.hostile_bags.trial import Trial, tried  # noqa: E402
from robustness.hostile_states import CLASSES, write_hostile  # noqa: E402
from rpbi.replay.session import Checkpoint, Recording, Replay  # noqa: E402
from rpbi.world import World  # noqa: E402
from rpbi.world.saved.description import WorldDescription  # noqa: E402
from rpbi.world.saved.state import WorldState  # noqa: E402

MAX_TICKS = 5_000
"""Age of a state that the readers take."""
MAX_MB = 2_000
FOREIGN = {name.partition(":")[0].partition(".")[0] for name in CLASSES} - {
    *("rpbi", "os", "subprocess", "builtins", "pickle", "pathlib", ""),
}
"""Packages that files must not import."""
WRITING = {
    "os.remove",
    "os.rename",
    "os.rmdir",
    "os.mkdir",
    "os.link",
    "os.symlink",
    "os.chmod",
    "os.truncate",
    "os.system",
}
WRITABLE = ("/dev/null", "/dev/shm/")


def write_good(folder: Path) -> list[Path]:
    """Writes states of a world with an arm, bodies and commands of several kinds, from its start and from a keyframe.

    Returns:
        Their files; the world's main file is in the same folder.
    """
    world = World.from_file(
        write_world(folder, collision=(FLOOR,), dynamic=(box("box"),), robots=(iiwa(),)),
        connection_mode=pybullet.DIRECT,
    )
    world.add("dynamic", {key: value for key, value in ball("later").items()})
    paths = [folder / "start.world", folder / "keyframe.world"]
    for tick in range(60):
        if tick == 40:
            world.save(paths[0])
            world.save(keyframe=True)
        if tick % 5 == 0:
            world.put("iiwa/target", {"lbr_iiwa_joint_2": 0.01 * tick})
        if tick == 10:
            world.change_dynamics("box", {"lateralFriction": 0.3})
            world.act("box", "teleport", {"position": (1.0, 0.0, 0.5), "quat_xyzw": (0.0, 0.0, 0.0, 1.0)})
        if tick == 20:
            world.attach({"name": "held", "parent": "iiwa/lbr_iiwa_link_7", "child": "box"})
            world.act("iiwa", "move", {"positions": {"lbr_iiwa_joint_1": 0.1}, "duration_s": 0.1})
        world.step()
    world.save(paths[1])
    world.close()
    return paths


def from_state(path: Path) -> None:
    World.from_state(path, max_ticks=MAX_TICKS).close()


def restore(path: Path) -> None:
    state = WorldState.read(path)
    world = World.from_file(str(path.parents[1] / "good/world.yaml"), connection_mode=pybullet.DIRECT)
    world.restore(state, max_ticks=MAX_TICKS)
    world.close()


def replay(path: Path) -> None:
    state = WorldState.read(path)
    state.require_short(MAX_TICKS)
    if state.keyframe:
        raise InterfaceError("replays begin at the start")
    checkpoint = Checkpoint(0, state.tick, len(state.commands), state.state_hash)
    try:
        recording = Recording(WorldDescription(state.description), {0: dict(enumerate(state.commands))}, {checkpoint})
    except ValueError as error:
        raise InterfaceError(str(error)) from None
    result = Replay(recording).run()
    if result.difference or result.left_out:
        raise InterfaceError(str(result))


READERS: dict[str, Callable[[Path], object]] = {"from_state": from_state, "restore": restore, "replay": replay}
"""Readers of states by name; a refusal is an InterfaceError."""


def watched(read: Callable[[Path], object]) -> Callable[[Path], object]:
    """Returns a reader that makes a file `canary` if anything foreign was imported, or written elsewhere."""

    def reading(path: Path) -> object:
        place, found = str(path.parent), []
        folder = str(path.parents[1])

        def hook(event: str, arguments: tuple[Any, ...]) -> None:
            names = [str(arguments[0])] if event in WRITING or event == "open" else []
            if event == "open" and not (isinstance(arguments[2], int) and arguments[2] & (os.O_WRONLY | os.O_RDWR)):
                names = []
            found.extend(f"{event} {name}" for name in names if not name.startswith((folder, *WRITABLE)))

        sys.path.insert(0, place)
        sys.addaudithook(hook)
        try:
            return read(path)
        finally:
            found.extend(name for name in sys.modules if name.partition(".")[0] in FOREIGN)
            if found:
                (path.parent / "canary").write_text("\n".join(found))

    return reading


def main() -> None:
    """Reads the files; exits with 1 if a reader failed."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--count", type=int, default=300, help="default: %(default)s")
    parser.add_argument("--first", type=int, default=0, help="the first seed; default: %(default)s")
    arguments = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="hostile-"))
    os.environ["XDG_CACHE_HOME"] = str(folder / "cache")
    (folder / "good").mkdir()
    table: dict[str, list[Trial]] = {name: [] for name in READERS}
    tempfile.tempdir = str(folder)
    good = write_good(folder / "good")
    for path in good:
        from_state(path)
    for seed in range(arguments.first, arguments.first + arguments.count):
        place = folder / str(seed)
        place.mkdir()
        path, how = write_hostile(seed, place, good)
        for name, read in READERS.items():
            trial = tried(watched(read), path)
            table[name].append(trial)
            if not is_fine(trial):
                canary = place / "canary"
                print(f"{seed} ({how}): {name}: {trial} {canary.read_text() if canary.exists() else ''}", flush=True)
                canary.unlink(missing_ok=True)
        shutil.rmtree(place)
    shutil.rmtree(folder)
    print(
        "| reader | files | taken | refused | signals | tracebacks | code or writes | longest [s] | most memory [MB] |"
    )
    print("|---" * 9 + "|")
    for name, trials in table.items():
        of = Counter(trial.verdict.split()[0] for trial in trials)
        slowest, largest = max(trial.cpu_s for trial in trials), max(trial.memory_mb for trial in trials)
        bad = of["signal"], of["traceback"] + of["silent"], of["code"]
        cells = name, len(trials), of["taken"], of["refused"], *bad, f"{slowest:.1f}", f"{largest:.0f}"
        print(f"| {' | '.join(map(str, cells))} |")
    sys.exit(not all(is_fine(trial) for trials in table.values() for trial in trials))


def is_fine(trial: Trial) -> bool:
    """Returns whether a file was taken or refused in words, within the limits."""
    return trial.is_fine and trial.memory_mb <= MAX_MB


if __name__ == "__main__":
    main()
