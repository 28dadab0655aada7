"""Makes hostile files in a folder, reads each, and prints kind, seed, reader, verdict and message as JSON lines.

Arguments: `alone`, or `node` if the simulator node is to read them too, which needs a ROS master; the folder, the first
seed, how many of each kind, and the kinds. `controls` are files that must not be fine with who reads them without care.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pybullet
import rosbag

ROOT = Path(__file__).resolve().parents[3]
sys.path[:0] = [str(ROOT / "dev"), *map(str, (ROOT / "tests/support").iterdir())]

from robustness.hostile_files.files import hostile_files, outcome_of, write_session  # noqa: E402

TWO_ROOTS = '<robot name="r"><link name="a"/><link name="b"/><link name="c"/>{}</robot>'
TWO_PARENTS = "".join(
    f'<joint name="j{parent}" type="fixed"><parent link="{parent}"/><child link="c"/></joint>' for parent in "ab"
)


def main() -> None:
    """Prints the verdicts."""
    who, folder, first, count, *kinds = sys.argv[1:]
    for kind in kinds:
        if kind == "controls":
            _print_controls(Path(folder))
            continue
        for hostile in hostile_files(kind, range(int(first), int(first) + int(count)), Path(folder)):
            for name, read in hostile.readers.items():
                if name != "node" or who == "node":
                    print(json.dumps([kind, hostile.seed, name, *outcome_of(read, hostile.canary)]), flush=True)


def _print_controls(folder: Path) -> None:
    urdf, bag, canary = folder / "control.urdf", folder / "control.bag", folder / "canary"
    urdf.write_text(TWO_ROOTS.format(TWO_PARENTS))
    print(json.dumps(["urdf", 0, "PyBullet", *outcome_of(lambda: _load(urdf))]))
    write_session(bag, folder, definition_code=str(canary))
    print(json.dumps(["bag", 0, "rosbag", *outcome_of(lambda: _read(bag), canary)]))


def _load(urdf: Path) -> None:
    pybullet.connect(pybullet.DIRECT)
    pybullet.loadURDF(str(urdf))


def _read(bag: Path) -> None:
    with rosbag.Bag(str(bag)) as opened:
        list(opened.read_messages(raw=True))


if __name__ == "__main__":
    main()
