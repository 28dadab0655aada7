"""The command `wheel`."""

import subprocess
import sys

from custom_ros_tools.errors import InterfaceError

from .modules import workspace
from .release import version


def wheel() -> str:
    """Builds the wheel `rpbi`, which pip installs without ROS: worlds, sensors, cameras, environments and data.

    It installs the extra `wheel` first. The wheel is for Linux and CPython 3.10 or 3.11. Modules that need ROS are not
    in it; robots and worlds of the examples are. See docs/python.md.
    """
    root = workspace()
    command = [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", str(root / "out")]
    done = subprocess.run(command, cwd=root / "dev/wheel", capture_output=True, text=True)
    if done.returncode:
        raise InterfaceError(f"hatchling: {(done.stderr or done.stdout).strip()}")
    return f"built: out/rpbi-{version(root)}-py3-none-any.whl"
