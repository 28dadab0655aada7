"""When the renderer gets the processor."""

import contextlib
import os


def give_way() -> None:
    """Lets physics go first: what is idle gets only what nobody else needs."""
    try:
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
    except OSError:  # some containers do not allow it
        os.nice(19)


def take_part(process_id: int) -> None:
    """Lets an idle process run as others do, because somebody waits for it.

    Args:
        process_id: The process; it may be this one.
    """
    with contextlib.suppress(OSError):  # it may be gone, or this not allowed
        for thread_id in os.listdir(f"/proc/{process_id}/task"):
            os.sched_setscheduler(int(thread_id), os.SCHED_OTHER, os.sched_param(0))
