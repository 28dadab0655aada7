"""The renderer process: what its images show, and what becomes of it."""

from __future__ import annotations

import contextlib
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
from rendering import ALL, CAMERA, INTRINSICS, Rendering, back_project, project, rotation_matrix

from custom_ros_tools.child_process import is_stopped
from rpbi.geometry import Pose
from rpbi.render.camera import DepthNoise, Intrinsics
from rpbi.render.frame import Camera
from rpbi.render.mirror import Mirror
from rpbi.render.renderers import TransparentShape, open_renderer
from rpbi.world import World

HALF_EXTENTS_M = (0.3, 0.2, 0.1)
RED = [0.9, 0.1, 0.1, 1.0]
BLUE = [0.1, 0.1, 0.9, 1.0]

BALL_RADIUS_M = 0.2
CORNERS_M = [[-0.2, -0.2, 0.0], [0.2, -0.2, 0.0], [0.0, 0.2, 0.0]]
FIRST_GLASS = {  # has the body id of the image that is drawn to try EGL
    "name": "more_glass",
    "createVisualShape": {"shapeType": "GEOM_BOX", "halfExtents": [0.3, 0.3, 0.01], "rgbaColor": [0.1, 0.9, 0.1, 0.5]},
}
PLANE = {"name": "plane", "createVisualShape": {"shapeType": "GEOM_PLANE", "planeNormal": [0.0, 0.0, 1.0]}}
TRIANGLE = {
    "name": "triangle",
    "createVisualShape": {
        "shapeType": "GEOM_MESH",
        "vertices": CORNERS_M,
        "indices": [0, 1, 2, 0, 2, 1],
        "rgbaColor": BLUE,
    },
}

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
            visual=(FIRST_GLASS, PLANE, TRIANGLE),
            collision=(worlds.FLOOR,),
            dynamic=(
                worlds.ball("ball", BALL_RADIUS_M),
                coloured_box("glass", [0.9, 0.1, 0.1, 0.25], (0.3, 0.3, 0.01)),
                coloured_box("hidden", [1.0, 1.0, 1.0, 0.0]),
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
def test_box_covers_the_pixels_predicted_by_the_camera_matrix(rendering, pose):
    clear_view(rendering.world)
    red = rendering.world.bodies["red"]
    red.set_base_pose(pose)
    seen = rendering.look(EYE)["segmentation"] == red.body_id
    expected = box_mask(pose)
    assert expected.sum() > 2000
    outline = expected ^ np.roll(expected, 1, axis=0) | expected ^ np.roll(expected, 1, axis=1)
    assert (seen ^ expected).sum() < 0.05 * outline.sum()


@pytest.mark.parametrize("euler", [(0.4, 0.9, -0.3), (-1.0, 0.3, 0.8)])
def test_back_projected_depth_lies_on_the_surface_of_the_box(rendering, euler):
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
def test_depth_of_a_wall_is_exact_to_a_millimetre(rendering, distance_m):
    clear_view(rendering.world)
    rendering.world.bodies["wall"].set_base_pose(in_front(distance_m + 0.1))
    depth = rendering.look(EYE)["depth"]
    assert np.abs(depth - distance_m).max() < 1e-3


def rays():
    """Returns a vector along the ray of each pixel in the optical frame, with z = 1."""
    return back_project(np.ones((INTRINSICS.height_px, INTRINSICS.width_px)), INTRINSICS.K)


def test_depth_of_a_ball_is_exact_to_two_millimetres(rendering):
    clear_view(rendering.world)
    ball = rendering.world.bodies["ball"]
    centre = np.array([0.1, -0.05, 1.0 + BALL_RADIUS_M])
    ball.set_base_pose(in_front(centre[2], *centre[:2]))
    frame = rendering.look(EYE)
    towards = rays() @ centre
    length = (rays() ** 2).sum(axis=-1)
    below_root = towards**2 - length * (centre @ centre - BALL_RADIUS_M**2)
    expected_m = (towards - np.sqrt(np.maximum(below_root, 0.0))) / length
    cosine = np.sqrt(np.maximum(below_root, 0.0) / length) / BALL_RADIUS_M  # of the angle between ray and normal
    steep = cosine > 0.3
    assert steep.sum() > 4000
    assert np.all(frame["segmentation"][steep] == ball.body_id)
    assert np.abs(frame["depth"] - expected_m)[steep].max() < 2e-3


def test_depth_of_a_slanted_plane_is_right_to_two_millimetres(rendering):
    clear_view(rendering.world)
    plane = rendering.world.bodies["plane"]
    pose = in_front(1.0, 0.0, 0.0, (0.5, 2.8, 0.0))
    plane.set_base_pose(pose)
    normal = rotation_matrix(pose.quat_xyzw)[:, 2] @ rotation_matrix(EYE.quat_xyzw)
    expected_m = normal[2] / (rays() @ normal)
    near = (expected_m > 0.0) & (expected_m < 1.5)
    frame = rendering.look(EYE)
    assert near.sum() > 30_000
    assert np.all(frame["segmentation"][near] == plane.body_id)
    assert np.abs(frame["depth"] - expected_m)[near].max() < 2e-3


def test_mesh_with_corners_in_the_yaml_is_drawn(rendering):
    clear_view(rendering.world)
    triangle = rendering.world.bodies["triangle"]
    triangle.set_base_pose(in_front(1.0))
    frame = rendering.look(EYE)
    seen = frame["segmentation"] == triangle.body_id
    assert seen.sum() == pytest.approx(0.5 * 0.4 * 0.4 * INTRINSICS.K[0, 0] ** 2, rel=0.03)
    assert np.abs(frame["depth"][seen] - 1.0).max() < 1e-3
    red, _, blue = frame["colour"][seen].astype(int).mean(axis=0)
    assert blue > 2 * red


def test_glass_tints_the_background_and_determines_depth_and_segmentation(rendering):
    clear_view(rendering.world)
    bodies = rendering.world.bodies
    bodies["wall"].set_base_pose(in_front(2.1))
    plain = rendering.look(EYE)["colour"][120, 160].astype(int)
    bodies["glass"].set_base_pose(in_front(1.01))
    frame = rendering.look(EYE)
    glass = frame["segmentation"] == bodies["glass"].body_id
    assert glass.sum() == pytest.approx(0.36 * INTRINSICS.K[0, 0] ** 2, rel=0.03)
    assert np.abs(frame["depth"][glass] - 1.0).max() < 1e-3
    assert np.abs(frame["depth"][frame["segmentation"] == bodies["wall"].body_id] - 2.0).max() < 1e-3
    tinted = frame["colour"][120, 160].astype(int)
    assert tinted[2] == pytest.approx(0.75 * plain[2], abs=8)  # a quarter opaque
    assert tinted[0] > plain[0] + 10


def test_of_several_panes_the_nearest_is_in_depth_and_segmentation(rendering):
    clear_view(rendering.world)
    bodies = rendering.world.bodies
    bodies["wall"].set_base_pose(in_front(2.1))
    for nearer, farther in (("glass", "more_glass"), ("more_glass", "glass")):
        bodies[farther].set_base_pose(in_front(1.51))
        bodies[nearer].set_base_pose(in_front(1.01))
        frame = rendering.look(EYE)
        assert frame["segmentation"][120, 160] == bodies[nearer].body_id
        assert frame["depth"][120, 160] == pytest.approx(1.0, abs=1e-3)


def test_transparent_body_is_in_no_image(rendering):
    clear_view(rendering.world)
    bodies = rendering.world.bodies
    bodies["wall"].set_base_pose(in_front(2.1))
    bodies["glass"].set_base_pose(in_front(1.5, 0.5))
    plain = rendering.look(EYE)
    bodies["hidden"].set_base_pose(in_front(1.0))
    frame = rendering.look(EYE)
    for image in ALL:
        assert np.array_equal(frame[image], plain[image])


def test_glass_is_drawn_the_same_after_bodies_came_and_went(rendering):
    world = rendering.world
    glass = next(entry.arguments for entry in world.log if entry.name == "glass" and entry.what == "add")
    clear_view(world)
    world.bodies["wall"].set_base_pose(in_front(2.1))
    world.bodies["glass"].set_base_pose(in_front(1.01))
    before = rendering.look(EYE)
    world.remove("glass")
    opaque = world.add("dynamic", type(glass[1]).parse(coloured_box("brick", RED), "brick.yaml"))
    opaque.set_base_pose(in_front(1.0 + HALF_EXTENTS_M[2]))
    assert rendering.look(EYE)["colour"][120, 160, 2] < 60  # nothing of the blue wall
    world.remove("brick")
    world.add(*glass).set_base_pose(in_front(1.01))
    after = rendering.look(EYE)
    assert np.array_equal(before["colour"], after["colour"]) and np.array_equal(before["depth"], after["depth"])


def test_empty_pixels_have_far_plane_depth_and_no_body(rendering):
    clear_view(rendering.world)
    frame = rendering.look(EYE)
    assert frame["depth"] == pytest.approx(INTRINSICS.far_m, rel=1e-4)
    assert np.all(frame["segmentation"] == -1)


def test_colour_is_that_of_the_visible_body(rendering):
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


def test_segmentation_has_the_simulators_ids_after_bodies_were_replaced(rendering):
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


def test_only_requested_images_are_drawn(quick):
    quick.demand("depth")
    assert set(quick.look(EYE).files) == {"stamp_ns", "depth"}
    quick.demand("info", seen=2)
    quick.until(lambda: quick.client._demands["eye"].streams == {"info"}, "the new demand is known")
    assert set(quick.look(EYE).files) == {"stamp_ns"}


def test_simulator_knows_when_a_camera_has_no_viewer(quick):
    quick.demand("depth")
    assert quick.client.wanted == {"eye"}
    quick.demand()
    assert quick.client.wanted == frozenset()


def test_frame_carries_the_stamp_of_its_tick(quick):
    quick.demand("depth")
    sample = quick.sample(EYE)
    quick.client.send(sample)
    assert quick.frame(sample.tick)["stamp_ns"] == sample.stamp_ns


def test_fast_scenes_are_replaced_and_the_last_one_is_shown(quick):
    quick.demand("depth")
    samples = [quick.sample(EYE) for _ in range(20)]
    for sample in samples:
        quick.client.send(sample)
    quick.frame(samples[-1].tick)
    shown = [sample.tick for sample in samples if (quick.folder / f"eye-{sample.tick}.npz").exists()]
    assert shown == [samples[0].tick, samples[-1].tick]


def test_frozen_renderer_neither_blocks_the_simulator_nor_fills_its_memory(quick):
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


def _policies(process_id):
    """Returns how each thread is scheduled, and its nice value."""
    found = set()
    for thread in map(int, os.listdir(f"/proc/{process_id}/task")):
        with contextlib.suppress(ProcessLookupError):  # it has ended since
            found.add((os.sched_getscheduler(thread), os.getpriority(os.PRIO_PROCESS, thread)))
    return found


def test_renderer_yields_to_the_simulator_but_not_to_everybody(tmp_path):
    rendering = Rendering(tmp_path, make_world(tmp_path), use_egl=False, gives_way=True)
    try:
        rendering.demand("depth")
        process_id = rendering.client.process_id
        nice = min(os.getpriority(os.PRIO_PROCESS, 0) + 10, 19)
        rendering.until(lambda: _policies(process_id) == {(os.SCHED_BATCH, nice)}, "it yields")
    finally:
        rendering.close()


def test_frozen_renderer_is_reported_even_without_viewers(quick, monkeypatch, caplog):
    monkeypatch.setattr("rpbi.render.client.SILENT_AFTER_S", 0.0)  # the test stops it, not a busy machine
    process_id = quick.client.process_id
    os.kill(process_id, signal.SIGSTOP)
    try:
        quick.until(lambda: is_stopped(process_id), "it is stopped")
        quick.until(lambda: "is stopped by a signal" in quick.client.fault, "it is reported")
    finally:
        os.kill(process_id, signal.SIGCONT)
    monkeypatch.undo()
    quick.until(lambda: not quick.client.fault, "it answers")
    said = [record.getMessage() for record in caplog.records]
    assert f"camera: the renderer (process {process_id}) is stopped by a signal: no images for 0 s" in said
    assert said[-1] == "camera: the renderer answers again"


def test_late_viewer_of_a_paused_world_gets_the_last_scene(quick):
    quick.demand("depth", seen=10)
    sample = quick.sample(EYE)
    quick.client.send(sample)
    quick.frame(sample.tick)
    path = quick.folder / f"eye-{sample.tick}.npz"
    path.unlink()
    quick.client.serve_late()
    quick.demand("depth", seen=11)
    quick.client.serve_late()
    quick.frame(sample.tick)
    path.unlink()
    for _ in range(100):
        quick.client.serve_late()
        quick.client.poll()
        time.sleep(0.002)
    assert not path.exists()


def test_killed_renderer_restarts_and_shows_the_current_world(quick, caplog):
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


def test_larger_camera_added_later_is_drawn_whole_and_removable(quick):
    world = quick.world
    clear_view(world)
    red = world.bodies["red"]
    red.set_base_pose(in_front(1.0))
    quick.demand("segmentation")
    quick.look(EYE)
    process_id = quick.client.process_id
    quick.client.add(Camera("late", "rpbi/late", Intrinsics(width_px=1000, height_px=600, fov_deg=50.0)))
    quick.demand("segmentation", camera="late")
    sample = quick.sample(EYE, "late")
    quick.client.send(sample)
    path = quick.folder / f"late-{sample.tick}.npz"
    quick.until(path.exists, f"{path.name} came")
    segmentation = np.load(path)["segmentation"]
    assert segmentation.shape == (600, 1000) and segmentation[300, 500] == red.body_id
    quick.client.remove("late")
    assert not quick.client.knows_demand("late")
    quick.demand("segmentation")
    assert quick.look(EYE)["segmentation"][120, 160] == red.body_id
    assert quick.client.process_id == process_id


def test_synchronous_camera_reports_when_its_frame_is_published(tmp_path):
    rendering = Rendering(tmp_path, make_world(tmp_path), cameras=(CAMERA._replace(synchronous=True),))
    try:
        rendering.demand("depth")
        for _ in range(3):
            sample = rendering.sample(EYE)
            assert not rendering.client.has_shown("eye", sample.stamp_ns)
            rendering.client.send(sample)
            rendering.until(lambda sample=sample: rendering.client.has_shown("eye", sample.stamp_ns), "it is out")
            assert (tmp_path / f"eye-{sample.tick}.npz").exists()
    finally:
        rendering.close()


def test_first_image_of_a_renderer_equals_the_following_ones(tmp_path):
    """Viewers that come late get the last scene drawn again, which has to be what the others have seen."""
    world = World.from_file(
        worlds.write_world(tmp_path, collision=(worlds.FLOOR,), dynamic=(worlds.box(basePosition=[0.0, 0.0, 0.1]),))
    )
    renderer = open_renderer([CAMERA])
    mirror = Mirror(renderer.pb)
    for entry in world.log:
        mirror.apply(entry)
    mirror.show(body.state() for body in world.bodies.values())
    above = Pose((0.0, 0.0, 2.0), (1.0, 0.0, 0.0, 0.0))
    first, second = (renderer.draw(INTRINSICS, above, segmentation=False).rgba.copy() for _ in range(2))
    assert np.array_equal(first, second)


def test_large_image_has_depths_everywhere_behind_glass():
    """PyBullet enlarges images of 1024 x 768 pixels; depths with transparent shapes are read separately."""
    large = Intrinsics(width_px=1280, height_px=900, near_m=0.1, far_m=10.0)
    renderer = open_renderer([Camera("large", "", large)])
    pb = renderer.pb
    made = [(2.0, [5.0, 5.0, 0.1], [*RED[:3], 1.0]), (1.0, [0.2, 0.1, 0.01], [*BLUE[:3], 0.5])]
    for z_m, half_extents, rgba in made:
        shape = pb.createVisualShape(pb.GEOM_BOX, halfExtents=half_extents, rgbaColor=rgba)
        body_id = pb.createMultiBody(0.0, -1, shape, [0.0, 0.0, z_m])
    plain = renderer.draw(large, Pose()).depth_buffer
    transparent = (TransparentShape(body_id, -1, 0, tuple(rgba)),)
    glass = renderer.draw(large, Pose(), transparent=transparent).depth_buffer
    assert (glass < 1.0).all() and np.abs(glass - plain).max() > 0.01  # the glass is nearer than the wall
    left, upper = (slice(None), slice(0, 300)), (slice(0, 200), slice(None))
    assert np.array_equal(glass[left], plain[left]) and np.array_equal(glass[upper], plain[upper])


def test_camera_noise_changes_depth_identically_in_another_process(tmp_path):
    noise = DepthNoise(0.01, 0.0, 5)
    images = []
    for folder in (tmp_path / "one", tmp_path / "other"):
        folder.mkdir()
        rendering = Rendering(folder, make_world(folder), cameras=(CAMERA._replace(noise=noise),))
        try:
            rendering.demand("depth")
            clear_view(rendering.world)
            rendering.world.bodies["wall"].set_base_pose(in_front(1.1))
            images.append(rendering.look(EYE)["depth"])
        finally:
            rendering.close()
    assert images[0].std() == pytest.approx(0.01, rel=0.03)
    assert np.array_equal(*images)


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
print(f"\\n{rendering.client.process_id}", flush=True)  # PyBullet leaves a line unfinished
time.sleep(60)
"""


def test_renderer_ends_when_the_simulator_is_killed(tmp_path):
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), *filter(None, sys.path)])}
    simulator = subprocess.Popen(
        [sys.executable, "-c", ORPHAN, str(tmp_path)], stdout=subprocess.PIPE, text=True, env=environment
    )
    renderer = next(int(line) for line in simulator.stdout if line.strip().isdigit())
    simulator.kill()
    simulator.wait()
    end_s = time.monotonic() + 60.0
    while Path(f"/proc/{renderer}/exe").exists() and time.monotonic() < end_s:
        time.sleep(0.02)
    assert (tmp_path / "closed").exists()
    with pytest.raises(OSError):
        os.readlink(f"/proc/{renderer}/exe")


def test_a_renderer_that_still_starts_is_killed_at_once(tmp_path, monkeypatch):
    """It reads no messages until its meshes are loaded, and an interrupted simulator must not wait for them."""
    monkeypatch.setattr("rpbi.render.client.STOP_TIMEOUT_S", float("inf"))
    rendering = Rendering(tmp_path, make_world(tmp_path))
    monkeypatch.setattr(rendering.client, "_command", [sys.executable, "-c", "import time; time.sleep(600.0)"])
    rendering.client.poll()
    process_id = rendering.client.process_id
    assert not rendering.client.stop()
    assert not Path(f"/proc/{process_id}").exists()
    rendering.world.close()
