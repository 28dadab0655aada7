"""RViz, as the example opens it, shows the robot and the coloured depth where they are."""

from __future__ import annotations

import contextlib
import re
import time
from pathlib import Path

import numpy as np
import pytest
import rosnode
import yaml
from PIL import Image, ImageDraw
from rendering import back_project
from robot_shape import link_triangles, moved, pose_matrix
from ros_system import RosSystem, stop_group, wait_until
from rviz_view import RvizView, find_view, launch_with_rviz, start_rviz
from sensor_msgs.msg import CameraInfo
from sensor_msgs.msg import Image as ImageMessage
from tf2_msgs.msg import TFMessage

EXAMPLES = Path(__file__).resolve().parents[3] / "src/rpbi_examples"
CONFIG_FILE = EXAMPLES / "rviz/basic_example_kuka_lwr.rviz"
CONFIG = yaml.safe_load(CONFIG_FILE.read_text())["Visualization Manager"]
ARM = link_triangles(EXAMPLES / "robots/kuka_lwr.urdf", EXAMPLES)
CAMERA = "/rpbi/camera"
BOX_SIZE_M = np.array([0.20, 0.16, 0.12])

FORCES = "Forces on the box"
"""The display of arrows that stick out of the box."""
DARK_GREEN = (0, 60, 0)
"""A background that nothing in the scene looks like."""
DIFFERENT = 12
"""From so much on, of 255, a pixel has another colour."""
COMPLAINING = {"warning": (192, 128, 0), "error": (192, 32, 32)}
"""Colours in which RViz writes the name of a display that has something to complain of."""
HARMLESS = re.compile(r"arrived closer .* than the lower bound you provided|has had no processor time|too slow: ")
"""RViz's coloured depth believes that images come twice a second at most; and the machine may be busy."""
SLOW_S = 300.0


class View(RvizView):
    """RViz's view of the example, and what things look like in it."""

    def silhouette(self, triangles):
        """Returns the pixels that triangles of the world cover by half at least."""
        fine = 4
        picture = Image.new("L", (fine * self.width, fine * self.height))
        pen = ImageDraw.Draw(picture)
        for corners in fine * (self.project(triangles)[..., :2] + 0.5) - 0.5:
            pen.polygon([tuple(corner) for corner in corners], fill=1)
        return np.asarray(picture).reshape(self.height, fine, self.width, fine).mean(axis=(1, 3)) >= 0.5

    def paint(self, points, colours, size_px):
        """Returns what coloured points of the world look like, and the pixels that they cover."""
        u, v, depth = self.project(points).T
        farthest_first = np.argsort(-depth)
        u, v = np.rint(u).astype(int)[farthest_first], np.rint(v).astype(int)[farthest_first]
        picture = np.zeros((self.height, self.width, 3), np.uint8)
        covered = np.zeros((self.height, self.width), bool)
        nearest = np.full((self.height, self.width), np.inf)
        reach = range(-(size_px // 2), size_px // 2 + 1)
        for row, column in ((v + dv, u + du) for dv in reach for du in reach):
            inside = (row >= 0) & (row < self.height) & (column >= 0) & (column < self.width)
            inside &= depth[farthest_first] > 0
            place = row[inside], column[inside]
            near = depth[farthest_first][inside]
            own = np.full((self.height, self.width), np.inf)
            own[place] = near  # of points on the same pixel the last one stays, the nearest
            layer = np.zeros_like(picture)
            layer[place] = colours[farthest_first][inside]
            ahead = own < nearest
            picture[ahead], nearest[ahead] = layer[ahead], own[ahead]
            covered |= ahead
        return picture, covered


@pytest.fixture(scope="module")
def example(ros_master, screen, tmp_path_factory):
    """The example as a user with a screen launches it, with the arm standing still."""
    system = RosSystem(tmp_path_factory.mktemp("rviz"))
    try:
        launch_with_rviz(system, screen, "basic_example_kuka_lwr.launch", "move:=false")
        yield system
    finally:
        system.close()


@pytest.fixture(scope="module")
def frames(example):
    """Poses in the world of all frames, as 4x4 matrices."""
    moving, still = example.listen("/tf", TFMessage), example.listen("/tf_static", TFMessage)

    def known():
        messages = still.messages + moving.messages[-5:]
        poses = {one.child_frame_id: pose_matrix(one.transform) for each in messages for one in each.transforms}
        return poses if "rpbi/camera" in poses and "rpbi/kuka_lwr/base" in poses else None

    wait_until(lambda: len(moving.messages) > 100, "the arm has come to rest", SLOW_S)
    poses = wait_until(known, "all frames are known", SLOW_S)
    assert {pose.header.frame_id for message in moving.messages for pose in message.transforms} == {"rpbi/world"}
    moving.close()
    return poses


@pytest.fixture(scope="module")
def links(frames):
    """Triangles of the links in the world, by link."""
    return {link: moved(triangles, frames[f"rpbi/kuka_lwr/{link}"]) for link, triangles in ARM.items()}


@pytest.fixture(scope="module")
def cloud(example, frames):
    """What the camera sees: points in the world and their colours."""
    topics = {"colour/image": ImageMessage, "depth/image": ImageMessage, "depth/camera_info": CameraInfo}
    listeners = [example.listen(f"{CAMERA}/{topic}", kind) for topic, kind in topics.items()]
    colour, depth, info = (listener.wait_for(10, SLOW_S)[-1] for listener in listeners)
    for listener in listeners:
        listener.close()
    depth_m = np.frombuffer(depth.data, np.float32).reshape(depth.height, depth.width)
    points = back_project(depth_m, np.reshape(info.K, (3, 3))).reshape(-1, 3)
    return moved(points, frames["rpbi/camera"]), np.frombuffer(colour.data, np.uint8).reshape(-1, 3)


@pytest.fixture(scope="module")
def shipped(example, screen, cloud):
    """RViz as the example opened it: its panels, and what it and the others printed. It is closed then."""
    background = [int(part) for part in CONFIG["Global Options"]["Background Color"].split(";")]

    def is_shown(picture, view):
        return differs(picture, background)[view.paint(*cloud, point_size())[1]].mean() > 0.95

    _, window = settled(screen, is_shown, "the cloud is shown")
    panels = [screen.grab()[:, : window.x]]

    def has_no_complaint():  # it may have one until all have come up
        panels.append(screen.grab()[:, : window.x])
        return complaining_pixels(panels[-1]) < 10

    with contextlib.suppress(TimeoutError):
        wait_until(has_no_complaint, "no display complains", every_s=0.5)
    panels, printed = panels[-1], example.output(example.processes[-1])
    rosnode.kill_nodes(["/rviz"])
    wait_until(lambda: not screen.windows(), "RViz has closed", SLOW_S)
    return panels, printed


@pytest.fixture(scope="module")
def show(example, screen, shipped):
    """Shows some of the displays of the example's config in an RViz of their own, before another background."""

    def show(classes, is_shown, what):
        config = yaml.safe_load(CONFIG_FILE.read_text())
        manager = config["Visualization Manager"]
        shown = [display for display in manager["Displays"] if display["Class"] in classes]
        manager["Displays"] = [display for display in shown if display["Name"] != FORCES]
        manager["Global Options"]["Background Color"] = "; ".join(map(str, DARK_GREEN))
        rviz = start_rviz(example, screen, config, "_".join(sorted(classes)).replace("/", "-") + ".rviz")
        try:
            picture, window = settled(
                screen,
                lambda picture, view: not differs(picture[0], DARK_GREEN).any() and is_shown(picture, view),
                what,
            )
        except TimeoutError as error:
            raise AssertionError(f"{error}; RViz: {rviz.poll()}, {example.output(rviz)[-2000:]}") from error
        stop_group(rviz)
        wait_until(lambda: not screen.windows(), "RViz has closed", SLOW_S)
        return picture, View(CONFIG_FILE, window.width, window.height)

    return show


@pytest.fixture(scope="module")
def bare(show):
    """The picture without robot and depth."""
    return show({"rviz/Grid"}, lambda picture, _: differs(picture, DARK_GREEN).any(), "the grid is shown")[0]


def settled(screen, is_shown, what):
    """Waits until RViz's view shows what it should and has not changed for some time; returns picture and window."""
    seen = []

    def is_settled():
        time.sleep(0.2)
        window = find_view(screen)
        picture = None if window is None else screen.grab(window)
        if seen and (window != seen[-1][1] or differs(picture, seen[-1][0]).mean() > 0.002):
            seen.clear()
        if window is not None:
            seen.append((picture, window))
        return len(seen) >= 4 and is_shown(picture, View(CONFIG_FILE, window.width, window.height))

    wait_until(is_settled, what, SLOW_S)
    return seen[-1]


def complaining_pixels(panels):
    """Returns how many pixels have a colour of names of displays that complain, of the colour that has the most."""
    return max((panels == colour).all(axis=-1).sum() for colour in COMPLAINING.values())


def point_size():
    return next(each for each in CONFIG["Displays"] if each["Class"] == "rviz/DepthCloud")["Size (Pixels)"]


def differs(one, other):
    """Returns where two pictures, or a picture and a colour, differ."""
    return np.abs(np.asarray(one, int) - np.asarray(other, int)).max(axis=-1) > DIFFERENT


def grown(mask, by_px):
    """Returns a mask with its surroundings."""
    for axis in (0, 1):
        mask = np.any([np.roll(mask, shift, axis) for shift in range(-by_px, by_px + 1)], axis=0)
    return mask


def test_rviz_of_the_example_shows_the_cloud_without_complaints(shipped):
    panels, printed = shipped
    assert complaining_pixels(panels) < 10
    complaints = [line for line in printed.splitlines() if re.search(r"\[ *(WARN|ERROR|FATAL)\]", line)]
    assert [line for line in complaints if not HARMLESS.search(line)] == []


@pytest.mark.thorough
def test_robot_display_paints_the_arm_exactly_where_tf_has_it(show, bare, links):
    def is_shown(picture, view):
        arm = view.silhouette(np.concatenate(list(links.values())))
        return picture.shape == bare.shape and differs(picture, bare)[arm].mean() > 0.9

    picture, view = show({"rviz/Grid", "rviz/RobotModel"}, is_shown, "the robot is shown")
    painted = differs(picture, bare)
    arm = view.silhouette(np.concatenate(list(links.values())))
    assert arm.sum() > 10_000
    assert (painted & arm).sum() > 0.95 * (painted | arm).sum()
    assert not painted[~grown(arm, 3)].any()
    for link, triangles in links.items():
        assert painted[view.silhouette(triangles)].mean() > 0.95, link


@pytest.mark.thorough
def test_depth_display_paints_the_cameras_view_in_its_colours(show, bare, cloud):
    def is_shown(picture, view):
        covered = view.paint(*cloud, point_size())[1]
        return picture.shape == bare.shape and differs(picture, bare)[covered].mean() > 0.95

    picture, view = show({"rviz/Grid", "rviz/DepthCloud"}, is_shown, "the cloud is shown")
    expected, covered = view.paint(*cloud, point_size())
    assert 0.2 < covered.mean() < 0.8
    assert (~differs(picture, expected))[covered].mean() > 0.95
    assert (~differs(picture, bare))[~grown(covered, 2)].mean() > 0.99


@pytest.mark.thorough
def test_marker_display_paints_box_and_floor_without_the_robot(show, bare, frames, links):
    box = moved(cube_triangles() * BOX_SIZE_M, frames["rpbi/box"])

    def is_orange(picture):
        red, green, blue = np.moveaxis(picture.astype(int), -1, 0)
        return (red > 1.4 * green) & (green > 1.4 * blue)

    def is_shown(picture, view):
        return picture.shape == bare.shape and is_orange(picture)[view.silhouette(box)].mean() > 0.9

    picture, view = show({"rviz/Grid", "rviz/MarkerArray"}, is_shown, "the box is shown")
    silhouette, orange = view.silhouette(box), is_orange(picture)
    assert silhouette.sum() > 1000
    assert (orange & silhouette).sum() > 0.95 * (orange | silhouette).sum()  # and with it no orange ring of the arm
    floor = view.silhouette(links["lwr_arm_0_link"])  # where the arm stands
    assert differs(picture, bare)[floor].mean() > 0.99


def cube_triangles():
    """Returns the surface of a cube with edges of 1 m around the origin; shape (12, 3, 3)."""
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    sides = [(0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5)]
    return corners[[triangle for a, b, c, d in sides for triangle in ((a, b, c), (a, c, d))]]
