"""The simulator: worlds, bodies, sensors and renderer. The ROS node is in `rpbi.ros`."""

import os
import sys
from importlib import import_module

if not ((3, 10) <= sys.version_info < (3, 12) and sys.platform == "linux"):
    _this = f"Python {sys.version_info[0]}.{sys.version_info[1]} on {sys.platform}"
    raise ImportError(f"rpbi needs CPython 3.10 or 3.11 on Linux, and this is {_this}")

_GREETING = b"pybullet build time: "


def _import_pybullet() -> None:
    """Imports PyBullet, and suppresses the line with PyBullet's build time on standard error.

    Other output on standard error, such as a warning from NumPy, is printed after the import.
    """
    try:
        stderr = os.dup(2)
    except OSError:  # no such stream
        return
    with os.fdopen(os.memfd_create("stderr"), "rb") as printed, os.fdopen(stderr, "wb", buffering=0) as original:
        sys.stderr.flush()
        os.dup2(printed.fileno(), 2)
        try:
            import_module("pybullet")
        finally:
            sys.stderr.flush()
            os.dup2(stderr, 2)
            printed.seek(0)
            for line in printed:
                if not line.startswith(_GREETING):
                    original.write(line)


_import_pybullet()
