"""RViz, as `./rpbi launch WORLD.yaml` opens it, shows the markers of that world."""

from __future__ import annotations

from ros_system import wait_until
from rviz_view import SLOW_S, find_view, launch_with_rviz
from worlds import write_world


def test_a_world_with_namespace_and_prefix_is_shown(ros, screen, tmp_path):
    shape = {"shapeType": "GEOM_BOX", "halfExtents": [0.5, 0.5, 0.5], "rgbaColor": [1.0, 0.0, 0.0, 1.0]}
    path = write_world(tmp_path, visual=({"name": "sign", "createVisualShape": shape},))
    names = ("ns:=left", "tf_prefix:=left", "use_sim_time:=false")
    launch_with_rviz(ros, screen, "world.launch", f"config:={path}", *names)

    def red_share() -> float:
        window = find_view(screen)
        pixels = screen.grab(window).astype(int)
        return float(((pixels[..., 0] > 60) & (pixels[..., 0] > 3 * pixels[..., 1])).mean())

    wait_until(lambda: red_share() > 0.03, "the red box is in the view", SLOW_S, every_s=0.5)
