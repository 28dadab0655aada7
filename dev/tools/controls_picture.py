"""Draws docs/images/controls.png: the controls window with RViz's view in it, on a virtual screen.

./rpbi shell -c "python3 dev/tools/controls_picture.py docs/images/controls.png"
"""

import os
import signal
import subprocess
import sys
import time

from PIL import ImageGrab

from custom_ros_tools.ros.lifecycle.timed_master import unused_port

WORLD = "{rpbi_examples}/configs/basic_example_kuka_lwr/config.yaml"
SIZE = (1400, 800)
OPENS_S = 40.0
"""Time after which the window shows everything [s]."""


def main() -> None:
    """Opens the window, waits, and writes a screenshot."""
    reader, writer = os.pipe()
    screen = ["Xvfb", "-displayfd", str(writer), "-screen", "0", f"{SIZE[0]}x{SIZE[1]}x24", "-nolisten", "tcp"]
    server = subprocess.Popen(screen, pass_fds=[writer], stderr=subprocess.DEVNULL)
    display = ":" + os.read(reader, 16).decode().strip()
    port = str(unused_port())
    environment = {
        **os.environ,
        "DISPLAY": display,
        "LIBGL_ALWAYS_SOFTWARE": "1",
        "ROS_MASTER_URI": f"http://localhost:{port}",
    }
    command = ["roslaunch", "-p", port, "rpbi_examples", "world.launch", f"config:={WORLD}", "controls:=true"]
    launch = subprocess.Popen(command, env=environment, start_new_session=True)
    try:
        time.sleep(OPENS_S)
        ImageGrab.grab(xdisplay=display).save(sys.argv[1])
    finally:
        os.killpg(launch.pid, signal.SIGINT)
        launch.wait()
        server.terminate()
        server.wait()


if __name__ == "__main__":
    main()
