"""Pictures of RViz with people: telepresence, teleoperation, a haptic device, the avatar, tracking."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import rospy
from files import write_png
from geometry_msgs.msg import Point, Quaternion, Transform, TransformStamped, Vector3, WrenchStamped
from labels import label
from live import Array, Frames, Newest, Orbit, grab, place, xdotool
from PIL import Image, ImageDraw
from render import beside, with_caption
from screen import Stage, call, wait_until
from std_msgs.msg import ColorRGBA, Float64
from std_srvs.srv import SetBool
from tf2_ros import StaticTransformBroadcaster
from visualization_msgs.msg import Marker, MarkerArray

from rpbi_examples.dressing.outcome import rings_of

EXAMPLES = Path(__file__).resolve().parents[2] / "src/rpbi_examples"
RVIZ = EXAMPLES / "rviz"
SHOWN_N = 0.05
"""Least force that the text in RViz does not round to 0 [N]."""
ARRIVES_S = 1.0
"""Time in which all messages of a stopped world arrive [s]."""
RESTS_S = 3.0
"""Time after which the arm rests on the box, and after which RViz shows all segments of people [s]."""
ORIGINS = {"laboratory": np.zeros(3), "twin": np.array((0.0, 1.2, -0.01))}
"""Origins of both worlds in that of the laboratory, for RViz [m]."""
CAMERA_YAW_RAD, BESIDE_RAD = -0.8, 0.5
"""Direction of the camera as seen from the avatar, and its angle to the direction of the avatar's right side [rad]."""
SEGMENTS = {"Head": (-110, 34), "RightHand": (10, 60), "Pelvis": (-90, 20), "LeftFoot": (80, -10)}
"""Segments whose frames have labels, and the offsets of these labels [px]."""
BALL, TIP = "rpbi/teleop_target", "rpbi/kuka_lwr/end_effector_ball"
"""Frames of the ball that a person moves, and of the arm's tip, which follows it."""


def telepresence(path: Path) -> None:
    """Draws the sleeve on the forearm and past the elbow, while it presses on the arm."""
    with Stage(620, 500) as stage:
        stage.launch("telepresence.launch", "seed:=3")
        frames, surface = Frames(), Newest("rpbi/sleeve/surface", Marker)
        force, arrows = Newest("telepresence/force", Float64), Newest("rpbi/human/contacts/arrows", MarkerArray)
        frames.wait_for("rpbi/human/RightHand")

        def ring(number: int) -> Array:
            """Returns the middle of a ring of the sleeve, counted from the cuff [m]."""
            points = wait_until(lambda: surface.message, "there is a sleeve").points
            return np.array(rings_of([(each.x, each.y, each.z) for each in points])[number].mean(axis=0))

        def past_elbow() -> float:
            """Returns the distance of the cuff past the elbow, along the upper arm [m]."""
            elbow, shoulder = frames.wait_for("rpbi/human/RightForeArm"), frames.wait_for("rpbi/human/RightUpperArm")
            return float((ring(0) - elbow) @ (shoulder - elbow) / np.linalg.norm(shoulder - elbow))

        def forces() -> list[Marker]:
            return [each for each in arrows.message.markers if each.action == Marker.ADD] if arrows.message else []

        def presses() -> bool:
            return bool(force.message.data > SHOWN_N and forces())

        view = Orbit(1.1, (0.42, -0.22, 1.36), 0.4, 0.85)
        stage.rviz(RVIZ / "telepresence.rviz", **view.properties)
        wait_until(lambda: force.message, "the robot moves")
        stop_when(stage, lambda: -0.25 < past_elbow() < -0.08 and presses())
        before = stage.still_picture()
        label(before, "sleeve", (250, 440), view.pixel(ring(7), before))
        label(before, "elbow", (370, 340), view.pixel(frames.wait_for("rpbi/human/RightForeArm"), before))
        call("rpbi/start")
        stop_when(stage, lambda: past_elbow() > 0.0 and presses())
        first = forces()[0].points[0]
        after = stage.still_picture()
        label(after, "forces", (60, 150), view.pixel((first.x, first.y, first.z), after))
    captions = "The sleeve is over the forearm.", "The cuff of the sleeve is past the elbow."
    write_png(path, beside(*map(with_caption, (before, after), captions)))


def teleop(path: Path) -> None:
    """Draws arm, ball and keyboard window before keys are held, and while they are."""
    with Stage(600, 500) as stage:
        stage.launch("teleop.launch", "speed:=0.02")
        frames = Frames()

        def distance() -> float:
            """Returns the distance of the arm's tip from the ball [m]."""
            return float(np.linalg.norm(frames.wait_for(BALL) - frames.wait_for(TIP)))

        wait_until(lambda: distance() < 0.003, "the arm is at the ball")
        keyboard = place("^keyboard$")
        view = Orbit(1.05, (0.15, 0.03, 0.38), 0.35, 4.9)
        stage.rviz(RVIZ / "kuka_lwr_ik_example.rviz", {"TF": None, "Guard": None}, **view.properties)
        rviz = place("RViz")
        xdotool("windowfocus", "--sync", keyboard.number)
        start, scene = frames.wait_for(BALL), stage.still_picture()
        label(scene, "ball", (120.0, 420.0), view.pixel(start, scene))
        before = panel(scene, grab(keyboard))
        xdotool("windowraise", rviz.number)
        xdotool("keydown", "Up", "keydown", "Right")
        wait_until(lambda: np.linalg.norm(frames.wait_for(BALL) - start) > 0.13, "the ball moves")
        scene, ball = stage.picture(), frames.wait_for(BALL)
        xdotool("windowraise", keyboard.number)
        window = grab(keyboard)
    ImageDraw.Draw(scene).line((*view.pixel(start, scene), *view.pixel(ball, scene)), "#16a04a", 3)
    label(scene, f"moved by {100 * np.linalg.norm(ball - start):.0f} cm", (130.0, 420.0), view.pixel(start, scene))
    write_png(path, beside(before, panel(scene, window)))


def human_interaction(path: Path) -> None:
    """Draws the arm that presses on the box, and the window of the virtual device with its force."""
    with Stage(760, 600) as stage, tempfile.TemporaryDirectory() as folder:
        stage.launch("human_interaction.launch", "plot:=false", f"output:={folder}")
        force = Newest("haptics/force", WrenchStamped)
        handle = place("^Virtual haptic device$")
        wait_until(lambda: force.message, "the device runs")
        view = Orbit(0.85, (0.02, 0.0, 0.22), 0.55, 5.2)
        stage.rviz(RVIZ / "human_interaction.rviz", {"TF": None, "Guard": None}, **view.properties)
        rviz = place("RViz")
        xdotool("windowraise", handle.number, "mousemove", (handle.left + handle.right) // 2, handle.upper + 210)

        def presses() -> bool:
            xdotool("click", "5")  # the wheel lowers the handle
            time.sleep(0.2)
            return bool(force.message.wrench.force.z > 3.5)

        wait_until(presses, "the arm presses on the box")
        window = grab(handle)  # at once: a wall loses its force while the hand rests
        stage.stop_world()
        xdotool("windowraise", rviz.number)
        scene = stage.still_picture()
    write_png(path, beside(scene, middle_of(window, scene.height)))


def avatar_walking(path: Path) -> None:
    """Draws the avatar in a stride, and while it reaches forward."""
    with Stage(560, 520) as stage:
        stage.launch("avatar.launch")
        frames, world = Frames("rpbi/human/Pelvis"), Frames("rpbi/world")
        frames.wait_for("rpbi/human/RightHand")
        view = Orbit(2.4, (0.05, 0.0, -0.05), 0.3, CAMERA_YAW_RAD)
        stage.rviz(RVIZ / "avatar.rviz", **{**view.properties, "Target Frame": "rpbi/human/Pelvis"})

        def part(name: str) -> Array:
            return frames.wait_for(f"rpbi/human/{name}")

        def is_seen_from_ahead() -> bool:
            """Returns whether the camera sees the right side and the front of the avatar, both from ahead."""
            right, left = (world.wait_for(f"rpbi/human/{side}UpperArm") for side in ("Right", "Left"))
            x, y, _ = right - left
            to_camera = CAMERA_YAW_RAD - np.arctan2(y, x)  # the front is at +90 degrees of the right side
            return bool(abs((to_camera - BESIDE_RAD + np.pi) % (2.0 * np.pi) - np.pi) < 0.3)

        def moment(condition: Callable[[], bool], meaning: str) -> Image.Image:
            stop_when(stage, lambda: is_seen_from_ahead() and condition())
            picture = stage.still_picture()
            call("rpbi/start")
            return with_caption(picture, meaning)

        pictures = (
            moment(lambda: part("RightFoot")[0] - part("LeftFoot")[0] > 0.4, "The avatar walks."),
            moment(lambda: bool((part("RightHand") > (0.45, -9.0, 0.2)).all()), "Its right hand reaches forward."),
        )
    write_png(path, beside(*pictures))


def mvn(path: Path) -> None:
    """Draws two people of the emulator, with the frames of their segments and the names of some."""
    with Stage(1000, 640) as stage:
        stage.launch("mvn.launch", "people:=2", "arm_held_out:=true")
        frames = Frames()
        frames.wait_for("mvn/1/Pelvis")
        view = Orbit(2.75, (0.0, -0.35, 0.86), 0.22, 0.42)
        stage.rviz(RVIZ / "mvn.rviz", {"TF": {"Marker Scale": 0.5}}, **view.properties)
        time.sleep(RESTS_S)
        picture = stage.picture()
        for name, (right, down) in SEGMENTS.items():
            column, row = view.pixel(frames.wait_for(f"mvn/0/{name}"), picture)
            label(picture, f"mvn/0/{name}", (column + right, row + down), (column, row))
    write_png(path, picture)


def tracking(path: Path) -> None:
    """Draws both worlds while the box is seen, and while it is hidden and that of the twin has fallen."""
    with Stage(400, 380) as stage:
        stage.launch("tracking_example.launch")
        frames, focus = Frames("lab/rpbi/world"), StaticTransformBroadcaster()
        boxes = {"laboratory": "lab/figure_eight", "twin": "twin/rpbi/box"}
        worlds = {"laboratory": "lab", "twin": "twin"}
        shadows = rospy.Publisher("/pictures/shadows", MarkerArray, queue_size=1, latch=True)

        def look_at(place: Array) -> None:
            """Moves RViz's view to a place [m]."""
            transform = TransformStamped(child_frame_id="pictures/focus")
            transform.header.frame_id, transform.header.stamp = "lab/rpbi/world", rospy.Time.now()
            transform.transform = Transform(Vector3(*place), Quaternion(0.0, 0.0, 0.0, 1.0))
            focus.sendTransform(transform)

        look_at(np.zeros(3))
        view = Orbit(0.92, (0.0, 0.0, 0.17), 0.68, 0.6)
        shown = {"TF": None, "Shadows": {"Class": "rviz/MarkerArray", "Marker Topic": "/pictures/shadows"}}
        stage.rviz(RVIZ / "tracking_example.rviz", shown, **{**view.properties, "Target Frame": "pictures/focus"})

        def place_of(name: str) -> Array:
            """Returns the place of a box in its own world [m]."""
            return np.asarray(frames.wait_for(boxes[name]) - ORIGINS[name])

        def apart() -> float:
            """Returns the distance of the twin's box from where the laboratory's box is in its world [m]."""
            return float(np.linalg.norm(place_of("twin") - place_of("laboratory")))

        def carry(is_on: bool) -> None:
            """Moves the box of the laboratory, or holds it."""
            rospy.ServiceProxy("lab/toggle_figure_eight", SetBool)(is_on)

        def moment(condition: Callable[[], bool], meaning: str, caption: str) -> Image.Image:
            wait_until(condition, meaning)
            carry(False)
            for name in worlds.values():
                stage.stop_world(name)
            time.sleep(ARRIVES_S)
            shadows.publish(MarkerArray([shadow(place_of(name) + ORIGINS[name], n) for n, name in enumerate(boxes)]))
            parts = []
            for name in boxes:
                look_at(ORIGINS[name] + place_of("laboratory") * (1.0, 1.0, 0.0))
                parts.append(stage.still_picture())
                label(
                    parts[-1],
                    f"{name}: centre {100.0 * place_of(name)[2]:.0f} cm above the floor",
                    (stage.width // 2, 24),
                )
            for name in worlds.values():
                call(f"{name}/rpbi/start")
            carry(True)
            return with_caption(beside(*parts, gap_px=2), caption)

        def is_in_the_middle() -> bool:
            return bool(abs(place_of("laboratory")[1]) < 0.1)

        def is_on_floor() -> bool:
            return bool(place_of("twin")[2] < 0.055)

        seen = moment(
            lambda: apart() < 0.02 and is_in_the_middle(),
            "Vicon sees the box",
            "Vicon sees the box: the box of the twin follows.",
        )
        hidden = moment(is_on_floor, "the box of the twin falls", "The box is hidden: the box of the twin has fallen.")
    write_png(path, beside(seen, hidden, gap_px=16))


def shadow(place: Array, number: int) -> Marker:
    """Returns a disk on the floor below a place [m]."""
    marker = Marker(ns="shadows", id=number, type=Marker.CYLINDER, frame_locked=True)
    marker.header.frame_id = "lab/rpbi/world"
    marker.pose.position, marker.pose.orientation.w = Point(place[0], place[1], 0.0), 1.0
    marker.scale, marker.color = Vector3(0.16, 0.16, 0.001), ColorRGBA(0.75, 0.8, 0.85, 1.0)
    return marker


def stop_when(stage: Stage, condition: Callable[[], bool]) -> None:
    """Stops the world at a tick for which a condition is true, also by the messages that are still on their path."""
    while True:
        wait_until(condition, "the moment of the picture")
        stage.stop_world()
        time.sleep(ARRIVES_S)
        if condition():
            return
        call("rpbi/start")


def panel(scene: Image.Image, window: Image.Image) -> Image.Image:
    """Returns a scene with a window below, in its middle."""
    whole = Image.new("RGB", (scene.width, scene.height + window.height + 8), "white")
    whole.paste(scene)
    whole.paste(window, ((scene.width - window.width) // 2, scene.height + 8))
    return whole


def middle_of(window: Image.Image, height: int) -> Image.Image:
    """Returns a window in the middle of a white column of some height."""
    column = Image.new("RGB", (window.width, height), "white")
    column.paste(window, (0, (height - window.height) // 2))
    return column
