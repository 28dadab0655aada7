"""A world of a user's own, by `./rpbi launch`."""

from __future__ import annotations

import math
import re
import sys
from pathlib import Path
from xmlrpc.client import ServerProxy

import pytest
import rosgraph
import rospy
import tf2_ros
from node_world import objects
from ros_system import wait_until
from visualization_msgs.msg import MarkerArray
from worlds import FLOOR, box, write_world

from custom_ros_tools.ros.lifecycle.timed_master import unused_port
from ros_pybullet_interface.msg import SimulationState
from rpbi_examples.ros.running_simulators import running_simulators

ROOT = Path(__file__).resolve().parents[3]
TABLE_TOP_M = 0.5


@pytest.fixture
def folder(tmp_path):
    """A folder with a world in it, whose files name each other relatively."""
    folder = tmp_path / "my world"
    folder.mkdir()
    table = {key: value for key, value in box("table", (0.3, 0.2, 0.25)).items() if key != "baseMass"}
    write_world(
        folder,
        collision=(FLOOR, {**table, "object_tf": {"tf_id": "rpbi/table"}}),
        dynamic=(box("cup", (0.02, 0.02, 0.05), basePosition=[0.6, 0.1, TABLE_TOP_M + 0.05], broadcast_hz=50.0),),
        poses=[
            {"tf_id": "rpbi/table", "position": [0.6, 0.0, 0.25], "rpy": [0.0, 0.0, math.pi / 2]},
            {"tf_id": "rpbi/handle", "parent": "rpbi/cup", "position": [0.03, 0.0, 0.0]},
        ],
        connect={"connection_mode": "GUI"},  # which opens only when the launch file is told so
    )
    return folder


RPBI = f"'{ROOT}/rpbi' launch world.yaml"
LAUNCH = f"{sys.executable} '{ROOT}/devel/lib/custom_ros_tools/console' launch"
"""The program of `./rpbi launch`, which is quicker without setting up the workspace."""
WORLD = f"{LAUNCH} world.yaml"
ROSLAUNCH = "roslaunch rpbi_examples world.launch config:=world.yaml"


def launch(ros, folder, command, **arguments):
    """Runs the world as a user in its folder does."""
    given = " ".join(f"{key}:={value}" for key, value in arguments.items())
    return ros.start(["bash", "-c", f"cd '{folder}' && exec {command} headless:=true {given}"])


def come_up(ros, process, namespace):
    """Waits until a world is up and returns the types of its objects by name."""
    found = wait_until(lambda: process.poll() is not None or objects(ros, namespace), f"{namespace} is up")
    assert process.poll() is None, ros.output(process)
    return found


def places(ros):
    """Returns what waits for a transform between two frames."""
    buffer = ros.listen_to_tf()

    def look(parent, child):
        try:
            return buffer.lookup_transform(parent, child, rospy.Time(0)).transform
        except tf2_ros.TransformException:
            return None

    def place(parent, child):
        return wait_until(lambda: look(parent, child), f"there is TF from {parent} to {child}")

    return place


@pytest.mark.thorough
def test_two_worlds_of_one_file_share_a_master_without_conflict(ros, folder):
    left = launch(ros, folder, f"{RPBI} --ns left")
    more = {"use_sim_time": "false", "real_time_factor": 0.5}
    right = launch(ros, folder, ROSLAUNCH, ns="right", tf_prefix="right", **more)
    place = places(ros)
    for name, process, factor in (("left", left, 1.0), ("right", right, 0.5)):
        assert come_up(ros, process, f"/{name}/") == {"floor": "collision", "table": "collision", "cup": "dynamic"}
        state = ros.listen(f"/{name}/rpbi/state", SimulationState)
        assert state.wait_for(1)[0].real_time_factor_asked == factor
        table = place(f"{name}/rpbi/world", f"{name}/rpbi/table")
        assert (table.translation.x, table.translation.z) == (0.6, 0.25)
        assert (table.rotation.z, table.rotation.w) == pytest.approx((math.sqrt(0.5), math.sqrt(0.5)))
        handle = place(f"{name}/rpbi/world", f"{name}/rpbi/handle")
        assert handle.translation.x == pytest.approx(0.63, abs=1e-3)
        assert handle.translation.z == pytest.approx(TABLE_TOP_M + 0.05, abs=2e-3), "the cup stands on the table"
        markers = ros.listen(f"/{name}/rpbi/markers", MarkerArray).wait_for(1)[0].markers
        frames = {marker.ns: marker.header.frame_id for marker in markers}
        assert frames == {frame: f"{name}/rpbi/{frame}" for frame in ("table", "cup")} | {"floor": f"{name}/rpbi/world"}
    running = "running: ./rpbi list, move, view --ns left"
    wait_until(lambda: running in ros.output(left), "the launch names the commands for it")
    assert ros.output(left).count("running: ./rpbi") == 1
    # rospy warns of connections that are closed at once, as those of these listeners may be; machines may be busy
    warnings = [line for line in ros.output(left).splitlines() if "[WARN]" in line]
    assert [line for line in warnings if "Inbound TCP/IP" not in line and "too slow" not in line] == []
    assert "/rpbi/status" not in [name for name, _ in rospy.get_published_topics()]


def test_world_that_cannot_be_built_ends_the_launch_with_reasons(ros, folder):
    (folder / "cup.yaml").write_text("name: cup\n")
    process = launch(ros, folder, RPBI)
    process.wait(120.0)
    printed = ros.output(process)
    assert "cup.yaml: baseMass: missing" in printed and "cup.yaml: createVisualShape: missing" in printed
    assert "Traceback" not in printed
    with pytest.raises(rosgraph.MasterError):
        rosgraph.Master("/tests").lookupService("/rpbi/list_objects")


def node_of(name):
    """Returns the address of a node that answers."""
    uri = rosgraph.Master("/tests").lookupNode(name)
    return uri if ServerProxy(uri).getPid("/tests")[2] else None


def test_a_running_simulator_is_stopped_only_on_purpose(ros, folder, ros_master):
    simulator = "/ros_pybullet_interface"
    dead = f"http://localhost:{unused_port()}"
    rosgraph.Master(simulator).registerService("/rpbi/list_objects", "rosrpc://localhost:1", dead)
    assert rosgraph.Master("/tests").lookupNode(simulator) == dead, "as if it had been killed"
    first = launch(ros, folder, WORLD, use_sim_time="false")
    come_up(ros, first, "/")
    address = wait_until(lambda: node_of(simulator), "the first simulator answers")

    second = launch(ros, folder, WORLD, use_sim_time="false")
    assert second.wait(120.0) == 2
    refused = (
        f"launch: {simulator} runs already on the ROS master at {ros_master}, and this would stop it: run this on "
    )
    offered = "a master of its own with -p PORT, or in a namespace with --ns NAME if both have use_sim_time:=false; "
    line = re.sub(r"-p \d+", "-p PORT", ros.output(second))
    assert line == f"{refused}{offered}--replace stops the one that runs\n"

    other = folder / "other.launch"
    other.write_text('<launch><node pkg="rpbi_utils" type="stand_in_node.py" name="ros_pybullet_interface"/></launch>')
    assert running_simulators(str(other), ros_master) == [], "what has no simulator may run"
    assert node_of(simulator) == address and first.poll() is None

    third = launch(ros, folder, f"{WORLD} --replace", use_sim_time="false")
    first.wait(120.0)
    assert come_up(ros, third, "/") and node_of(simulator) != address
