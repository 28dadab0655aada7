"""Pictures of example worlds in RViz."""

from __future__ import annotations

from pathlib import Path

from files import write_png
from labels import colour_image, inset
from screen import Stage, call, next_message
from sensor_msgs.msg import Image

from ros_pybullet_interface.msg import Contacts

RVIZ = Path(__file__).resolve().parents[2] / "src/rpbi_examples/rviz"
COLOUR = "rpbi/camera/colour/image"
PUSH_N = 4.0
"""Force of the arm on the box at which the demo's picture is taken [N]."""


def push_n(contacts: Contacts) -> float:
    """Returns the force of the arm on the box [N]."""
    return float(sum(each.normal_force for each in contacts.points if each.other_body == "kuka_lwr"))


def demo(path: Path) -> None:
    """The arm pushes the box, with the camera's image."""
    with Stage(1280, 720) as stage:
        stage.launch("basic_example_kuka_lwr.launch", "start:=false")
        stage.rviz(
            RVIZ / "basic_example_kuka_lwr.rviz",
            {"Coloured depth": None, "TF": {"Marker Scale": 0.5}},
            Distance=1.4,
            Focal_Point={"X": 0.25, "Y": -0.15, "Z": 0.3},
            Pitch=0.35,
            Yaw=4.2,
        )
        call("rpbi/start")
        next_message("rpbi/box/contacts", Contacts, lambda contacts: push_n(contacts) > PUSH_N)
        camera = colour_image(next_message(COLOUR, Image))
        stage.stop_world()
        picture = stage.still_picture()
    inset(picture, camera.resize((400, 300)), "camera", (860, 20))
    write_png(path, picture)
