"""The command `test`."""

import os
import sys
from pathlib import Path
from typing import Annotated

import pytest

from .argument import Argument
from .modules import workspace

PARALLEL = ("-n", "auto", "--max-worker-restart=0")


WORDS = Argument("[--quick | --all] [PATH | OPTION OF PYTEST ...]", files="*", is_raw=True)


def test(*words: Annotated[str, WORDS]) -> int:
    """Runs tests in parallel workers: all default tests, or the tests that PATH and options of pytest select.

    Default tests are all tests without the mark `thorough`. Tests with this mark only run with --all, even if PATH
    names the file or the test.

    A run without PATH installs all extras first, 1.8 GB. With PATH, extras are not installed. Tests that need a missing
    extra are skipped, and the reason names the extra.

    At the end, the run prints the time of each folder, of the slowest files and of the slowest tests.

    After all tests, up to three failed tests are repeated, each in a separate run. If all of them pass, the whole run
    passes, counts these tests as `flaky` and prints both outputs. If one of them fails again, or if more than three
    tests have failed, the whole run fails.

    Args:
        --quick: run only one test of each ROS path, and most of the tests that do not need ROS
        --all: also run complete examples and scenes, large hostile files, tests of benchmarks, and installation
        --strict: do not repeat failed tests
        -n N: number of workers; with 0, all tests run in one process
        PATH: folder, file or FILE::TEST to run
    """
    root = workspace()
    is_chosen = any(Path(word.partition("::")[0]).exists() for word in words)
    is_serial = any(word.startswith(("-n", "--numprocesses")) or word.endswith("no:xdist") for word in words)
    chosen = "--skip-missing-extras" if is_chosen else str(root / "tests")
    options = ("-c", str(root / "pyproject.toml"), "--rootdir", str(root), *(() if is_serial else PARALLEL))
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as in nodes: workers use all processors already
    sys.argv = ["pytest", *options, *words, chosen]
    return int(pytest.console_main())
