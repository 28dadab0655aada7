#!/usr/bin/python3
"""Checks that tests of the guard fail when it is wrong: changes a copy of its code, and runs a test on each change.

    ./rpbi shell -c 'python3 dev/robustness/mutants/try_mutants.py'

The changes are in guard.yaml in this folder. Each has the `file`, which begins with its package, the text `before`,
which occurs once, the text `after`, and the `test` that has to fail. The exit status is 1 if a test does not fail, or
fails without a change.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import yaml

ROOT = Path(__file__).resolve().parents[3]
PACKAGES = (ROOT / "src/safe_robot/src/safe_robot", ROOT / "src/robot_model/src/robot_model")
MESSAGES = ROOT / "devel/lib/python3/dist-packages/safe_robot"
TESTS = ("tests/unit/safe_robot", "tests/ros/safe_robot/test_guard_faults.py")


def passes(folder: Path, tests: str) -> bool:
    """Returns whether tests pass, such as `one or another`, with the packages in a folder.

    Raises:
        RuntimeError: If there are no such tests, or they cannot be run.
    """
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:xdist", "-k", tests, *TESTS]
    path = os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")])
    ended = subprocess.run(
        command, cwd=ROOT, env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True, check=False
    )
    if ended.returncode not in (0, 1):
        raise RuntimeError(f"{tests}: {ended.stdout}{ended.stderr}")
    return ended.returncode == 0


def is_caught(folder: Path, mutant: dict[str, Any]) -> bool:
    """Returns whether the test of a change fails with it.

    Raises:
        ValueError: If the text to be changed is missing, or there more than once.
    """
    file = folder / mutant["file"]
    text = file.read_text()
    if (count := text.count(mutant["before"])) != 1:
        raise ValueError(f"{mutant['file']}: expected once, got {count} times: {mutant['before']}")
    file.write_text(text.replace(mutant["before"], mutant["after"]))
    try:
        return not passes(folder, mutant["test"])
    finally:
        file.write_text(text)


def main() -> int:
    """Runs from the command line; returns its exit status."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", default="", help="those of files whose names contain this")
    mutants = yaml.safe_load(Path(__file__).with_name("guard.yaml").read_text())
    mutants = [each for each in mutants if parser.parse_args().only in each["file"]]
    survivors = 0
    with tempfile.TemporaryDirectory(prefix="rpbi-mutants-") as name:
        folder = Path(name)
        for package in PACKAGES:
            shutil.copytree(package, folder / package.name, ignore=shutil.ignore_patterns("__pycache__"))
        for generated in ("msg", "srv"):
            if (MESSAGES / generated).exists():
                (folder / "safe_robot" / generated).symlink_to(MESSAGES / generated)
        if not passes(folder, " or ".join(sorted({each["test"] for each in mutants}))):
            print("tests fail without any change")
            return 1
        for mutant in mutants:
            caught = is_caught(folder, mutant)
            survivors += not caught
            print("caught  " if caught else "SURVIVED", mutant["file"], mutant["before"].strip(), sep="  ", flush=True)
    print(f"{len(mutants) - survivors} of {len(mutants)} are caught")
    return 1 if survivors else 0


if __name__ == "__main__":
    sys.exit(main())
