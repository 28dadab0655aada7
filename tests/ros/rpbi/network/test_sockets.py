"""Where the simulator and its camera listen: where ROS_IP and ROS_HOSTNAME tell ROS to."""

from __future__ import annotations

import contextlib
import os
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest
from camera_world import CAMERA, box_world, place
from ros_system import wait_until
from sensor_msgs.msg import Image

LISTENING = "0A"
LOOPBACK = {"0100007F", "00000000000000000000000001000000"}
"""127.0.0.1 and ::1, as the kernel writes them."""


def listening(group: int) -> dict[int, list[str]]:
    """Returns the addresses at which each process of a group listens on TCP, as the kernel writes them, by its id."""
    by_inode = {}
    for table in ("/proc/net/tcp", "/proc/net/tcp6"):
        for line in Path(table).read_text().splitlines()[1:] if Path(table).exists() else ():
            fields = line.split()
            if fields[3] == LISTENING:
                by_inode[f"socket:[{fields[9]}]"] = fields[1].partition(":")[0]
    found: dict[int, list[str]] = {}
    for process in map(int, filter(str.isdigit, os.listdir("/proc"))):
        with contextlib.suppress(OSError):  # it has just ended
            if os.getpgid(process) == group:
                found[process] = [by_inode[link] for link in _open_files(process) if link in by_inode]
    return found


def _open_files(process: int) -> Iterator[str]:
    for handle in os.listdir(f"/proc/{process}/fd"):
        with contextlib.suppress(OSError):  # it has just been closed
            yield os.readlink(f"/proc/{process}/fd/{handle}")


def test_the_kernel_s_table_is_read_right():
    with socket.create_server(("127.0.0.1", 0)), socket.create_server(("0.0.0.0", 0)):
        addresses = listening(os.getpgid(0))[os.getpid()]
    assert {"0100007F", "00000000"} <= set(addresses)


@pytest.mark.parametrize(
    ("told", "stays_local"),
    [
        ({"ROS_IP": "127.0.0.1"}, True),
        ({"ROS_HOSTNAME": "localhost", "ROS_IP": ""}, True),
        ({"ROS_HOSTNAME": "localhost", "ROS_IP": "192.0.2.1"}, True),
        ({"ROS_IP": "192.0.2.1"}, False),
    ],
    ids=["IP", "name", "name before IP", "another address"],
)
def test_simulator_and_camera_listen_at_the_configured_address(ros, told, stays_local):
    """With an address of another kind rospy listens everywhere, which shows that the others tell something."""
    with place("rpbi/eye"):
        simulator = ros.simulator(box_world(ros, rgbd_sensor=CAMERA), wait=stays_local, **told)
        if stays_local:
            ros.listen("/rpbi/camera/colour/image", Image).wait_for(1)
        processes = wait_until(
            lambda: (
                len(found := listening(simulator.pid)) == 2 and all(len(each) >= 2 for each in found.values()) and found
            ),
            "node and camera listen for topics and calls",
        )
    addresses = {address for each in processes.values() for address in each}
    assert (addresses <= LOOPBACK) == stays_local, processes
