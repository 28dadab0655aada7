"""When the renderer gets the processor."""

import contextlib
import os


def give_way() -> None:
    """Lets physics go before all threads of this process: what is idle gets only what nobody else needs."""
    for thread_id in _threads(os.getpid()):
        with contextlib.suppress(ProcessLookupError):
            try:
                os.sched_setscheduler(thread_id, os.SCHED_IDLE, os.sched_param(0))
            except PermissionError:  # some containers do not allow it
                os.setpriority(os.PRIO_PROCESS, thread_id, 19)


def take_part(process_id: int) -> None:
    """Lets an idle process, which may be this one, run as others do, because somebody waits for it."""
    for thread_id in _threads(process_id):
        with contextlib.suppress(OSError):  # it may be gone, or this not allowed
            os.sched_setscheduler(thread_id, os.SCHED_OTHER, os.sched_param(0))


def raise_from_idle(process_id: int) -> None:
    """Gives an idle process that gets nothing at all the least share that is one: normal scheduling at nice 19."""
    for thread_id in _threads(process_id):
        with contextlib.suppress(OSError):  # it may be gone, or this not allowed
            os.setpriority(os.PRIO_PROCESS, thread_id, 19)
            os.sched_setscheduler(thread_id, os.SCHED_OTHER, os.sched_param(0))


def _threads(process_id: int) -> list[int]:
    """Returns the threads of a process, none if it is gone."""
    with contextlib.suppress(OSError):
        return [int(name) for name in os.listdir(f"/proc/{process_id}/task")]
    return []
