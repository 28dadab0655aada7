"""Renders for the guides: contacts, a base, a grasp, a soft body, the parts of a world, the frames of a robot."""

from __future__ import annotations

import os
import re
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from cards import SIZE as CARD
from files import write_png
from overlay import Overlay
from PIL import Image
from pushes import example, push
from render import Photographer, beside, with_caption

from custom_ros_tools.plot_style import BLUE, INK, ORANGE
from robot_model.asset_files import find_file
from robot_model.geometry import Pose, Vector, plus, scaled
from robot_model.model import RobotModel
from rpbi.bodies.dynamics import link_index
from rpbi.geometry import Twist
from rpbi.samples import ContactPoint, ContactsSample
from rpbi.world import World

ROOT = Path(__file__).resolve().parents[2]
CONFIGS = "{rpbi_examples}/configs"
PUSHED_M, METRES_A_NEWTON, SHOWN_N = 0.12, 0.03, 0.2
"""Length of the push before the picture [m], length of the arrows [m/N], and the least force of an arrow [N]."""
CURVE, DRIVEN_S = Twist((0.4, 0.0, 0.0), (0.0, 0.0, 0.45)), 6.0
"""Command of the base, in its own frame [m/s, rad/s], and the time for which it drives [s]."""
HAND, POINTS_DOWN = (
    "panda_hand",
    {"panda_joint2": -0.5, "panda_joint4": -2.2, "panda_joint6": 1.7, "panda_joint7": 0.785},
)
"""The link that carries the fingers, and joints of the Panda whose hand points down [rad]."""
FINGERTIPS_M, CLOSES_S = 0.105, 0.4
"""Distance of the point between the fingertips from the hand's frame [m], and time for closing the fingers [s]."""
GRIP_METRES_A_NEWTON = 0.004
"""Length of the arrows at the fingers [m/N]."""
POSTURE = (0.0, 0.5, 0.0, -1.2, 0.0, 0.8, 0.0)
"""Joint positions of the arm whose frames are drawn, those of docs/robot_model.md [rad]."""
ABOVE_M = 1.25
"""Height of the cube in the first picture of the soft body [m]."""
CARRIED_S = 2.6
"""Time for which the belt of the template has carried the parcel [s]."""
AXIS_M, AXES = 0.11, ("#e02020", "#18a018", "#2050f0")
"""Length of the drawn axes [m], and their colours, as in RViz: red, green, blue."""


def draw_contacts(path: Path) -> None:
    """Draws the forces on a box that an arm pushes over the floor."""
    view, points = _contacts(27.0, (900, 560))
    arm = [point for point in points if point.other_body == "kuka_lwr"]
    floor = max((each for each in points if each.other_body == "floor"), key=lambda each: each.normal_force)
    view.words(_ends(arm[0])[0], f"force of the arm: {sum(each.normal_force for each in arm):.1f} N", ORANGE, (-60, 26))
    view.words(_ends(floor)[0], f"force of the floor: {floor.normal_force:.1f} N here", BLUE, (-110, 26))
    write_png(path, view.picture(), dither=True)


def draw_contacts_card(path: Path) -> None:
    """Draws the same forces without words, for the home page."""
    view, _ = _contacts(21.0, CARD)
    write_png(path, view.picture(), dither=True)


def _contacts(fov_deg: float, size: tuple[int, int]) -> tuple[Overlay, list[ContactPoint]]:
    """Returns a picture of a pushed box with arrows for its contact forces, and the contacts."""
    camera = Photographer((-0.62, -0.78, 0.42), (-0.13, -0.22, 0.06), fov_deg, size)
    with tempfile.TemporaryDirectory(prefix="rpbi-") as folder:
        world = example(Path(folder))
        push(world, length_m=PUSHED_M)
        points = next(each.points for each in world.step() if isinstance(each, ContactsSample))
        view = Overlay(camera, camera.picture(world))
        world.close()
    for point in points:
        if point.normal_force > SHOWN_N:
            view.arrow(*_ends(point), ORANGE if point.other_body == "kuka_lwr" else BLUE, 5.0)
    return view, list(points)


def draw_bases(path: Path) -> None:
    """Draws a mobile base that has driven a curve, its path, and its commanded velocity."""
    camera = Photographer((-3.4, -0.35, 1.75), (-0.5, 0.3, 0.32), 30.0, (1000, 620))
    world = World.from_file(f"{CONFIGS}/basic_example_mobile_base/config.yaml")
    world.remove("box")
    base: Any = world.bodies["mobile_base"]
    places = []
    for tick in range(round(DRIVEN_S / world.config.timeStep)):
        if tick % 50 == 0:
            world.put("mobile_base/cmd_vel", CURVE)
            x, y, _ = base.base_pose().position
            places.append((x, y, 0.005))
        world.step()
    pose = base.base_pose()
    view = Overlay(camera, camera.picture(world))
    world.close()
    view.line(places, BLUE, 4.0)
    view.dot(places[0], INK)
    view.words(places[0], "start", offset_px=(12, 14))
    front = pose @ Pose((0.35, 0.0, 0.02))
    ahead = pose @ Pose((0.85, 0.0, 0.02))
    view.arrow(front.position, ahead.position, ORANGE)
    command = f"command: {CURVE.linear[0]:g} m/s ahead, {CURVE.angular[2]:g} rad/s to the left"
    view.words(ahead.position, command, ORANGE, (-60, 34))
    view.words(places[len(places) // 2], "path", BLUE, (14, 12))
    write_png(path, view.picture(), dither=True)


def draw_hands(path: Path) -> None:
    """Draws a Panda that holds a box between its coupled fingers."""
    world = World.from_file(f"{CONFIGS}/grasp_example/config.yaml")
    panda: Any = world.bodies["panda"]
    hand = link_index(panda, HAND)
    world.act("panda", "set_joint_state", POINTS_DOWN)
    ticks = round(CLOSES_S / world.config.timeStep)
    for tick in range(4 * ticks):
        if tick == ticks:
            world.put("panda/target", {"panda_finger_joint1": 0.0})
        if tick < 2 * ticks:
            grip = panda.link_pose(hand) @ Pose((0.0, 0.0, FINGERTIPS_M))
            world.act("box", "teleport", Pose(grip.position, panda.link_pose(hand).quat_xyzw))
        world.step()
    grip = (panda.link_pose(hand) @ Pose((0.0, 0.0, FINGERTIPS_M))).position
    camera = Photographer(plus(grip, (0.55, -0.2, 0.18)), plus(grip, (0.0, 0.0, 0.03)), 27.0, (900, 560))
    view = Overlay(camera, camera.picture(world))
    box: Any = world.bodies["box"]
    by_link: dict[int, list[Any]] = {}
    for contact in panda.pb.getContactPoints(box.body_id, panda.body_id):
        by_link.setdefault(contact[4], []).append(contact)
    for contacts in by_link.values():
        force_n = sum(each[9] for each in contacts)
        at, normal = (tuple(np.mean([each[column] for each in contacts], axis=0)) for column in (5, 7))
        begin = plus(at, scaled(-GRIP_METRES_A_NEWTON * force_n, normal))
        view.arrow(begin, at, ORANGE)
        view.words(begin, f"{force_n:.1f} N", ORANGE, (-30, 26))
    world.close()
    write_png(path, view.picture(), dither=True)


def draw_soft_body(path: Path) -> None:
    """Draws the soft torus before and while the cube lies on it, with the height of its side below the cube."""
    camera = Photographer((-0.6, -5.6, 1.15), (0.25, 0.0, 0.76), 30.0, (680, 560))
    world = World.from_file(f"{CONFIGS}/soft_body/config.yaml")
    cube, torus = world.bodies["cube"], world.bodies["torus"]
    pictures = []
    for caption in ("before the cube hits the torus", "the cube is lowest"):
        height_m = cube.base_pose().position[2]
        while pictures or height_m > ABOVE_M:
            world.step()
            before_m, height_m = height_m, cube.base_pose().position[2]
            if height_m > before_m:
                break
        view = Overlay(camera, camera.picture(world))
        _, nodes = torus.pb.getMeshData(torus.body_id, -1, flags=torus.pb.MESH_DATA_SIMULATION_MESH)
        for is_below_cube, x in ((False, -1.15), (True, 1.7)):
            top_m = max(node[2] for node in nodes if (node[0] > 0.5 if is_below_cube else node[0] < -0.5))
            colour = ORANGE if is_below_cube else BLUE
            view.line([(x, 0.0, 0.0), (x, 0.0, top_m)], colour, 4.0)
            view.words((x, 0.0, top_m), f"{100 * top_m:.0f} cm", colour, (-30, -18))
        pictures.append(with_caption(view.picture(), f"{world.clock.time_s:.2f} s: {caption}"))
    world.close()
    write_png(path, beside(*pictures), dither=True)


def draw_worlds(path: Path) -> None:
    """Draws the demo's world, and names the keys of the main file that its parts come from."""
    camera = Photographer((-1.35, -1.7, 1.25), (0.12, -0.12, 0.26), 30.0, (1000, 620))
    world = World.from_file(f"{CONFIGS}/basic_example_kuka_lwr/config.yaml")
    view = Overlay(camera, camera.picture(world))
    box: Any = world.bodies["box"]
    names: Sequence[tuple[Vector, str, tuple[float, float]]] = (
        ((0.5, 0.0, 0.35), "robots", (70, 0)),
        (plus(box.base_pose().position, (0.0, 0.0, 0.06)), "dynamic_objects", (-190, -60)),
        ((-0.55, 0.05, 0.0), "collision_objects: the floor", (-120, 60)),
        ((0.35, -0.45, 0.0), "visual_objects: a mark without collisions", (-60, 70)),
    )
    for point, name, offset in names:
        view.pointer(point, name, offset)
    world.close()
    write_png(path, view.picture(), dither=True)


def draw_robot_model(path: Path) -> None:
    """Draws an arm with the frames of its links, which the robot's model computes."""
    world = World.from_file(f"{CONFIGS}/basic_example_kuka_lwr/config.yaml")
    robot = RobotModel(find_file("{rpbi_examples}/robots/kuka_lwr.urdf", "~"))
    world.act("kuka_lwr", "set_joint_state", dict(zip(robot.joint_names, POSTURE)))
    world.remove("box")
    arm: Any = world.bodies["kuka_lwr"]
    base = np.array(_matrix(arm.base_pose()))
    camera = Photographer((-0.95, -1.5, 0.95), (0.12, 0.02, 0.4), 29.0, (1000, 640))
    view = Overlay(camera, camera.picture(world))
    world.close()
    frames = robot.frames.of_links(np.array([POSTURE]))[0]
    hand = frames[robot.frames.links.index("lwr_arm_7_link")]
    x, y, z = hand[:3, 3]
    words = f"lwr_arm_7_link: x {x:.3f}, y {y:.3f}, z {z:.3f} m in the root's frame"
    view.pointer(tuple((base @ hand)[:3, 3]), words, (-340, -150))
    root = frames[robot.frames.links.index("lwr_arm_0_link")]
    view.pointer(tuple((base @ root)[:3, 3]), "base, the root link", (80, 75))
    for name, frame in zip(robot.frames.links, frames):
        if name.startswith("lwr_arm_") and name[-6].isdigit():
            matrix = base @ frame
            origin = matrix[:3, 3]
            for column, colour in enumerate(AXES):
                view.line([tuple(origin), tuple(origin + AXIS_M * matrix[:3, column])], colour, 5.0)
    for column, offset_px in enumerate(((9, 0), (-19, -4), (-21, 20))):
        view.words(
            tuple((base @ root)[:3, 3] + AXIS_M * (base @ root)[:3, column]), "xyz"[column], AXES[column], offset_px
        )
    write_png(path, view.picture(), dither=True)


def draw_extending(path: Path) -> None:
    """Draws the world of the template package, while the belt carries the parcel."""
    template = ROOT / "docs/templates/my_robot_lab"
    os.environ["ROS_PACKAGE_PATH"] = f"{template}:{os.environ.get('ROS_PACKAGE_PATH', '')}"
    sys.path.append(str(template / "src"))
    world = World.from_file("{my_robot_lab}/configs/lab.yaml")
    while world.clock.time_s < CARRIED_S:
        world.step()
    camera = Photographer((0.75, -1.25, 1.15), (0.15, -0.05, 0.4), 36.0, (1000, 600))
    view = Overlay(camera, camera.picture(world))
    view.line([(0.5, -0.2, 0.55), (0.5, 0.2, 0.55)], ORANGE, 3.0)
    view.words((0.5, 0.2, 0.55), "beam of the range finder", ORANGE, (16, -26))
    view.arrow((-0.55, 0.0, 0.505), (-0.25, 0.0, 0.505), BLUE)
    view.words((-0.4, 0.0, 0.505), "0.4 m/s", BLUE, (-40, 30))
    for name, offset in (("parcel", (-70.0, -60.0)), ("pusher", (60.0, 80.0))):
        body: Any = world.bodies[name]
        view.pointer(body.base_pose().position, name, offset)
    world.close()
    write_png(path, view.picture(), dither=True)


def draw_python(path: Path) -> None:
    """Draws the picture that the first script of docs/python.md saves."""
    from rpbi.images import CameraImages, looking_at

    world = World.from_file(f"{CONFIGS}/basic_example_kuka_lwr/config.yaml")
    world.put("camera/pose", looking_at([-0.32, -2.05, 2.2], target=[0.1, 0.0, 0.3]))
    images = CameraImages(world)
    Image.fromarray(images.frame("camera").colour).save(path, optimize=True)
    images.close()
    world.close()


def draw_tutorial_colour(path: Path) -> None:
    """Draws the colour image of the tutorial's camera, from the files on its page."""
    from rpbi.images import CameraImages

    page = (ROOT / "docs/tutorial.md").read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory() as folder:
        for text, name in re.findall(r"```yaml\n(# (\S+).*?)```", page, flags=re.DOTALL):
            (Path(folder) / name).write_text(text, encoding="utf-8")
        world = World.from_file(f"{folder}/world.yaml")
        images = CameraImages(world)
        Image.fromarray(images.frame("camera").colour).save(path, optimize=True)
        images.close()
        world.close()


def _ends(point: ContactPoint) -> tuple[Vector, Vector]:
    """Returns begin and end of an arrow that shows the normal force of a contact; it ends at the contact."""
    return plus(point.position, scaled(-METRES_A_NEWTON * point.normal_force, point.normal)), point.position


def _matrix(pose: Pose) -> list[list[float]]:
    """Returns a pose as a homogeneous matrix."""
    x, y, z, w = pose.quat_xyzw
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return [[*row, at] for row, at in zip(rows, pose.position)] + [[0.0, 0.0, 0.0, 1.0]]
