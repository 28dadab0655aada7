"""The workspace as an ordinary catkin one, without `./rpbi`."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

from sensor_msgs.msg import JointState

ROOT = Path(__file__).resolve().parents[2]


def _command(line: str) -> list[str]:
    """Returns a command line in a shell that knows nothing but `setup.bash`, other pythons first on the path."""
    keep = [f"{name}={os.environ[name]}" for name in ("ROS_MASTER_URI", "ROS_IP", "ROS_HOME", "HOME")]
    path = "PATH=/usr/local/bin:/usr/bin:/bin"
    return ["env", "-i", *keep, path, "bash", "-c", f"source {ROOT}/devel/setup.bash && exec {line}"]


def test_sourcing_setup_bash_is_enough_for_roslaunch(ros):
    states = ros.listen("/rpbi/kuka_lwr/joint_states", JointState)
    ros.start(_command("roslaunch rpbi_examples basic_example_kuka_lwr.launch headless:=true"))
    states.wait_for(50, timeout_s=60.0)
    assert states.messages[0].name[0] == "base_joint"


def test_sourcing_setup_bash_is_enough_for_python():
    line = "python3 -c 'import rpbi.world, rpbi_utils, pydantic; print(pydantic.VERSION, rpbi.__file__)'"
    printed = subprocess.run(_command(line.replace("python3", "/usr/bin/python3")), capture_output=True, text=True)
    assert printed.returncode == 0, printed.stderr
    assert printed.stdout.split("\n")[-2].startswith("2."), "pydantic is that of .venv"
