"""Pictures of windows: the controls, keyboard and mouse as devices, and the live plot."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import rosgraph
import rospy
import yaml
from files import write_png
from live import Newest, Orbit, grab, place, xdotool
from PIL import Image, ImageDraw
from render import beside, font
from rviz_people import EXAMPLES, RVIZ
from rviz_worlds import PUSH_N, push_n
from screen import Stage, call, next_message, wait_until
from sensor_msgs.msg import JointState, Joy

from custom_ros_tools.plot_style import INK
from ros_pybullet_interface.msg import Contacts, SimulationState
from ros_pybullet_interface.srv import ResetJointState

WORLD = EXAMPLES / "configs/basic_example_kuka_lwr/config.yaml"
CALM, PACE = {"timeStep": 0.01, "clock_hz": 50}, 0.25
"""Keys of a world, and its real-time factor: a tick lasts 0.04 s, so that a machine that draws RViz has no overruns."""
CAMERAS = (672, 339)
"""Column and row of the list of cameras in the window of controls [px]."""
REFRESHED_S = 2.0
"""Time after which the window shows a motion [s]."""
ARM = "/rpbi/kuka_lwr/joint_states"
WRIST = "/rpbi/kuka_lwr/lwr_arm_6_joint/ft_sensor/wrench/force"
FIELDS = (
    *(f"{ARM}/{quantity}/lwr_arm_{joint}_joint" for quantity in ("position", "effort") for joint in (0, 3)),
    *(f"{WRIST}/{axis}" for axis in "xyz"),
)
SHOWN_S = 8.0
"""Time that the live plot shows [s]."""
GREY_FILL, GREY_LINE, BLUE_FILL = "#e8ecef", "#aeb8bf", "#e3eef6"
"""Colours of a window's title bar and frame, and of the card with its message."""
AFTER_S = 2.0
"""Time from a push of the box to the picture of the plot [s]."""


def controls(path: Path) -> None:
    """Draws the controls window of a running world without overruns."""
    with Stage(1280, 760, scale=1) as stage, tempfile.TemporaryDirectory() as folder:
        view = yaml.safe_load((RVIZ / "world.rviz").read_text(encoding="utf-8"))
        view["Visualization Manager"]["Views"]["Current"].update(Orbit(1.9, (0.15, 0.0, 0.35), 0.4, 4.6).properties)
        rviz_config, overrides = Path(folder) / "view.rviz", Path(folder) / "calm.yaml"
        rviz_config.write_text(yaml.safe_dump(view), encoding="utf-8")
        overrides.write_text(yaml.safe_dump(CALM), encoding="utf-8")
        stage.launch(
            "simulator.launch",
            f"config:={WORLD}",
            f"overrides:={overrides}",
            f"rviz_config:={rviz_config}",
            f"real_time_factor:={PACE}",
            "controls:=true",
        )
        state = Newest("rpbi/state", SimulationState)
        window = place("ROS-PyBullet Interface Controls")
        xdotool("windowsize", "--sync", window.number, stage.width, stage.height, "windowmove", window.number, 0, 0)
        wait_until(lambda: state.message, "the world runs")

        def chooses_camera() -> bool:
            xdotool("mousemove", *CAMERAS, "click", "5")  # the wheel
            topics = rosgraph.Master("/pictures").getSystemState()[1]
            return any("colour/image" in topic for topic, _ in topics)

        wait_until(chooses_camera, "the camera is chosen")
        names = [f"lwr_arm_{number}_joint" for number in (0, 1)]
        move = rospy.ServiceProxy("rpbi/kuka_lwr/move_to_joint_state", ResetJointState)
        move(JointState(name=names, position=[0.4, 0.7]), 1.0)
        xdotool("mousemove", 1279, 759)
        time.sleep(REFRESHED_S)
        picture, overruns = stage.picture(), state.message.overruns
    if overruns:
        raise RuntimeError(f"{overruns} overruns; end other programs")
    write_png(path, picture)


def devices(path: Path) -> None:
    """Draws the windows of keyboard and mouse with the input that they get, and the message that follows from it."""
    with Stage(1000, 500, scale=1) as stage:
        keys, drag = Newest("keys/joy", Joy), Newest("drag/joy", Joy)
        program = ["rosrun", "operator_node"]
        axes = ["_axes:=[[LEFT, RIGHT], [DOWN, UP], [b, f]]", "_buttons:=['1', '2', '3']"]
        stage.start([*program, "keyboard_node.py", *axes, "__ns:=keys"])
        stage.start([*program, "mouse_node.py", "_wheel_return_s:=30.0", "__ns:=drag"])
        keyboard = place("^keyboard$")
        mouse = place("^mouse$")
        xdotool("windowmove", mouse.number, keyboard.right + 20, 0, "windowfocus", "--sync", keyboard.number)
        mouse = place("^mouse$")
        xdotool("keydown", "Left", "keydown", "b")
        wait_until(lambda: keys.message and list(keys.message.axes) == [-1.0, 0.0, -1.0], "the keys are held")
        held = framed("keyboard", grab(keyboard), keys.message)
        x, y = (mouse.left + mouse.right) // 2, (mouse.upper + mouse.lower) // 2
        xdotool("mousemove", x, y, "mousedown", 1, "mousemove", x + 90, y - 60, "click", 4, "click", 4)
        wait_until(lambda: drag.message and drag.message.axes[0] > 0.4 and drag.message.axes[2] == 0.5, "it drags")
        dragged = framed("mouse", grab(mouse), drag.message)
        xdotool("mouseup", 1, "keyup", "Left", "keyup", "b")
    write_png(path, beside(held, dragged, gap_px=28))


def framed(title: str, window: Image.Image, message: Joy) -> Image.Image:
    """Returns a window with a frame and its title, and below it the message that the node publishes."""
    bar, card = 34, 76
    whole = Image.new("RGB", (window.width + 2, bar + window.height + 12 + card + 1), "white")
    draw = ImageDraw.Draw(whole)
    draw.rounded_rectangle((0, 0, window.width + 1, bar + window.height + 1), 8, GREY_FILL, GREY_LINE)
    draw.text((12, bar // 2), title, INK, font(16, bold=True), anchor="lm")
    whole.paste(window, (1, bar))
    top = bar + window.height + 12
    draw.rounded_rectangle((0, top, window.width + 1, top + card), 8, BLUE_FILL)
    axes = ", ".join(f"{each:g}" for each in message.axes)
    rows = ("topic joy", f"axes: [{axes}]", f"buttons: {list(message.buttons)}")
    for number, row in enumerate(rows):
        draw.text((12, top + 8 + 22 * number), row, INK, font(15, bold=number == 0))
    return whole


def live_plot(path: Path) -> None:
    """Draws the live plot while the arm pushes the box."""
    with Stage(1000, 620, scale=1) as stage:
        stage.launch("basic_example_kuka_lwr.launch", "start:=false")
        stage.start(["rosrun", "rpbi_utils", "live_plot", *FIELDS, "--seconds", str(SHOWN_S)])
        state = Newest("rpbi/state", SimulationState)
        window = place("^Live plot$")
        xdotool("windowsize", "--sync", window.number, 1000, 620, "windowmove", window.number, 0, 0)
        call("rpbi/start")
        next_message("rpbi/box/contacts", Contacts, lambda contacts: push_n(contacts) > PUSH_N)
        end_s = state.message.simulated_time + AFTER_S
        wait_until(lambda: state.message.simulated_time > max(end_s, SHOWN_S), "the push is in the plot")
        picture = stage.picture()
    write_png(path, picture)
