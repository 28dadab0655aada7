"""When the renderer gets the processor."""

import contextlib
import os
from pathlib import Path


def give_way() -> None:
    """Lets physics go before all threads of this process: what is idle gets only what nobody else needs."""
    try:
        _schedule(os.getpid(), os.SCHED_IDLE)
    except OSError:  # some containers do not allow it
        os.nice(19)


def take_part(process_id: int) -> None:
    """Lets an idle process, which may be this one, run as others do, because somebody waits for it."""
    with contextlib.suppress(OSError):  # it may be gone, or this not allowed
        _schedule(process_id, os.SCHED_OTHER)


def _schedule(process_id: int, policy: int) -> None:
    for thread in Path(f"/proc/{process_id}/task").iterdir():
        with contextlib.suppress(ProcessLookupError):  # threads come and go
            os.sched_setscheduler(int(thread.name), policy, os.sched_param(0))
