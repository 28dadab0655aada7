"""The node of the browser view shows and controls a running simulator."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import rospy
from camera_world import CAMERA, box_world, place
from geometry_msgs.msg import Point
from node_world import objects, publishing
from ros_system import RPBI, RosSystem, wait_until
from sensor_msgs.msg import JointState
from soft_meshes import DEFORMABLE, block
from std_srvs.srv import Trigger
from viewer import Viewer
from visualization_msgs.msg import Marker
from worlds import iiwa

from ros_pybullet_interface.msg import SimulationState
from rpbi_data.bags.bag_reader import bag_to_dataframes
from rpbi_data.episodes.folder import EpisodeFolder

ODD = "<img src=x onerror=alert(1)>"


def start_view(ros: Any, *words: str) -> tuple[subprocess.Popen, str]:
    """Starts the node, and returns it with the link that it prints."""
    node = ros.start(["rosrun", "rpbi_data", "browser_view_node.py", "_port:=0", *words])
    wait_until(lambda: "view: http" in ros.output(node) or node.poll() is not None, "the link is printed")
    found = re.search(r"view: (\S+)", ros.output(node))
    assert found is not None, ros.output(node)
    return node, found[1]


@pytest.fixture(scope="module")
def world(module_ros: RosSystem) -> RosSystem:
    """A running world with an arm, a box and a camera."""
    more = {"robots": [module_ros.write_yaml("arm.yaml", iiwa(broadcast_link_states=True))], "rgbd_sensor": CAMERA}
    module_ros.simulator(box_world(module_ros, **more), use_sim_time=True)
    return module_ros


@pytest.fixture(scope="module")
def link(world: RosSystem) -> str:
    """Address of a view of the world."""
    return start_view(world)[1]


@pytest.fixture
def viewer(link: str) -> Iterator[Viewer]:
    with Viewer(link) as connected:
        yield connected


def has(viewer: Viewer, start: str) -> bool:
    return any(name.startswith(start) for name in list(viewer.nodes))


def test_all_bodies_are_shown(viewer: Viewer) -> None:
    viewer.wait(lambda: all(has(viewer, f"/{name}/") for name in ("box", "floor", "iiwa")))
    links = [name for name in viewer.nodes if re.fullmatch(r"/iiwa/rpbi∕iiwa∕\w+", name)]
    assert len(links) == 8 and all(viewer.nodes[each]["visible"] for each in links)


def test_world_is_stopped_stepped_and_started(viewer: Viewer, world: RosSystem) -> None:
    states = world.listen("/rpbi/state", SimulationState)
    viewer.press("Stop")
    assert viewer.wait_for_note("Stop") == "stopped"
    wait_until(lambda: not states.messages[-1].running, "the world is stopped")
    viewer.wait(lambda: str(viewer.value("World")).startswith("stopped"))
    tick = states.messages[-1].tick
    viewer.set("Ticks", 7)
    viewer.press("Run these ticks")
    wait_until(lambda: states.messages[-1].tick == tick + 7, "7 ticks are run")
    viewer.press("Start")
    wait_until(lambda: states.messages[-1].running, "the world runs")


def test_pace_is_changed_and_shown(viewer: Viewer, world: RosSystem) -> None:
    states = world.listen("/rpbi/state", SimulationState)
    viewer.set("Real-time factor", 0.5)
    wait_until(lambda: states.messages[-1].real_time_factor_asked == 0.5, "the world is slower")
    viewer.set("Real-time factor", 1.0)
    wait_until(lambda: states.messages[-1].real_time_factor_asked == 1.0, "the world has its pace again")


def test_added_object_is_shown_until_it_is_removed(viewer: Viewer, world: RosSystem) -> None:
    viewer.set("Name", "crate")
    viewer.set("New", "cylinder")
    viewer.set("Position [m]", [0.5, 0.5, 1.0])
    viewer.press("Add")
    assert "crate" in viewer.wait_for_note("Add")
    viewer.wait(lambda: has(viewer, "/crate/"))
    viewer.wait(lambda: viewer.offers("Object", "crate"))
    viewer.set("Object", "crate")
    viewer.press("Remove")
    viewer.wait(lambda: not has(viewer, "/crate"))
    assert "crate" not in objects(world)


def test_refused_actions_are_explained(viewer: Viewer) -> None:
    viewer.set("Name", "  ")
    viewer.press("Add")
    assert viewer.wait_for_note("Add") == "expected a name of the object"
    viewer.set("Object", "–")
    viewer.press("Remove")
    assert viewer.wait_for_note("Remove") == "expected a choice from the list"
    viewer.press("Set label")
    assert viewer.wait_for_note("Label") == "nothing is being recorded"


def test_sliders_follow_the_arm_and_move_it(viewer: Viewer, world: RosSystem) -> None:
    states = world.listen("/rpbi/iiwa/joint_states", JointState)
    joint = "lbr_iiwa_joint_2"
    viewer.wait(lambda: viewer.find(joint))
    states.wait_for(1)
    at = states.messages[-1].name.index(joint)
    viewer.set("Duration [s]", 0.5)
    viewer.set(joint, 0.4)
    viewer.press("Move")
    assert "reached" in viewer.wait_for_note("Move")
    assert states.messages[-1].position[at] == pytest.approx(0.4, abs=0.01)
    viewer.press("Home")
    viewer.wait_for_note("Home", "reached")
    viewer.wait(lambda: abs(viewer.value(joint)) < 0.01)


def test_image_is_only_drawn_while_it_is_shown(viewer: Viewer, world: RosSystem) -> None:
    topic = "rpbi/camera/colour/image/compressed"

    def has_subscriber() -> bool:
        return any(topic in name for name, _ in rospy.get_master().getSystemState()[2][1])

    with place("rpbi/eye"):
        viewer.wait(lambda: viewer.offers("Image", topic))
        assert not has_subscriber()
        viewer.set("Image", topic)
        viewer.wait(lambda: any(node.get("_image_data") for node in list(viewer.nodes.values())))
        viewer.wait(lambda: any(field.get("_data") and field.get("visible") for field in list(viewer.fields.values())))
        viewer.set("Image", "–")
        wait_until(lambda: not has_subscriber(), "nobody wants images")


def test_time_line_shows_the_past(viewer: Viewer, world: RosSystem) -> None:
    viewer.set("Name", "late")
    viewer.set("New", "box")
    before = viewer.value("World")
    viewer.wait(lambda: viewer.value("World") != before)
    viewer.press("Add")
    viewer.wait(lambda: has(viewer, "/late/"))
    viewer.set("Time line [s]", -30.0)
    viewer.wait(lambda: not has(viewer, "/late/"))
    viewer.set("Time line [s]", 0.0)
    viewer.wait(lambda: has(viewer, "/late/"))
    viewer.press("Reset")
    viewer.wait(lambda: not has(viewer, "/late/"))


def test_recording_has_topics_and_label(viewer: Viewer, monkeypatch: pytest.MonkeyPatch) -> None:
    viewer.set("Label", "first try")
    viewer.press("Record")
    assert "is being recorded" in viewer.wait_for_note("Record")
    viewer.press("Set label")
    viewer.wait_for_note("Label", "first try")
    viewer.wait(lambda: viewer.find("End"))
    viewer.press("End")
    bag = Path(viewer.wait_for_note("Record", "saved").removeprefix("saved "))
    try:
        assert bag.name.startswith("first_try_")
        tables = bag_to_dataframes(bag, ["/browser_view/label", "/rpbi/iiwa/joint_states"])
        assert list(tables["/browser_view/label"]["data"]) == ["first try"]
        assert len(tables["/rpbi/iiwa/joint_states"])
    finally:
        bag.unlink()


@pytest.mark.thorough
def test_node_of_episodes_records_if_it_runs(viewer: Viewer, world: RosSystem, tmp_path: Path) -> None:
    words = [f"_folder:={tmp_path}/demos", "_disk_reserve_mb:=1.0", f"_copy_from:=[{world.folder}]"]
    node = world.start(["rosrun", "episodes", "record_node.py", *words])
    try:
        wait_until(lambda: "/record/start" in _services(), "the node of episodes runs")
        viewer.set("Label", "good")
        viewer.wait(lambda: _is_recorded(viewer), 60.0)
        viewer.press("Set label")
        viewer.wait_for_note("Label", "episode 0: good")
        viewer.wait(lambda: viewer.find("End"))
        viewer.press("End")
        viewer.wait_for_note("Record", "episode 0 is complete")
    finally:
        os.killpg(node.pid, signal.SIGINT)
        node.wait(60.0)
    assert EpisodeFolder(tmp_path / "demos").read(0).label == "good"


def _services() -> set[str]:
    return {name for name, _ in rospy.get_master().getSystemState()[2][2]}


def _is_recorded(viewer: Viewer) -> bool:
    """Presses the button until the node of episodes is known to the view, and has received the world."""
    if not any("episode 0 is being recorded" in text for _, text in viewer.notes):
        viewer.press("End" if viewer.find("End") else "Record")
        time.sleep(1.0)
        return False
    return True


def test_markers_of_other_nodes_are_shown(viewer: Viewer, world: RosSystem) -> None:
    marker = Marker(ns=ODD, type=Marker.LINE_STRIP, points=[Point(0, 0, 0), Point(1, 0, 0), Point(1, 1, 0)])
    marker.header.frame_id, marker.color.a, marker.pose.orientation.w = "rpbi/world", 1.0, 1.0
    wrong = Marker(ns="wrong", type=Marker.MESH_RESOURCE, mesh_resource="http://example.org/mesh.stl")
    with publishing("goal", Marker) as publisher:
        publisher.publish(wrong)
        publisher.publish(marker)
        viewer.wait(lambda: has(viewer, f"/{ODD.replace('/', '∕')}/"))
        assert not has(viewer, "/wrong")
    viewer.wait(lambda: not has(viewer, "/<img"))  # its node has gone


def test_two_viewers_see_the_same(viewer: Viewer, link: str) -> None:
    with Viewer(link) as other:
        viewer.wait(lambda: has(viewer, "/iiwa/"))
        other.wait(lambda: viewer.nodes.keys() == other.nodes.keys())
        viewer.set("Frames", True)
        other.wait(lambda: "/frames" in other.nodes and other.value("Frames"))
        other.set("Frames", False)
        viewer.wait(lambda: "/frames" not in viewer.nodes)


def test_restarted_simulator_is_shown_with_deforming_soft_bodies(ros: RosSystem, tmp_path: Path) -> None:
    simulator = ros.simulator(box_world(ros), namespace="/again/")
    _, link = start_view(ros, "__ns:=/again")
    with Viewer(link) as viewer:
        viewer.wait(lambda: has(viewer, "/box/"))
        os.killpg(simulator.pid, signal.SIGINT)
        simulator.wait(60.0)
        viewer.wait(lambda: viewer.value("World") == "no simulator" and not has(viewer, "/box/"))
        soft = {"soft_objects": [ros.write_yaml("soft.yaml", block(tmp_path))], **DEFORMABLE}
        ros.simulator({**box_world(ros), **soft}, namespace="/again/")
        viewer.wait(lambda: has(viewer, "/box/") and has(viewer, "/jelly/"))
        updates = viewer.counts.get("SceneNodeUpdateMessage", 0)
        viewer.wait(lambda: viewer.counts.get("SceneNodeUpdateMessage", 0) > updates + 3)
        assert viewer.counts["MeshMessage"] < 20


def test_view_on_another_address_has_a_token(world: RosSystem, ros: RosSystem) -> None:
    node, link = start_view(ros, "_host:=127.0.0.2", "__name:=guarded")
    assert re.fullmatch(r"http://127\.0\.0\.2:\d+/\?token=[\w-]{20,}", link)
    os.killpg(node.pid, signal.SIGINT)
    assert node.wait(60.0) == 0 and "Traceback" not in ros.output(node)


@pytest.mark.thorough
def test_port_in_use_ends_the_node_with_one_line(ros: RosSystem, link: str) -> None:
    port = link.rstrip("/").rpartition(":")[2]
    node = ros.start(["rosrun", "rpbi_data", "browser_view_node.py", "__name:=second", f"_port:={port}"])
    assert node.wait(60.0) == 1
    assert f"port {port}: Address already in use" in ros.output(node) and "Traceback" not in ros.output(node)


@pytest.mark.thorough
def test_command_shows_the_running_world_until_it_is_interrupted(world: RosSystem) -> None:
    command = world.start([RPBI, "view", "--port", "0"])
    wait_until(lambda: "view: http" in world.output(command) or command.poll() is not None, "the link is printed")
    found = re.search(r"view: (\S+)", world.output(command))
    assert found is not None, world.output(command)
    with Viewer(found[1]) as viewer:
        viewer.wait(lambda: has(viewer, "/box/"))
        os.killpg(command.pid, signal.SIGINT)
        assert command.wait(60.0) == 0 and "Traceback" not in world.output(command)


@pytest.mark.thorough
def test_hanging_simulator_does_not_stop_the_view(ros: RosSystem) -> None:
    simulator = ros.simulator(box_world(ros), namespace="/hangs/")
    _, link = start_view(ros, "__ns:=/hangs")
    with Viewer(link) as viewer, publishing("hangs/goal", Marker) as publisher:
        viewer.wait(lambda: viewer.offers("Object", "box"))
        os.killpg(simulator.pid, signal.SIGSTOP)
        try:
            viewer.wait(lambda: viewer.value("World") == "no simulator")
            marker = Marker(ns="goal", type=Marker.CUBE)
            marker.header.frame_id, marker.color.a, marker.scale.x = "rpbi/world", 1.0, 1.0
            publisher.publish(marker)
            viewer.wait(lambda: has(viewer, "/goal/"))
        finally:
            os.killpg(simulator.pid, signal.SIGCONT)


@pytest.mark.thorough
def test_launch_shows_the_world_until_its_end(ros: RosSystem) -> None:
    world = ros.write_yaml("world.yaml", box_world(ros))
    launch = ros.start([RPBI, "launch", world, "headless:=true", "view:=true", "view_port:=0", "ns:=shown"])
    wait_until(lambda: "view: http" in ros.output(launch) or launch.poll() is not None, "the link is printed")
    found = re.search(r"view: (\S+)", ros.output(launch))
    assert found is not None, ros.output(launch)
    with Viewer(found[1]) as viewer:
        viewer.wait(lambda: has(viewer, "/box/"))
        assert ros.call("/shown/rpbi/stop", Trigger).success
        os.killpg(launch.pid, signal.SIGINT)
        assert launch.wait(60.0) == 0
        viewer.wait(lambda: not viewer.is_connected)
