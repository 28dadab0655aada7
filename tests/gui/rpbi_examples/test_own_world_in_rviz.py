"""RViz, as `./rpbi launch WORLD.yaml` opens it, shows markers, contact forces and the camera image of that world."""

from __future__ import annotations

import math

import pytest
from ros_system import wait_until
from rviz_view import SLOW_S, find_view, launch_with_rviz
from worlds import FLOOR, box, write_world

pytestmark = pytest.mark.thorough

EYE = {"tf_id": "rpbi/eye", "position": [-15.0, -26.0, 3.0], "rpy": [math.pi, 0.0, 0.0]}
"""A camera that looks down, behind that of RViz."""


def test_a_world_with_namespace_and_prefix_is_shown(ros, screen, tmp_path):
    shape = {"shapeType": "GEOM_BOX", "halfExtents": [0.5, 0.5, 0.5], "rgbaColor": [0.0, 0.0, 1.0, 1.0]}
    below = {"shapeType": "GEOM_BOX", "halfExtents": [2.0, 2.0, 0.1], "rgbaColor": [0.0, 1.0, 0.0, 1.0]}
    below["visualFramePosition"] = [*EYE["position"][:2], 0.0]
    path = write_world(
        tmp_path,
        visual=({"name": "sign", "createVisualShape": shape}, {"name": "below", "createVisualShape": below}),
        collision=(FLOOR,),
        dynamic=(box(basePosition=[0.8, -0.8, 0.1], contacts={"arrow_metres_per_newton": 0.2}),),
        rgbd_sensor={"name": "eye", "hz": 5, "object_tf": {"tf_id": "rpbi/eye"}},
        poses=[EYE],
    )
    names = ("ns:=left", "tf_prefix:=left", "use_sim_time:=false")
    launch_with_rviz(ros, screen, "world.launch", f"config:={path}", *names)

    def count(colour: int) -> int:
        pixels = screen.grab().astype(int)
        others = [each for each in range(3) if each != colour]
        return int(((pixels[..., colour] > 60) & (pixels[..., colour] > 3 * pixels[..., others].max(axis=-1))).sum())

    assert find_view(screen) is not None
    for colour, what in ((2, "the sign"), (1, "what the camera sees"), (0, "contact forces")):
        wait_until(lambda colour=colour: count(colour) > 300, f"RViz shows {what}", SLOW_S, every_s=0.5)
