"""The command `test`."""

import sys
from pathlib import Path
from typing import Annotated

import pytest

from .argument import Argument
from .modules import workspace

PARALLEL = ("-n", "auto", "--max-worker-restart=0")


WORDS = Argument("[--quick | --all] [PATH | OPTION OF PYTEST ...]", files="*", is_raw=True)


def test(*words: Annotated[str, WORDS]) -> int:
    """Runs the tests, or those chosen as for pytest, in parallel workers.

    The default tests are those that a change can break. Tests with the mark `thorough` run only with
    --all, also when their file or their own name is given as PATH.

    A run without PATH installs all extras first, 1.8 GB. With PATH, no extra is installed; tests that need a missing
    extra are skipped, and the reason names it.

    A run ends with the time of each folder, of the slowest files and of the slowest tests.

    Up to three failed tests are run once more, each by itself, after all others. If all of them pass, the run passes,
    counts them as `flaky` and prints both outputs. A second failure, or more than three failed tests, make the run
    fail.

    Args:
        --quick: most that need no ROS, and one test of each ROS path
        --all: also examples and scenes to their end, hostile files at scale, tests of benchmarks, and installation
        --strict: no failed test is run again
        -n N: N workers; -n 0 is one process
        PATH: a folder, a file or FILE::TEST
    """
    root = workspace()
    is_chosen = any(Path(word.partition("::")[0]).exists() for word in words)
    is_serial = any(word.startswith(("-n", "--numprocesses")) or word.endswith("no:xdist") for word in words)
    chosen = "--skip-missing-extras" if is_chosen else str(root / "tests")
    options = ("-c", str(root / "pyproject.toml"), "--rootdir", str(root), *(() if is_serial else PARALLEL))
    sys.argv = ["pytest", *options, *words, chosen]
    return int(pytest.console_main())
