"""Measures how fast this machine draws images of a world without physics and ROS: an upper limit for camera rates."""

import argparse
import json
import subprocess
import sys
import time

from custom_ros_tools.errors import InterfaceError
from robot_model.geometry import Pose
from rpbi.render.camera import Intrinsics, depth_in_metres
from rpbi.render.frame import Camera
from rpbi.render.mirror import Mirror
from rpbi.render.renderers import TinyRenderer, open_renderer
from rpbi.world import World

TIMEOUT_S = 120.0


def draw_rate_hz(world: str, camera: Pose, seconds: float, renderer: str) -> float:
    """Measures the rate at which images of the world's camera are drawn.

    The measurement runs in a separate process, since some graphics drivers crash.

    Args:
        world: Main YAML file.
        camera: Pose of the camera's optical frame in the world.
        seconds: Duration of the measurement [s].
        renderer: Name of the renderer, as in the diagnostics of the simulator.

    Returns:
        Number of images per second, each with colour and depth.

    Raises:
        InterfaceError: If the images cannot be drawn.
    """
    numbers = [str(number) for number in (*camera.position, *camera.quat_xyzw)]
    command = [sys.executable, "-m", __name__, world, str(seconds), renderer, *numbers]
    try:
        run = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT_S)
    except subprocess.TimeoutExpired:
        raise InterfaceError(f"{world}: images were not drawn within {TIMEOUT_S:g} s") from None
    # PyBullet and its plugin print around it
    found = [line for line in run.stdout.splitlines() if line.startswith('{"draw_rate_hz"')]
    if run.returncode or not found:
        raise InterfaceError(f"{world}: images cannot be drawn: {run.stderr.strip() or run.returncode}")
    return float(json.loads(found[0])["draw_rate_hz"])


def measure(world: str, camera: Pose, seconds: float, use_egl: bool) -> float:
    """Draws images of the world's camera for a given time, and returns the number of images per second.

    Args:
        world: Main YAML file.
        camera: Pose of the camera's optical frame in the world.
        seconds: Duration of the measurement [s].
        use_egl: Whether to draw with EGL; otherwise with TinyRenderer.
    """
    loaded = World.from_file(world)
    config = loaded.config.rgbd_sensor
    assert config is not None
    size = config.intrinsics
    intrinsics = Intrinsics(size.width, size.height, size.fov, *size.range)
    renderer = open_renderer([Camera(config.name, config.object_tf.tf_id, intrinsics)], use_egl)
    mirror = Mirror(renderer.pb)
    for entry in loaded.log:
        mirror.apply(entry)
    renderer.draw(intrinsics, camera, segmentation=False)  # the first one loads meshes and textures
    images = 0
    start_s = time.monotonic()
    while time.monotonic() - start_s < seconds:
        depth_in_metres(renderer.draw(intrinsics, camera, segmentation=False).depth_buffer, intrinsics)
        images += 1
    return images / (time.monotonic() - start_s)


def main() -> None:
    """Runs `measure` with arguments from the command line, and prints the number of images per second as JSON."""
    parser = argparse.ArgumentParser(prog=__name__)
    parser.add_argument("world")
    parser.add_argument("seconds", type=float)
    parser.add_argument("renderer")
    parser.add_argument("pose", type=float, nargs=7, help="x y z [m], quaternion x y z w")
    arguments = parser.parse_args()
    x, y, z, *quaternion = arguments.pose
    camera = Pose((x, y, z), tuple(quaternion))
    rate_hz = measure(arguments.world, camera, arguments.seconds, arguments.renderer != TinyRenderer.name)
    print(json.dumps({"draw_rate_hz": rate_hz}), flush=True)


if __name__ == "__main__":
    main()
