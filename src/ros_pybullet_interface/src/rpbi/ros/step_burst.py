"""Some ticks in a row that somebody waits for."""

from __future__ import annotations

from concurrent.futures import Future


class StepBurst:
    """Counts the ticks of one request; whoever asked waits for `done`.

    Args:
        steps: How many ticks.
    """

    def __init__(self, steps: int) -> None:
        self.done: Future[tuple[int, int]] = Future()
        """Tick and stamp [ns] after the last one."""
        self._steps = self.left = steps

    def finish(self, tick: int, stamp_ns: int) -> None:
        """Tells that all is done."""
        if self.done.set_running_or_notify_cancel():
            self.done.set_result((tick, stamp_ns))

    def fail(self, error: Exception) -> None:
        """Tells that no more ticks come."""
        if self.done.set_running_or_notify_cancel():
            self.done.set_exception(error)

    def __str__(self) -> str:
        return f"after {self._steps - self.left} of {self._steps} ticks"
