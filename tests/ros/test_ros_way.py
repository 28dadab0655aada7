"""The workspace as an ordinary catkin one, without `./rpbi`."""

from __future__ import annotations

import subprocess
from pathlib import Path

from clean_shell import in_clean_shell
from sensor_msgs.msg import JointState

ROOT = Path(__file__).resolve().parents[2]


SETUP = ROOT / "devel" / "setup.bash"


def test_sourcing_setup_bash_is_enough_for_roslaunch(ros):
    states = ros.listen("/rpbi/kuka_lwr/joint_states", JointState)
    ros.start(in_clean_shell("exec roslaunch rpbi_examples basic_example_kuka_lwr.launch headless:=true", SETUP))
    states.wait_for(50)
    assert states.messages[0].name[0] == "base_joint"


def test_sourcing_setup_bash_is_enough_for_python():
    line = "/usr/bin/python3 -c 'import rpbi.world, rpbi_utils, pydantic; print(pydantic.VERSION, rpbi.__file__)'"
    printed = subprocess.run(in_clean_shell(line, SETUP), capture_output=True, text=True)
    assert printed.returncode == 0, printed.stderr
    assert printed.stdout.split("\n")[-2].startswith("2."), "pydantic is that of .venv"
