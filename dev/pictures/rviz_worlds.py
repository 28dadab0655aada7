"""Pictures of example worlds in RViz."""

from __future__ import annotations

import math
import re
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import rospy
from files import write_png
from geometry_msgs.msg import Point, PoseStamped
from labels import colour_image, depth_image, inset, label, with_legend
from nav_msgs.msg import Path as PathMessage
from PIL import Image
from render import Photographer, beside
from rviz_view import rviz_camera
from screen import Latest, Stage, call, next_message, wait_until
from sensor_msgs.msg import CameraInfo, PointCloud2
from sensor_msgs.msg import Image as ImageMessage
from std_msgs.msg import String
from visualization_msgs.msg import Marker, MarkerArray

from custom_ros_tools.ros.tf_interface import TfInterface
from custom_ros_tools.ros.transform_messages import as_pose
from ros_pybullet_interface.msg import Contacts
from rpbi_examples.motions import CIRCLE_PERIOD_S, hand_position

ROOT = Path(__file__).resolve().parents[2]
RVIZ = ROOT / "src/rpbi_examples/rviz"
WORLD = "rpbi/world"
CAMERA, COLOUR, DEPTH = "rpbi/camera", "rpbi/camera/colour/image", "rpbi/camera/depth/image"
ARROW_M_PER_N = 0.04
"""Length of the arrows in the demo, as in its box.yaml [m/N]."""
FALLEN = rospy.Time(6.0)
"""Time at which all objects lie on the table."""
FLOOR_M, FAR_M = 0.05, 1.5
"""Height up to which points belong to the floor, and largest depth in the picture of the depth image [m]."""
ANGLE = -1.0
"""Angle of the orbiting camera about the vertical [rad]."""
ABOVE_BOX_M = 0.13
"""Height of drawn paths above the hand, so that the box does not hide them [m]."""
PUSH_N = 5.2
"""Force of the arm on the box at which the demo's picture is taken [N]."""


class View:
    """Where RViz's camera is.

    Args:
        focus: Point that the view turns about, in the world's frame [m].
        distance_m: Distance of the camera from this point [m].
        pitch: Angle of the camera above the horizontal plane [rad].
        yaw: Angle of the camera about the vertical [rad].
    """

    def __init__(self, focus: Sequence[float], distance_m: float, pitch: float, yaw: float) -> None:
        self.of_rviz = {"Distance": distance_m, "Focal_Point": dict(zip("XYZ", focus)), "Pitch": pitch, "Yaw": yaw}
        self._camera = (focus, distance_m, pitch, yaw)

    def camera(self, size: tuple[int, int]) -> Photographer:
        """Returns the same camera, for labels in a picture of `size` [px]."""
        return rviz_camera(*self._camera, size)


def push_n(contacts: Contacts) -> float:
    """Returns the force of the arm on the box [N]."""
    return float(sum(each.normal_force for each in contacts.points if each.other_body == "kuka_lwr"))


def arrows_of(markers: MarkerArray) -> list[Any]:
    """Returns begin and end of each arrow, shape (2, 3) [m]."""
    arrows = [each for each in markers.markers if each.action == Marker.ADD and len(each.points) == 2]
    return [np.array([(point.x, point.y, point.z) for point in each.points]) for each in arrows]


def demo(path: Path) -> None:
    """The arm pushes the box, with the camera's image."""
    view = View((0.18, -0.02, 0.25), 1.1, 0.65, 2.2)
    hidden = {"kuka_lwr": False, "work_area": False}
    shown = {"Coloured depth": None, "TF": None, "World": {"Namespaces": hidden}}
    with Stage(1280, 720) as stage:
        stage.launch("basic_example_kuka_lwr.launch", "real_time_factor:=0.2")
        stage.rviz(RVIZ / "basic_example_kuka_lwr.rviz", shown, **view.of_rviz)
        image, markers = Latest(COLOUR, ImageMessage), Latest("rpbi/box/contacts/arrows", MarkerArray)
        next_message("rpbi/box/contacts", Contacts, lambda each: push_n(each) > PUSH_N)
        stage.stop_world()
        picture = stage.still_picture()
    camera, arrows = view.camera(picture.size), arrows_of(markers.message)
    push = min(arrows, key=lambda each: abs(each[1, 2] - each[0, 2]))
    column, row = camera.pixel(push[1])
    newtons = np.linalg.norm(push[1] - push[0]) / ARROW_M_PER_N
    label(picture, f"force of the arm: {newtons:.1f} N", (column - 90, row + 80), (column, row + 4))
    floor = max(arrows, key=lambda each: each[1, 2])
    column, row = camera.pixel(floor[1])
    label(picture, "force of the floor", (column + 160, row - 60), (column, row))
    inset(picture, colour_image(image.message).resize((360, 270)), "camera image", (20, 20))
    write_png(path, picture)


def clutter_rviz(path: Path) -> None:
    """Objects on a table as a point cloud and markers, and the images of the camera."""
    view = View((0.0, -0.02, 0.41), 1.0, 0.75, 5.55)
    cloud = {"Topic": "/pictures/cloud"}
    with Stage(860, 640) as stage:
        stage.launch("clutter.launch", "start:=false")
        publisher = rospy.Publisher("/pictures/cloud", PointCloud2, queue_size=1, latch=True)
        shown = {"TF": {"Marker Scale": 0.3}, "Coloured point cloud": cloud}
        stage.rviz(RVIZ / "clutter.rviz", shown, **view.of_rviz)
        colour, depth = Latest(COLOUR, ImageMessage), Latest(DEPTH, ImageMessage)
        points = Latest("rpbi/camera/pointcloud", PointCloud2)
        tf = TfInterface()
        call("rpbi/start")
        next_message(COLOUR, ImageMessage, lambda each: each.header.stamp > FALLEN)
        camera = TfInterface.msg_to_matrix(tf.wait_for_tf_msg(WORLD, points.message.header.frame_id))
        stage.stop_world()
        publisher.publish(points_above(points.message, camera, FLOOR_M))
        picture = stage.still_picture()
    whole = Image.new("RGB", (1280, 640), "white")
    whole.paste(picture)
    inset(whole, colour_image(colour.message).resize((412, 316)), "colour image", (866, 2))
    inset(
        whole,
        depth_image(depth.message, 0.5, FAR_M).resize((412, 316)),
        f"depth: 0.5 m is yellow, {FAR_M:g} m violet",
        (866, 322),
    )
    label(whole, "RViz: point cloud, frames", (124, 20))
    write_png(path, whole, dither=True)


def points_above(cloud: PointCloud2, camera: Any, height_m: float) -> PointCloud2:
    """Returns the points of a cloud that are above a height in the world [m]; `camera` is the pose of its frame."""
    rows = np.frombuffer(cloud.data, np.uint8).reshape(-1, cloud.point_step)
    begin = next(each.offset for each in cloud.fields if each.name == "x")
    places = rows[:, begin : begin + 12].copy().view(np.float32)
    near = rows[places @ camera[2, :3] + camera[2, 3] > height_m]
    return PointCloud2(
        cloud.header,
        1,
        len(near),
        cloud.fields,
        cloud.is_bigendian,
        cloud.point_step,
        near.size,
        near.tobytes(),
        cloud.is_dense,
    )


def frustum(info: CameraInfo, depth_m: float) -> Marker:
    """Returns the field of view of a camera as lines up to a depth [m]."""
    marker = Marker(type=Marker.LINE_LIST, frame_locked=True)
    marker.header.frame_id = info.header.frame_id
    marker.pose.orientation.w = 1.0
    marker.scale.x = 0.01
    marker.color.a = 1.0
    x, y = info.width / 2 / info.K[0] * depth_m, info.height / 2 / info.K[4] * depth_m
    corners = [Point(a * x, b * y, depth_m) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    for one, other in zip(corners, (*corners[1:], corners[0])):
        marker.points += [Point(), one, one, other]
    return marker


def rgbd_cloud(path: Path) -> None:
    """The coloured point cloud of the orbiting camera, and its image."""
    view = View((0.15, -0.45, 0.5), 3.4, 0.5, -0.25)
    lines = {"Class": "rviz/Marker", "Marker Topic": "/pictures/camera"}
    with Stage(1280, 720) as stage:
        stage.launch("pybullet_rgbd_example.launch", "real_time_factor:=0.2")
        stage.rviz(RVIZ / "pybullet_rgbd_example.rviz", {"TF": None, "Camera": lines}, **view.of_rviz)
        publisher = rospy.Publisher("/pictures/camera", Marker, queue_size=1, latch=True)
        publisher.publish(frustum(next_message("rpbi/camera/colour/camera_info", CameraInfo), 0.5))
        image, tf = Latest(COLOUR, ImageMessage), TfInterface()

        def is_good(cloud: PointCloud2) -> bool:
            position, _ = tf.get_tf(WORLD, CAMERA)
            box = tf.get_tf_msg(WORLD, "rpbi/box")
            if position is None or box is None or abs((box.header.stamp - cloud.header.stamp).to_sec()) > 0.3:
                return False
            angle = math.atan2(position[1], position[0])
            return box.transform.translation.z < 0.25 and abs(angle - ANGLE) < 0.1

        next_message("rpbi/camera/pointcloud", PointCloud2, is_good)
        stage.stop_world()
        picture = stage.still_picture()
        position, _ = tf.get_tf(WORLD, CAMERA)
    column, row = view.camera(picture.size).pixel(position)
    label(picture, "camera", (column, row - 30))
    inset(picture, colour_image(image.message).resize((400, 300)), "colour image", (860, 20))
    write_png(path, picture)


def ik_drag(path: Path) -> None:
    """The arm before and after its target was dragged up with the mouse."""
    target, tip, up_m = "rpbi/figure_eight", "rpbi/kuka_lwr/end_effector_ball", 0.2
    view = View((0.12, 0.0, 0.5), 1.6, 0.6, 4.9)
    with Stage(636, 560) as stage:
        stage.launch("kuka_lwr_ik_example.launch", "drag:=true")
        stage.rviz(RVIZ / "kuka_lwr_ik_example.rviz", {"TF": None}, **view.of_rviz)
        tf = TfInterface()

        def is_followed(position: Any) -> bool:
            here, _ = tf.get_tf(WORLD, tip)
            return here is not None and bool(np.linalg.norm(here - position) < 0.005)

        start, _ = wait_until(lambda: (found := tf.get_tf(WORLD, target))[0] is not None and found, "target")
        wait_until(lambda: is_followed(start), "the arm is at the target")
        before = stage.still_picture()
        camera = view.camera((stage.width, stage.height))
        handle = start + (0.0, 0.0, 0.16)
        drag(
            [[stage.scale * each for each in camera.pixel(handle + (0.0, 0.0, up))] for up in np.linspace(0.0, up_m, 9)]
        )
        wait_until(lambda: tf.get_tf(WORLD, target)[0][2] > start[2] + 0.8 * up_m, "the target is dragged")
        wait_until(lambda: is_followed(tf.get_tf(WORLD, target)[0]), "the arm follows")
        after = stage.still_picture()
    label(before, "before", (60, 30))
    label(after, "after: the red arrow was dragged up", (190, 30))
    write_png(path, beside(before, after))


def drag(pixels: Sequence[Sequence[float]]) -> None:
    """Drags the mouse through pixels of the screen, and lets it rest in a corner."""
    places = [[str(round(each)) for each in pixel] for pixel in pixels]
    subprocess.run(["xdotool", "mousemove", *places[0], "sleep", "1", "mousedown", "1"], check=True)
    for place in places:
        subprocess.run(["xdotool", "mousemove", *place, "sleep", "0.3"], check=True)
    subprocess.run(["xdotool", "mouseup", "1", "sleep", "1", "mousemove", "5", "5"], check=True)


def dual_iiwa(path: Path) -> None:
    """Two arms on one station, and the circles that their hands have drawn."""
    view = View((0.25, 0.0, 0.72), 1.9, 0.65, 0.4)
    arms = ("left", "right")
    style = {"Class": "rviz/Path", "Color": "30; 140; 60", "Line Style": "Billboards", "Line Width": 0.01}
    paths = {arm: {**style, "Topic": f"/pictures/{arm}"} for arm in arms}
    with Stage(1280, 720) as stage:
        stage.launch("basic_example_dual_iiwa.launch")
        stage.rviz(RVIZ / "basic_example_dual_iiwa.rviz", {**paths, "Guard": None, "TF": None}, **view.of_rviz)
        publishers = {arm: rospy.Publisher(f"/pictures/{arm}", PathMessage, queue_size=1, latch=True) for arm in arms}
        tf = TfInterface()
        hands = {arm: (WORLD, f"rpbi/{arm}/lbr_iiwa_link_7") for arm in arms}

        def is_on_circle() -> bool:
            position, _ = tf.get_tf(*hands["left"])
            return position is not None and bool(math.dist(position[:2], hand_position(0.0, 1.0)[:2]) < 0.02)

        wait_until(is_on_circle, "the circle begins")
        begin = tf.get_tf_msg(*hands["left"]).header.stamp
        messages = {arm: PathMessage() for arm in arms}

        def is_closed() -> bool:
            for arm, message in messages.items():
                transform = tf.get_tf_msg(*hands[arm])
                message.header.frame_id = WORLD
                message.poses.append(PoseStamped(pose=as_pose(transform.transform)))
            return (transform.header.stamp - begin).to_sec() > CIRCLE_PERIOD_S

        wait_until(is_closed, "the circles are closed")
        for arm in arms:
            publishers[arm].publish(messages[arm])
        stage.stop_world()
        picture = stage.still_picture()
    write_png(path, picture)


def lfd_rviz(path: Path) -> None:
    """The arm repeats a push that it has learned from a demonstration; paths are drawn above the box, not in it."""
    view = View((-0.62, 0.13, 0.15), 1.15, 1.0, 3.35)
    with Stage(1280, 720) as stage, tempfile.TemporaryDirectory() as out:
        stage.launch("lfd.launch", "operator:=scripted", "seed:=3", f"out:={out}", "plot:=false")
        above = [
            {"Line Width": 0.008, "Offset": {"X": 0.0, "Y": 0.0, "Z": z}} for z in (ABOVE_BOX_M, ABOVE_BOX_M + 0.01)
        ]
        shown = dict(zip(("Demonstration", "Plan"), above))
        stage.rviz(RVIZ / "lfd.rviz", shown, **view.of_rviz)
        next_message("lfd/state", String, lambda each: each.data == "executing")
        tf = TfInterface()

        def box_x() -> float:
            position, _ = tf.get_tf(WORLD, "rpbi/pushing_box")
            return math.nan if position is None else float(position[0])

        wait_until(lambda: abs(box_x() + 0.6) < 0.005, "the box is at its start again")
        wait_until(lambda: box_x() < -0.68, "the box is pushed")
        stage.stop_world()
        picture = stage.still_picture()
    lines = (("#1f5fb4", "demonstration"), ("#9467bd", "plan"), ("#e07820", "box"), ("#66997f", "goal of the box"))
    write_png(path, with_legend(picture, lines))


def tutorial_rviz(path: Path) -> None:
    """The world of the tutorial, from the files on its page."""
    page = (ROOT / "docs/tutorial.md").read_text(encoding="utf-8")
    view = View((0.35, 0.0, 0.34), 1.65, 0.8, 5.55)
    with Stage(1280, 720) as stage, tempfile.TemporaryDirectory() as folder:
        for text, name in re.findall(r"```yaml\n(# (\S+).*?)```", page, flags=re.DOTALL):
            (Path(folder) / name).write_text(text, encoding="utf-8")
        stage.launch("world.launch", f"config:={folder}/world.yaml")
        tf = TfInterface()
        wait_until(lambda: tf.get_tf(WORLD, "rpbi/ball")[0] is not None, "the ball is on TF")
        stage.rviz(RVIZ / "world.rviz", {"TF": {"Marker Scale": 0.4}}, **view.of_rviz)
        stage.stop_world()
        picture = stage.still_picture()
    write_png(path, picture)
