"""Restores hostile `.world` files in a running simulator by its service, and prints the results.

Run by `./rpbi shell -c 'python3 dev/robustness/states_in_node.py'`. A restore that takes longer than 10 s is ended by
`rpbi/stop`, as a user would. It exits with 1 if the node ends, prints a traceback, runs code, or does not answer.
"""

from __future__ import annotations

import argparse
import os
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from concurrent.futures import TimeoutError as TimedOut
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "dev"), *map(str, (ROOT / "tests/support").iterdir())]

import node_world  # noqa: E402
import rosgraph  # noqa: E402
import rospy  # noqa: E402
from cob_srvs.srv import SetString  # noqa: E402
from geometry_msgs.msg import Vector3  # noqa: E402
from ros_system import RosSystem, stop_group, wait_until  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402
from worlds import ball  # noqa: E402

from robustness.hostile_states import write_hostile  # noqa: E402
from robustness.states import write_good  # noqa: E402
from ros_pybullet_interface.srv import ChangeDynamics, GetStateHash, ListObjects, SetGravity  # noqa: E402

LONGEST_S = 10.0
"""Time after which a restore is stopped [s]."""


def main() -> None:
    """Restores the files."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--count", type=int, default=300, help="default: %(default)s")
    parser.add_argument("--first", type=int, default=0, help="the first seed; default: %(default)s")
    arguments = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="hostile-node-"))
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    os.environ.update(ROS_MASTER_URI=f"http://127.0.0.1:{port}", ROS_IP="127.0.0.1")
    os.environ["PYTHONPATH"] = os.pathsep.join((str(folder / "planted"), os.environ.get("PYTHONPATH", "")))
    command = ["rosmaster", "--core", "-p", str(port)]
    master = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
    try:
        wait_until(rosgraph.is_master_online, "the ROS master answers")
        rospy.init_node("hostile_states", disable_signals=True)
        verdicts = _restore_all(RosSystem(folder), folder, range(arguments.first, arguments.first + arguments.count))
    finally:
        stop_group(master)
    print(", ".join(f"{number} {verdict}" for verdict, number in verdicts.items()))
    shutil.rmtree(folder)
    sys.exit(bool(verdicts.keys() - {"taken", "refused", "stopped"}))


def _restore_all(ros: RosSystem, folder: Path, seeds: range) -> Counter[str]:
    for name in ("good", "planted"):
        (folder / name).mkdir()
    write_good(folder / "good")
    private = "/ros_pybullet_interface"
    rospy.set_param(f"{private}/config_file", str(folder / "good/world.yaml"))
    rospy.set_param(f"{private}/config", {"connect": {"connection_mode": "DIRECT"}})
    rospy.set_param(f"{private}/state_folder", str(folder))
    node = ros.start(["rosrun", "ros_pybullet_interface", "ros_pybullet_interface_node.py"])
    wait_until(lambda: "iiwa" in ros.call("/rpbi/list_objects", ListObjects).names, "the node serves")
    good = [folder / "good/node.world"]
    node_world.add(ros, config=ball("later"))
    ros.call("/rpbi/change_dynamics", ChangeDynamics, "box", "lateralFriction: 0.3")
    ros.call("/rpbi/set_gravity", SetGravity, Vector3(0.0, 0.0, -9.0))
    for _ in range(2):
        ros.call("/rpbi/save", SetString, str(good[0]))
        answer = ros.call("/rpbi/restore", SetString, str(good[0]))
        assert answer.success, answer.message
    verdicts: Counter[str] = Counter()
    longest_s, seen = 0.0, 0
    with ThreadPoolExecutor() as pool:
        for seed in seeds:
            place = folder / str(seed)
            place.mkdir()
            path, how = write_hostile(seed, place, good)
            shutil.move(place / "planted.py", folder / "planted/planted.py")
            verdict, text, answered_s = _restored(ros, pool, path)
            longest_s = max(longest_s, answered_s)
            said = ros.output(node)
            if node.poll() is not None:
                verdict = f"ended {node.poll()}"
            elif "Traceback" in said[seen:]:
                verdict, text = "traceback", said[seen:]
            elif (folder / "planted/canary").exists():
                verdict = "code"
            seen = len(said)
            verdicts[verdict] += 1
            if verdict not in ("taken", "refused"):
                print(f"{seed} ({how}): {verdict}: {text[-1500:]}", flush=True)
            shutil.rmtree(place)
            if node.poll() is not None:
                break
    status = Path(f"/proc/{node.pid}/status").read_text()
    print(f"largest size: {status.split('VmHWM:')[1].split('kB')[0].strip()} kB; longest answer: {longest_s:.1f} s")
    stop_group(node)
    return verdicts


def _restored(ros: RosSystem, pool: ThreadPoolExecutor, path: Path) -> tuple[str, str, float]:
    """Returns the verdict, the answer, and how long another service took to answer meanwhile [s]."""
    asked = pool.submit(ros.call, "/rpbi/restore", SetString, str(path))
    time.sleep(0.02)
    began_s = time.monotonic()
    ros.call("/rpbi/get_state_hash", GetStateHash)
    answered_s = time.monotonic() - began_s
    verdict = ""
    try:
        answer: Any = asked.result(LONGEST_S)
    except TimedOut:
        ros.call("/rpbi/stop", Trigger)
        ros.call("/rpbi/start", Trigger)
        answer, verdict = asked.result(6 * LONGEST_S), "stopped"
    text = answer.message
    return verdict or ("taken" if answer.success else "refused" if text.strip() else "silent"), text, answered_s


if __name__ == "__main__":
    main()
