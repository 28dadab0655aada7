"""The renderer process: what its images show, and what becomes of it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from itertools import product
from pathlib import Path

import numpy as np
import pybullet
import pytest
import worlds
from rendering import ALL, CAMERA, INTRINSICS, Rendering

from rpbi.camera import back_project, project, rotation_matrix
from rpbi.pose import Pose
from rpbi.render.frame import Camera
from rpbi.world import World

HALF_EXTENTS_M = (0.3, 0.2, 0.1)
RED = [0.9, 0.1, 0.1, 1.0]
BLUE = [0.1, 0.1, 0.9, 1.0]

EYE = Pose((1.2, -0.7, 0.9), pybullet.getQuaternionFromEuler([-2.1, 0.2, 0.6]))
"""A camera pose with nothing special about it."""


def in_front(distance_m: float, right_m: float = 0.0, down_m: float = 0.0, euler=(0.0, 0.0, 0.0)) -> Pose:
    """Returns the pose in the world of what is at a place of EYE's optical frame."""
    return EYE @ Pose((right_m, down_m, distance_m), pybullet.getQuaternionFromEuler(euler))


def coloured_box(name, rgba, half_extents_m=HALF_EXTENTS_M):
    config = worlds.box(name, half_extents_m)
    return {**config, "createVisualShape": {**config["createVisualShape"], "rgbaColor": rgba}}


def make_world(folder: Path) -> World:
    return World.from_file(
        worlds.write_world(
            folder,
            collision=(worlds.FLOOR,),
            dynamic=(
                coloured_box("red", RED),
                coloured_box("blue", BLUE),
                coloured_box("wall", BLUE, (5, 5, 0.1)),
            ),
            robots=(worlds.iiwa(),),
            setAdditionalSearchPath="pybullet_data_path",
        )
    )


def clear_view(world: World) -> None:
    """Puts everything behind the camera."""
    for body in world.bodies.values():
        body.set_base_pose(in_front(-20.0))


@pytest.fixture(scope="module", params=["EGL", "TinyRenderer"])
def rendering(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp(request.param)
    rendering = Rendering(folder, make_world(folder), use_egl=request.param == "EGL")
    rendering.demand(*ALL)
    assert rendering.client.renderer.startswith(request.param)
    yield rendering
    rendering.close()


def box_mask(pose: Pose) -> np.ndarray:
    """Returns the pixels whose centres see a box of HALF_EXTENTS_M at a pose in the world, by K alone."""
    v, u = np.mgrid[: INTRINSICS.height_px, : INTRINSICS.width_px]
    signs = np.array(list(product((-1, 1), repeat=3)))
    corners = signs * HALF_EXTENTS_M @ rotation_matrix(pose.quat_xyzw).T + pose.position
    pixels = project(corners, EYE, INTRINSICS.K)[:, :2]
    mask = np.zeros(u.shape, bool)
    for axis, side in product(range(3), (-1, 1)):
        face = pixels[signs[:, axis] == side][[0, 1, 3, 2]]
        turns = [
            (end[0] - begin[0]) * (v - begin[1]) - (end[1] - begin[1]) * (u - begin[0])
            for begin, end in zip(face, np.roll(face, -1, axis=0))
        ]
        mask |= np.all(np.array(turns) >= 0, axis=0) | np.all(np.array(turns) <= 0, axis=0)
    return mask


@pytest.mark.parametrize(
    "pose", [in_front(1.5, -0.2, 0.1, (0.4, 0.9, -0.3)), in_front(1.0, 0.1, -0.05, (-1.0, 0.3, 0.8))]
)
def test_box_covers_the_pixels_that_K_says_to_a_fraction_of_a_pixel(rendering, pose):
    clear_view(rendering.world)
    red = rendering.world.bodies["red"]
    red.set_base_pose(pose)
    seen = rendering.look(EYE)["segmentation"] == red.body_id
    expected = box_mask(pose)
    assert expected.sum() > 2000
    outline = expected ^ np.roll(expected, 1, axis=0) | expected ^ np.roll(expected, 1, axis=1)
    assert (seen ^ expected).sum() < 0.05 * outline.sum()


@pytest.mark.parametrize("euler", [(0.4, 0.9, -0.3), (-1.0, 0.3, 0.8)])
def test_depth_back_projected_with_K_lies_on_the_surface_of_the_box(rendering, euler):
    clear_view(rendering.world)
    pose = in_front(1.3, 0.1, -0.1, euler)
    red = rendering.world.bodies["red"]
    red.set_base_pose(pose)
    frame = rendering.look(EYE)
    points = back_project(frame["depth"], INTRINSICS.K)[frame["segmentation"] == red.body_id]
    in_world = points @ rotation_matrix(EYE.quat_xyzw).T + EYE.position
    in_box = (in_world - pose.position) @ rotation_matrix(pose.quat_xyzw)
    distance_m = np.max(np.abs(in_box) - HALF_EXTENTS_M, axis=1)
    assert np.abs(distance_m).max() < 1e-3


@pytest.mark.parametrize("distance_m", [0.2, 1.0, 2.0, 3.0])
def test_depth_of_a_wall_is_right_to_a_millimetre_though_the_near_plane_is_at_a_centimetre(rendering, distance_m):
    clear_view(rendering.world)
    rendering.world.bodies["wall"].set_base_pose(in_front(distance_m + 0.1))
    depth = rendering.look(EYE)["depth"]
    assert np.abs(depth - distance_m).max() < 1e-3


def test_pixels_that_see_nothing_tell_the_far_plane_and_no_body(rendering):
    clear_view(rendering.world)
    frame = rendering.look(EYE)
    assert frame["depth"] == pytest.approx(INTRINSICS.far_m, rel=1e-4)
    assert np.all(frame["segmentation"] == -1)


def test_colour_is_that_of_the_body_in_view(rendering):
    clear_view(rendering.world)
    rendering.world.bodies["red"].set_base_pose(in_front(1.0, -0.3))
    rendering.world.bodies["blue"].set_base_pose(in_front(1.0, 0.3))
    colour = rendering.look(EYE)["colour"]
    assert colour.shape == (240, 320, 3)
    red, _, blue = colour[120, 60].astype(int)
    assert red > 2 * blue
    red, _, blue = colour[120, 260].astype(int)
    assert blue > 2 * red


def test_robot_is_shown_at_its_joint_positions(rendering):
    clear_view(rendering.world)
    robot = rendering.world.bodies["iiwa"]
    robot.set_base_pose(in_front(2.5, 0.0, 0.6, (1.57, 0.0, 0.0)))

    def silhouette(angle_rad):
        rendering.world.pb.resetJointState(robot.body_id, 1, angle_rad)
        return rendering.look(EYE)["segmentation"] == robot.body_id

    straight, bent = silhouette(0.0), silhouette(1.5)
    assert straight.sum() > 1000 and (straight ^ bent).sum() > 1000
    assert np.array_equal(silhouette(0.0), straight)


def test_segmentation_tells_the_simulators_ids_after_bodies_came_and_went(rendering):
    world = rendering.world
    red_config = next(entry.arguments for entry in world.log if entry.name == "red" and entry.what == "add")
    world.remove("red")
    world.remove("blue")
    stray = world.pb.createMultiBody()  # so that ids here and in the renderer differ
    blue = world.add(red_config[0], type(red_config[1]).parse(coloured_box("blue", BLUE), "blue.yaml"))
    red = world.add(*red_config)
    clear_view(world)
    red.set_base_pose(in_front(1.0, -0.3))
    blue.set_base_pose(in_front(1.0, 0.3))
    frame = rendering.look(EYE)
    assert red.body_id != blue.body_id
    assert frame["segmentation"][120, 60] == red.body_id
    assert frame["segmentation"][120, 260] == blue.body_id
    world.remove("blue")
    world.pb.removeBody(stray)
    assert blue.body_id not in rendering.look(EYE)["segmentation"]


@pytest.fixture(scope="module")
def quick(tmp_path_factory):
    folder = tmp_path_factory.mktemp("quick")
    rendering = Rendering(folder, make_world(folder))
    rendering.demand("depth")
    yield rendering
    rendering.close()


def test_only_what_is_asked_for_is_drawn(quick):
    quick.demand("depth")
    assert set(quick.look(EYE).files) == {"stamp_ns", "depth"}
    quick.demand("info", seen=2)
    quick.until(lambda: quick.client._demands["eye"].streams == {"info"}, "the new demand is known")
    assert set(quick.look(EYE).files) == {"stamp_ns"}


def test_nobody_looking_is_known_to_the_simulator(quick):
    quick.demand("depth")
    assert quick.client.wanted == {"eye"}
    quick.demand()
    assert quick.client.wanted == frozenset()


def test_frame_carries_the_stamp_of_its_tick(quick):
    quick.demand("depth")
    sample = quick.sample(EYE)
    quick.client.send(sample)
    assert quick.frame(sample.tick)["stamp_ns"] == sample.stamp_ns


def test_scenes_that_come_too_fast_replace_each_other_and_the_last_is_shown(quick):
    quick.demand("depth")
    samples = [quick.sample(EYE) for _ in range(20)]
    for sample in samples:
        quick.client.send(sample)
    quick.frame(samples[-1].tick)
    shown = [sample.tick for sample in samples if (quick.folder / f"eye-{sample.tick}.npz").exists()]
    assert shown == [samples[0].tick, samples[-1].tick]


def test_renderer_that_stands_still_neither_blocks_the_simulator_nor_fills_its_memory(quick):
    quick.demand("depth")
    os.kill(quick.client.process_id, signal.SIGSTOP)
    try:
        begin_s = time.thread_time()
        for _ in range(2000):
            quick.client.send(quick.sample(EYE))
            quick.client.poll()
        assert len(quick.client._channel._outgoing) < 100_000
        assert len(quick.client._waiting) <= 1
    finally:
        os.kill(quick.client.process_id, signal.SIGCONT)
    assert time.thread_time() > begin_s
    quick.look(EYE)


def test_viewer_that_comes_while_the_world_stands_still_gets_the_last_scene_once(quick):
    quick.demand("depth", seen=10)
    sample = quick.sample(EYE)
    quick.client.send(sample)
    quick.frame(sample.tick)
    path = quick.folder / f"eye-{sample.tick}.npz"
    path.unlink()
    quick.client.serve_late()
    quick.demand("depth", seen=11)
    quick.until(lambda: quick.client._demands["eye"].seen == 11, "the viewer is known")
    quick.client.serve_late()
    quick.frame(sample.tick)
    path.unlink()
    for _ in range(100):
        quick.client.serve_late()
        quick.client.poll()
        time.sleep(0.002)
    assert not path.exists()


def test_killed_renderer_comes_back_by_itself_and_shows_the_world_as_it_is_now(quick, caplog):
    world = quick.world
    world.remove("blue")
    quick.demand("segmentation")
    quick.look(EYE)
    killed = quick.client.process_id
    os.kill(killed, signal.SIGKILL)
    quick.until(lambda: quick.client.process_id not in (None, killed), "another renderer was started")
    quick.until(lambda: "eye" in quick.client.wanted, "it knows that somebody looks")
    clear_view(world)
    world.bodies["red"].set_base_pose(in_front(1.0))
    assert quick.look(EYE)["segmentation"][120, 160] == world.bodies["red"].body_id
    assert quick.client.renderer.startswith("EGL")
    warnings = [record.getMessage() for record in caplog.records if "ended with" in record.getMessage()]
    assert len(warnings) == 1 and "SIGKILL" in warnings[0]


def test_renderer_without_egl_falls_back_to_software_and_says_so(tmp_path, monkeypatch, caplog):
    monkeypatch.setenv("__EGL_VENDOR_LIBRARY_DIRS", str(tmp_path))  # where libEGL looks for drivers
    caplog.set_level("INFO")
    rendering = Rendering(tmp_path, make_world(tmp_path))
    try:
        rendering.demand("segmentation")
        clear_view(rendering.world)
        rendering.world.bodies["red"].set_base_pose(in_front(1.0))
        frame = rendering.look(EYE)
        assert frame["segmentation"][120, 160] == rendering.world.bodies["red"].body_id
        assert rendering.client.renderer == "TinyRenderer"
        assert "drawn by TinyRenderer" in caplog.text
    finally:
        rendering.close()


def test_two_cameras_each_have_their_own_size_and_view(tmp_path):
    wide = Camera("wide", "rpbi/wide", INTRINSICS.__class__(width_px=1280, height_px=720, fov_deg=60.0))
    rendering = Rendering(tmp_path, make_world(tmp_path), cameras=(CAMERA, wide))
    try:
        clear_view(rendering.world)
        red = rendering.world.bodies["red"]
        red.set_base_pose(in_front(1.0))
        for camera in (wide, CAMERA, wide):
            rendering.demand(*ALL, camera=camera.name)
            sample = rendering.sample(EYE, camera.name)
            rendering.client.send(sample)
            path = tmp_path / f"{camera.name}-{sample.tick}.npz"
            rendering.until(path.exists, f"{path.name} came")
            segmentation = np.load(path)["segmentation"]
            shape = (camera.intrinsics.height_px, camera.intrinsics.width_px)
            assert segmentation.shape == shape
            assert segmentation[shape[0] // 2, shape[1] // 2] == red.body_id
    finally:
        rendering.close()


def test_renderer_ends_in_order_when_it_is_stopped(tmp_path):
    rendering = Rendering(tmp_path, make_world(tmp_path))
    rendering.demand("depth")
    process = rendering.client._process
    rendering.close()
    assert process.returncode == 0
    assert (tmp_path / "closed").exists()
    rendering.client.poll()
    assert rendering.client.process_id is None


ORPHAN = """
import sys, time
from pathlib import Path
from rendering import Rendering
from test_render import make_world
folder = Path(sys.argv[1])
rendering = Rendering(folder, make_world(folder))
rendering.demand("depth")
print(rendering.client.process_id, flush=True)
time.sleep(60)
"""


def test_renderer_ends_when_the_simulator_is_killed(tmp_path):
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    simulator = subprocess.Popen(
        [sys.executable, "-c", ORPHAN, str(tmp_path)], stdout=subprocess.PIPE, text=True, env=environment
    )
    renderer = next(int(line) for line in simulator.stdout if line.strip().isdigit())
    simulator.kill()
    simulator.wait()
    end_s = time.monotonic() + 30.0
    while Path(f"/proc/{renderer}/exe").exists() and time.monotonic() < end_s:
        time.sleep(0.02)
    assert (tmp_path / "closed").exists()
    with pytest.raises(OSError):
        os.readlink(f"/proc/{renderer}/exe")
