"""A loop of 1 kHz that does nothing, and writes down when; until it is interrupted."""

import contextlib
import os
import sys
import time
from array import array

import numpy as np

times = array("d")
with contextlib.suppress(OSError):
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(10))
with contextlib.suppress(KeyboardInterrupt):
    due_s = time.monotonic()
    while True:
        times.append(time.monotonic())
        due_s += 1e-3
        left_s = due_s - time.monotonic()
        if left_s > 0.0:
            time.sleep(left_s)
        else:
            due_s -= left_s
np.save(sys.argv[1], np.array(times))
