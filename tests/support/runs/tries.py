"""Loops that come to an end when something goes wrong."""

from __future__ import annotations

import time
from collections.abc import Iterator


def tries(what: str, timeout_s: float = 60.0) -> Iterator[None]:
    """Yields until the caller leaves the loop, since it has come about; the test fails if that takes too long."""
    end_s = time.monotonic() + timeout_s
    while time.monotonic() < end_s:
        yield
    raise AssertionError(f"it did not come about within {timeout_s:g} s that {what}")
