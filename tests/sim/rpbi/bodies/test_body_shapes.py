"""What bodies look like: shapes, sizes and colours, and that each is where PyBullet shows it."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pybullet
import pytest
from rendering import back_project, rotation_matrix
from robot_shape import read_obj
from scipy.spatial import cKDTree
from worlds import iiwa, write_world

from rpbi.bodies.visual_shapes import PLANE_SIZE_M, ShapeKind, body_shapes, link_pose
from rpbi.geometry import Pose
from rpbi.render.camera import Intrinsics, depth_in_metres, view_matrix
from rpbi.world import World

EYE = Pose((0.2, -1.6, 0.9), (-0.7933533, 0.0, 0.0, 0.6087614))
"""Where a camera sees the whole arm from, looking along y and a little down."""
INTRINSICS = Intrinsics(320, 240, 55.0, 0.5, 4.0)
BENT = {f"lbr_iiwa_joint_{number}": 15.0 * number for number in range(1, 8)}
"""A pose in which no joint is at zero [deg]."""
TURNED = (0.0, 0.0, 0.6, 0.8)
CUBE = str(Path(__file__).resolve().parents[4] / "src/rpbi_examples/configs/meshes/cube.obj")


def visual(**shape):
    """Returns the configuration of a visual object."""
    return {"name": "thing", "createVisualShape": shape}


@pytest.fixture
def build(tmp_path):
    """Builds a world of these objects; it is closed after the test."""
    worlds = []

    def build(**parts):
        worlds.append(World.from_file(write_world(tmp_path, **parts)))
        return worlds[-1]

    yield build
    for world in worlds:
        world.close()


@pytest.mark.parametrize(
    ("shape", "kind", "size"),
    [
        ({"shapeType": "GEOM_BOX", "halfExtents": [0.1, 0.2, 0.3]}, ShapeKind.BOX, (0.2, 0.4, 0.6)),
        ({"shapeType": "GEOM_SPHERE", "radius": 0.3}, ShapeKind.SPHERE, (0.6, 0.6, 0.6)),
        ({"shapeType": "GEOM_CYLINDER", "radius": 0.1, "length": 0.5}, ShapeKind.CYLINDER, (0.2, 0.2, 0.5)),
        ({"shapeType": "GEOM_MESH", "fileName": CUBE, "meshScale": [0.1, 0.2, 0.3]}, ShapeKind.MESH, (0.1, 0.2, 0.3)),
    ],
)
def test_shape_has_size_pose_and_colour_of_its_yaml(build, shape, kind, size):
    rgba = (0.1, 0.2, 0.3, 0.4)
    frame = {"visualFramePosition": [0.5, 0.1, 0.2], "visualFrameOrientation": list(TURNED), "rgbaColor": list(rgba)}
    (found,) = body_shapes(build(visual=(visual(**shape, **frame),)).bodies["thing"])
    assert (found.kind, found.size) == (kind, pytest.approx(size))
    assert found.pose_in_link == (pytest.approx((0.5, 0.1, 0.2)), pytest.approx(TURNED))
    assert found.rgba == pytest.approx(rgba)
    assert found.mesh_file == (CUBE if kind is ShapeKind.MESH else "")


def test_capsule_is_a_cylinder_with_a_ball_at_each_end(build):
    quat = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))  # z becomes -y
    shape = {"shapeType": "GEOM_CAPSULE", "radius": 0.1, "length": 0.6}
    frame = {"visualFramePosition": [1.0, 0.0, 0.0], "visualFrameOrientation": list(quat)}
    parts = body_shapes(build(visual=(visual(**shape, **frame),)).bodies["thing"])
    assert [part.kind for part in parts] == [ShapeKind.CYLINDER, ShapeKind.SPHERE, ShapeKind.SPHERE]
    assert [part.size for part in parts] == [pytest.approx(each) for each in ((0.2, 0.2, 0.6), (0.2,) * 3, (0.2,) * 3)]
    assert [part.pose_in_link.position for part in parts[1:]] == [
        pytest.approx((1.0, -0.3, 0.0), abs=1e-6),
        pytest.approx((1.0, 0.3, 0.0), abs=1e-6),
    ]


@pytest.mark.parametrize("normal", [(0.0, 0.0, 1.0), (0.0, 3.0, 4.0), (1.0, 0.0, 0.0), (0.0, 0.0, -2.0)])
def test_plane_is_a_large_thin_box_below_its_surface(build, normal):
    world = build(visual=(visual(shapeType="GEOM_PLANE", planeNormal=list(normal)),))
    (found,) = body_shapes(world.bodies["thing"])
    assert (found.kind, found.size[:2]) == (ShapeKind.BOX, (PLANE_SIZE_M, PLANE_SIZE_M))
    surface = found.pose_in_link @ Pose((0.0, 0.0, found.size[2] / 2))
    above = found.pose_in_link @ Pose((0.0, 0.0, found.size[2] / 2 + 1.0))
    assert surface.position == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)
    assert above.position == pytest.approx(tuple(np.array(normal) / np.linalg.norm(normal)), abs=1e-6)


def test_mesh_written_in_the_yaml_has_its_corners(build):
    vertices = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    shape = {"shapeType": "GEOM_MESH", "vertices": vertices, "indices": [0, 1, 2, 0, 2, 3]}
    (found,) = body_shapes(build(visual=(visual(**shape),)).bodies["thing"])
    assert found.kind is ShapeKind.TRIANGLES
    assert found.corners == tuple(tuple(vertices[index]) for index in (0, 1, 2, 0, 2, 3))


def test_only_a_mesh_with_a_picture_on_it_is_textured(build):
    world = build(
        visual=(visual(shapeType="GEOM_MESH", fileName="duck.obj"),),
        robots=(iiwa(),),
        setAdditionalSearchPath="pybullet_data_path",
    )
    assert [shape.is_textured for shape in body_shapes(world.bodies["thing"])] == [True]
    assert not any(shape.is_textured for shape in body_shapes(world.bodies["iiwa"]))


def test_robot_shapes_belong_to_links_and_have_urdf_colours(build):
    world = build(robots=(iiwa(),), setAdditionalSearchPath="pybullet_data_path")
    shapes = body_shapes(world.bodies["iiwa"])
    assert [shape.link for shape in shapes] == [f"lbr_iiwa_link_{index}" for index in range(8)]
    assert [Path(shape.mesh_file).name for shape in shapes] == [f"link_{index}.obj" for index in range(8)]
    assert shapes[3].rgba == pytest.approx((1.0, 0.4235, 0.0392, 1.0), abs=1e-4)


def test_globally_scaled_robot_has_scaled_meshes(build):
    big = iiwa(loadURDF={"fileName": "kuka_iiwa/model.urdf", "useFixedBase": True, "globalScaling": 2.0})
    world = build(robots=(big,), setAdditionalSearchPath="pybullet_data_path")
    assert {shape.size for shape in body_shapes(world.bodies["iiwa"])} == {(2.0, 2.0, 2.0)}


def test_shapes_of_a_robot_are_where_pybullet_draws_them(build):
    """Each pixel shows a point of the mesh of its link; the links' centres of mass are up to 0.1 m off their frames."""
    arm = iiwa(initial_joint_position=BENT)
    world = build(robots=(arm,), setAdditionalSearchPath="pybullet_data_path")
    body = world.bodies["iiwa"]
    points, links = seen(world)
    for shape in body_shapes(body):
        pose = link_pose(body, shape.link_index) @ shape.pose_in_link
        surface = spread(read_obj(Path(shape.mesh_file))) * shape.size
        on_mesh = surface @ rotation_matrix(pose.quat_xyzw).T + pose.position
        drawn = points[links == shape.link_index]
        assert len(drawn) > 30, shape.link
        distance_m, _ = cKDTree(on_mesh).query(drawn)
        assert np.median(distance_m) < 0.004, shape.link
        assert distance_m.max() < 0.01, shape.link


def spread(triangles):
    """Returns points all over triangles: those whose weights of the three corners are sixths."""
    weights = [(a, b, 6 - a - b) for a in range(7) for b in range(7 - a)]
    return np.einsum("wc,tcx->wtx", np.array(weights) / 6.0, triangles).reshape(-1, 3)


def seen(world):
    """Returns points of the world that a camera sees, shape (n, 3), and the index of the link that each is on."""
    width, height = INTRINSICS.width_px, INTRINSICS.height_px
    _, _, _, buffer, segmentation = world.pb.getCameraImage(
        width,
        height,
        view_matrix(EYE).T.ravel().tolist(),
        INTRINSICS.projection.T.ravel().tolist(),
        renderer=pybullet.ER_TINY_RENDERER,
        flags=pybullet.ER_SEGMENTATION_MASK_OBJECT_AND_LINKINDEX,
    )
    depth_m = depth_in_metres(np.asarray(buffer, np.float32).reshape(height, width), INTRINSICS)
    in_camera = back_project(depth_m, INTRINSICS.K).reshape(-1, 3)
    points = in_camera @ rotation_matrix(EYE.quat_xyzw).T + EYE.position
    segmentation = np.reshape(segmentation, -1)
    is_seen = segmentation >= 0
    return points[is_seen], (segmentation[is_seen] >> 24) - 1
