"""An episode as one HTML file: bodies, poses and forces of the page are those of the bag."""

from __future__ import annotations

import base64
import contextlib
import io
import json
import re
import shutil
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pybullet
import pytest
import rosbag
import rospy
import zstandard
from genpy import Time
from node_world import add, main_config, publishing, remove
from pybullet_utils.bullet_client import BulletClient
from ros_system import RosSystem, wait_until
from sensor_msgs.msg import JointState
from soft_meshes import DEFORMABLE, block
from std_msgs.msg import String
from std_srvs.srv import Trigger
from worlds import FLOOR, ball, box, iiwa, write_world

from custom_ros_tools.console.modules import command_of
from ros_pybullet_interface.msg import Contacts, SimulationState
from rpbi.config.pybullet_world_models import ResetDebugVisualizerCamera
from rpbi.geometry import Pose
from rpbi.world import World
from rpbi_data import EpisodeFolder, bag_to_dataframes, transforms_between
from rpbi_data.episodes.folder import BAG
from rpbi_data.view.bag_messages import scene_of_episode
from rpbi_data.view.first_view import FOV_RAD, first_view
from rpbi_data.view.scene import PageScene

WEIGHT_N = 9.81
OFFSET_M = 1.5
"""Place of the second arm, beside the first one."""
CUBE = "".join(f"v {x} {y} {z}\n" for x in (-0.1, 0.1) for y in (-0.1, 0.1) for z in (-0.1, 0.1))
CUBE += "f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n"


def _view(*words: str | Path) -> tuple[int, str]:
    """Runs the command; returns its exit code and what it printed."""
    command = command_of("rpbi_data.console.view")
    assert command is not None
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(out):
        try:
            code = command.run([str(word) for word in words])
        except SystemExit as error:
            code = int(error.code or 0)
    return code, out.getvalue()


class _Page:
    """Content of a page: the messages that viser plays, and the data of the plots."""

    def __init__(self, path: Path) -> None:
        self.text = path.read_text()
        data = base64.b64decode(re.search(r'__VISER_EMBED_DATA__="([^"]+)"', self.text)[1])  # type: ignore[index]
        raw = zstandard.ZstdDecompressor().decompress(data[8:], int.from_bytes(data[:8], "little"))
        end = 8 + int.from_bytes(raw[:8], "little")
        content = msgspec.msgpack.decode(raw[8:end])
        self.seconds, self.messages = content["durationSeconds"], content["messages"]
        self.buffers = []
        for size in content["binaryBufferLengths"]:
            end += -end % 8
            self.buffers.append(raw[end : end + size])
            end += size
        self.plots = json.loads(re.search(r"const EPISODE=(.*?);</script>", self.text)[1])  # type: ignore[index]

    def of(self, name: str, kind: str) -> list[tuple[float, dict[str, Any]]]:
        """Returns the messages of a node of viser's scene with their times."""
        return [(at_s, each) for at_s, each in self.messages if each.get("name") == name and kind in each["type"]]

    def position(self, name: str, at_s: float) -> np.ndarray:
        """Returns the position of a node at a time."""
        sent = [each["position"] for sent_s, each in self.of(name, "SetPosition") if sent_s <= at_s + 1e-9]
        return np.array(sent[-1]) if sent else np.zeros(3)

    def is_visible(self, name: str, at_s: float) -> bool:
        """Returns whether a node is shown at a time."""
        return [each["visible"] for sent_s, each in self.of(name, "Visibility") if sent_s <= at_s][-1:] != [False]

    def arrows(self, name: str) -> list[np.ndarray]:
        """Returns starts and ends of the arrows of a node, each shape (k, 2, 3), in the order in which they change."""
        created = [each["props"]["points"] for _, each in self.of(name, "ArrowsMessage")]
        changed = [each["updates"]["points"] for _, each in self.of(name, "Update") if "points" in each["updates"]]
        found = [self.buffers[each["__binary_index"]] for each in (*created, *changed)]
        return [np.frombuffer(each, np.float32).reshape(-1, 2, 3) for each in found]


def _pixels_at_first(scene: PageScene, width: int = 640, height: int = 270) -> list[int]:
    """Returns how many pixels of the page's first view show each link that is there then, in order."""
    client = BulletClient(pybullet.DIRECT)
    bodies = []
    for link in scene.links:
        if not link.is_there[0]:
            continue
        place = Pose(tuple(link.poses.position[0]), tuple(link.poses.rotation[0].as_quat()))
        bodies.append([])
        for shape in link.shapes:
            kind: dict[str, Any] = {"shapeType": pybullet.GEOM_BOX, "halfExtents": np.array(shape.size) / 2}
            if shape in scene.meshes:
                mesh = scene.meshes[shape]
                corners, triangles = mesh.corners.tolist(), mesh.triangles.ravel().tolist()
                kind = {"shapeType": pybullet.GEOM_MESH, "vertices": corners, "indices": triangles}
            visual, pose = client.createVisualShape(**kind), place @ shape.pose_in_link
            bodies[-1].append(client.createMultiBody(0.0, -1, visual, pose.position, pose.quat_xyzw))
    view = client.computeViewMatrix(*scene.camera, (0.0, 0.0, 1.0))
    opening = client.computeProjectionMatrixFOV(np.degrees(FOV_RAD), width / height, 0.05, 50.0)
    options = {"renderer": pybullet.ER_TINY_RENDERER, "flags": pybullet.ER_SEGMENTATION_MASK_OBJECT_AND_LINKINDEX}
    mask = np.reshape(client.getCameraImage(width, height, view, opening, **options)[4], -1)
    client.disconnect()
    return [int(np.isin(mask, of_link).sum()) for of_link in bodies]


@pytest.fixture(scope="module")
def episode(module_ros: RosSystem, tmp_path_factory: pytest.TempPathFactory) -> EpisodeFolder:
    """An episode in which a box falls on the floor, two arms move alike, and a ball comes and goes."""
    ros, place = module_ros, tmp_path_factory.mktemp("view")
    files = place / "files"
    files.mkdir()
    (files / "cube.obj").write_text(CUBE)
    sensor = {"enabled_joint_force_torque_sensors": ["lbr_iiwa_joint_7"], "joint_state_publisher_hz": 100}
    moved = {"fileName": "kuka_iiwa/model.urdf", "useFixedBase": True, "basePosition": [0.0, OFFSET_M, 0.0]}
    mesh = {"shapeType": "GEOM_MESH", "fileName": str(files / "cube.obj"), "meshScale": [1.0, 1.0, 2.0]}
    world = main_config(
        files,
        collision=(FLOOR,),
        dynamic=(
            box(createVisualShape=mesh, basePosition=[0.7, 0.0, 0.3], broadcast_hz=50, contacts={"hz": 100}),
            box("hidden", basePosition=[-1.0, 0.0, 0.1]),
        ),
        robots=(
            iiwa("left", broadcast_link_states=True, **sensor),
            iiwa("right", loadURDF=moved, joint_state_publisher_hz=100),
        ),
        start_pybullet_after_initialization=False,
    )
    ros.simulator(world, use_sim_time=True)
    states = ros.listen("/rpbi/state", SimulationState)
    demos = EpisodeFolder(place / "demos")
    rospy.set_param("/record/folder", str(demos.path))
    rospy.set_param("/record/copy_from", [str(place)])
    ros.start(["rosrun", "episodes", "record_node.py"])
    wait_until(lambda: ros.call("/record/start", Trigger).success, "it records")

    def wait_for_tick(tick: int) -> None:
        wait_until(lambda: states.messages[-1].tick > tick, f"tick {tick} has come")

    with contextlib.ExitStack() as stack:
        names = [f"/rpbi/{name}/joint_states/target" for name in ("left", "right")]
        for target in [stack.enter_context(publishing(name, JointState)) for name in names]:
            target.publish(JointState(name=["lbr_iiwa_joint_2", "lbr_iiwa_joint_4"], position=[0.8, -0.9]))
        ros.call("/rpbi/start", Trigger)  # both are applied in the first tick
        wait_for_tick(600)
        assert add(ros, config=ball("ball", basePosition=[0.0, -1.0, 1.0], broadcast_hz=50)).success
        wait_for_tick(1000)
        assert remove(ros, "ball").success
        wait_for_tick(1400)
    assert ros.call("/record/stop", Trigger).success
    shutil.rmtree(files)  # the page is made with the copies
    return demos


@pytest.fixture(scope="module")
def page(episode: EpisodeFolder, tmp_path_factory: pytest.TempPathFactory) -> _Page:
    path = tmp_path_factory.mktemp("page") / "new" / "episode.html"
    code, text = _view(episode.path, 0, "--out", path)
    assert code == 0, text
    assert text.startswith(f"{path}: ") and "note: hidden is shown where it started: it is not on TF\n" in f"{text}\n"
    assert [each.name for each in path.parent.iterdir()] == ["episode.html"]
    return _Page(path)


@pytest.fixture(scope="module")
def tables(episode: EpisodeFolder) -> dict[str, Any]:
    return bag_to_dataframes(episode.folder_of(0) / BAG)


def test_it_is_small_and_needs_no_network(page: _Page) -> None:
    assert len(page.text) < 2_000_000
    addresses = {found[1] for found in re.finditer(r"""(?:src|href)=["']?(.{5})""", page.text)}
    assert addresses <= {"data:"}
    assert set(re.findall(r"https?://[\w.-]+", page.text)) <= {"http://www.w3.org"}


def test_bodies_have_their_shapes(page: _Page) -> None:
    shapes = {each["name"]: each for _, each in page.messages if "props" in each}
    assert {"/floor/link0/0", "/box/link0/0", "/hidden/link0/0", "/ball/link0/0"} <= shapes.keys()
    for arm in ("left", "right"):
        assert {f"/{arm}/lbr_iiwa_link_{number}/0" for number in range(8)} <= shapes.keys()
    mesh = shapes["/box/link0/0"]["props"]
    corners = np.frombuffer(page.buffers[mesh["vertices"]["__binary_index"]], np.float32).reshape(-1, 3)
    np.testing.assert_allclose(np.ptp(corners, axis=0), [0.2, 0.2, 0.4], atol=1e-6)
    assert shapes["/hidden/link0/0"]["type"] == "BoxMessage"


def test_poses_are_those_of_tf(page: _Page, tables: dict[str, Any]) -> None:
    start_s = tables["/rpbi/state"].index[0]
    times = sorted({at_s for at_s, _ in page.messages})
    assert times[-1] <= page.seconds + 1e-9 and len(times) > 25
    for node, frame in {"/box/link0": "rpbi/box", "/left/lbr_iiwa_link_7": "rpbi/left/lbr_iiwa_link_7"}.items():
        found = transforms_between(tables, "rpbi/world", frame, times=start_s + np.array(times[2:-2]))
        places = found[[f"translation/{axis}" for axis in "xyz"]].to_numpy()
        shown = [page.position(node, at_s - start_s + 1e-4) for at_s in found.index]
        np.testing.assert_allclose(shown, places, atol=1e-3)
        assert np.ptp(places, axis=0).max() > 0.1


def test_links_that_are_not_on_tf_follow_from_joint_states(page: _Page) -> None:
    """The second arm starts and ends as the first one, in another place."""
    for at_s in (0.0, page.seconds):
        for number in (0, 4, 7):
            left, right = (page.position(f"/{arm}/lbr_iiwa_link_{number}", at_s) for arm in ("left", "right"))
            np.testing.assert_allclose(right - left, [0.0, OFFSET_M, 0.0], atol=0.002)
    tips = [page.position("/right/lbr_iiwa_link_7", at_s) for at_s in np.linspace(0.0, page.seconds, 40)]
    steps = np.linalg.norm(np.diff(tips, axis=0), axis=1)
    assert np.ptp(tips, axis=0).max() > 0.5 and (steps > 0.005).sum() > 5


def test_object_is_shown_only_while_it_is_present(page: _Page, tables: dict[str, Any]) -> None:
    on_tf = tables["/tf"].query("child == 'rpbi/ball'").index - tables["/rpbi/state"].index[0]
    assert not page.is_visible("/ball/link0", 0.0) and not page.is_visible("/ball/link0", page.seconds)
    seen = [at_s for at_s in np.arange(0.0, page.seconds, 0.02) if page.is_visible("/ball/link0", at_s)]
    assert seen[0] == pytest.approx(on_tf[0], abs=0.1) and seen[-1] == pytest.approx(on_tf[-1], abs=0.1)
    assert page.is_visible("/box/link0", 0.0) and page.is_visible("/box/link0", page.seconds)


def test_first_view_shows_all_links_from_above_the_floor(episode: EpisodeFolder) -> None:
    """The world has no `resetDebugVisualizerCamera`."""
    scene = scene_of_episode(episode, 0)
    assert scene.camera[0][2] > 0.3
    pixels = _pixels_at_first(scene)
    names = [f"{link.body}/{link.name}" for link in scene.links if link.is_there[0]]
    assert len(names) > 18 and {name: count for name, count in zip(names, pixels) if count < 10} == {}


def test_first_view_follows_the_camera_of_the_world() -> None:
    own = ResetDebugVisualizerCamera(cameraDistance=2.0, cameraPitch=-90.0, cameraTargetPosition=(1.0, 2.0, 0.0))
    position, target = first_view(own, [], {})
    np.testing.assert_allclose([position, target], [[1.0, 2.0, 2.0], [1.0, 2.0, 0.0]], atol=1e-9)


def test_forces_are_arrows_and_lines(page: _Page) -> None:
    metres_per_newton = 0.1 / float(re.fullmatch(r"arrows: 0.1 m is ([\d.]+) N", page.plots["legend"])[1])  # type: ignore[index]
    last = page.arrows("/forces/rpbi.box.contacts")[-1]
    np.testing.assert_allclose(last[:, 0, 2], 0.0, atol=2e-3)
    force = (last[:, 1] - last[:, 0]).sum(axis=0) / metres_per_newton
    np.testing.assert_allclose(force, [0.0, 0.0, WEIGHT_N], atol=0.3)
    assert not page.is_visible("/forces/rpbi.box.contacts", 0.1)  # it falls
    assert page.arrows("/forces/rpbi.left.lbr_iiwa_joint_7.ft_sensor")
    panels = {panel["title"]: {line["name"]: line for line in panel["lines"]} for panel in page.plots["panels"]}
    normal = panels["/rpbi/box/contacts: normal force [N]"]["by floor"]
    assert normal["y"][-1] == pytest.approx(WEIGHT_N, abs=0.1) and normal["y"][0] == 0.0
    assert normal["x"][-1] == pytest.approx(page.seconds, abs=0.1)
    assert {"x", "y", "z"} == panels["/rpbi/left/lbr_iiwa_joint_7/ft_sensor: torque [N m]"].keys()


def test_a_bag_by_itself_with_a_soft_body(tmp_path: Path) -> None:
    (tmp_path / "jelly.yaml").write_text("")
    world = World.from_file(write_world(tmp_path, collision=(FLOOR,), soft=(block(tmp_path),), **DEFORMABLE))
    description = world.describe()
    world.close()
    path = tmp_path / "soft.bag"
    with rosbag.Bag(str(path), "w") as bag:
        bag.write("/rpbi/world_description", String(description), Time(10))
        for seconds in (10, 12):
            state = SimulationState(tick=1000 * (seconds - 10))
            state.header.stamp = Time(seconds)
            bag.write("/rpbi/state", state, Time(seconds))
        bag.write("/rpbi/jelly/contacts", Contacts(), Time(11))
        bag._topic_connections.clear()  # else it would be written as Contacts
        bag.write("/rpbi/jelly/contacts", String("a"), Time(11))
    code, text = _view(path, "--out", tmp_path / "soft.html")
    came = "ros_pybullet_interface/Contacts and std_msgs/String"
    assert f"note: /rpbi/jelly/contacts is not shown: expected messages of one type, got {came}" in text
    assert code == 0 and "note: jelly is not shown: it is soft" in text and ": 2.0 s, " in text
    assert _Page(tmp_path / "soft.html").plots["panels"] == []


def test_impossible_views_are_named_in_one_line(episode: EpisodeFolder, tmp_path: Path) -> None:
    empty = tmp_path / "empty.bag"
    with rosbag.Bag(str(empty), "w") as bag:
        bag.write("/text", String("a"), Time(1))
    for words, code, message in (
        ((episode.path, 7), 1, "no episode 7; there are 0"),
        ((episode.path,), 2, "expected a folder and the number of an episode, or a bag, got "),
        ((empty,), 1, "no messages of /rpbi/world_description, which describes the world"),
        ((tmp_path / "none.bag",), 1, "none.bag: there is no such file"),
        ((episode.path, 0, "--out", "/dev/null/page.html"), 1, "/dev/null/page.html: cannot be written: "),
    ):
        found, text = _view(*words)
        assert found == code and message in text.splitlines()[-1], text
