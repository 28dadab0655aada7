"""Soft bodies: they fall, give way, hang on anchors, are told and seen, and come and go."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pybullet
import pytest
from rendering import Rendering
from soft_meshes import DEFORMABLE, GROUND, MASS_KG, block, write_block
from worlds import box, iiwa, write_world

from custom_ros_tools.errors import ConfigError, PhysicsError, UnknownNameError
from custom_ros_tools.schema.json_schema import json_schema, types_in
from rpbi.bodies.soft import SoftObject
from rpbi.config.pybullet_models import ChangeDynamics, CreateSoftBodyAnchor, LoadSoftBody
from rpbi.geometry import Pose
from rpbi.samples import ContactsSample, SurfaceSample
from rpbi.world import World

TICK_S = 0.004


@pytest.fixture
def build(tmp_path):
    worlds = []

    def build_world(*soft, **more) -> World:
        parts = {"timeStep": TICK_S, "collision": (GROUND,), **DEFORMABLE, **more}
        worlds.append(World.from_file(write_world(tmp_path, soft=soft, **parts)))
        return worlds[-1]

    yield build_world
    for world in worlds:
        world.close()


def run(world, ticks):
    return [sample for _ in range(ticks) for sample in world.step()]


def nodes(world, name="jelly"):
    return np.array(world.bodies[name].state().nodes)


def test_soft_body_falls_freely_and_rests_on_the_floor(build, tmp_path):
    world = build(block(tmp_path))
    assert isinstance(world.bodies["jelly"], SoftObject)
    run(world, 50)
    assert world.bodies["jelly"].base_pose().position[2] == pytest.approx(1.0 - 0.5 * 9.81 * 0.2**2, abs=0.01)
    run(world, 700)
    heights = nodes(world)[:, 2]
    assert heights.min() == pytest.approx(0.0, abs=0.01)
    assert 0.12 < heights.max() < 0.2, "its own weight presses it down a little"


def test_soft_body_deforms_under_a_box(build, tmp_path):
    alone = build(block(tmp_path, load={"basePosition": [0, 0, 0.11]}))
    run(alone, 500)
    load = box(basePosition=[0, 0, 0.35], baseMass=3.0)
    world = build(block(tmp_path, load={"basePosition": [0, 0, 0.11]}), dynamic=(load,))
    run(world, 500)
    young = 4000.0 * (3.0 * 8000.0 + 2.0 * 4000.0) / (8000.0 + 4000.0)  # of the Lame parameters [Pa]
    pressed_m = nodes(alone)[:, 2].max() - nodes(world)[:, 2].max()
    assert pressed_m == pytest.approx(0.2 * 3.0 * 9.81 / (0.2**2 * young), rel=0.3)
    assert world.bodies["box"].base_pose().position[2] > 0.2, "it carries the box"


def test_forces_of_the_floor_carry_about_its_weight(build, tmp_path):
    world = build(block(tmp_path, load={"basePosition": [0, 0, 0.11]}, contacts={"hz": 250}))
    run(world, 500)
    samples = [sample for sample in run(world, 250) if isinstance(sample, ContactsSample)]
    assert {point.other_body for sample in samples for point in sample.points} == {"ground"}
    mean = np.mean([sample.force for sample in samples], axis=0)
    assert mean[2] == pytest.approx(MASS_KG * 9.81, rel=0.1)


@pytest.fixture
def resting(build, tmp_path):
    """A soft cube that has been at rest for longer than PyBullet leaves one awake, below a body that TF moves."""
    shape = {"shapeType": "GEOM_BOX", "halfExtents": [0.3, 0.3, 0.05]}
    press = {
        "name": "press",
        "createVisualShape": shape,
        "createCollisionShape": shape,
        "object_tf": {"tf_id": "press"},
    }
    world = build(
        block(tmp_path, load={"basePosition": [0, 0, 0.11], "NeoHookeanDamping": 0.5}, contacts={"hz": 250}),
        collision=(GROUND, press),
    )
    world.bodies["press"].set_base_pose(Pose((0.0, 0.0, 1.0)))
    run(world, 900)
    return world


def test_floor_still_carries_a_soft_body_at_rest(resting):
    samples = [sample for sample in run(resting, 50) if isinstance(sample, ContactsSample)]
    assert np.mean([sample.force[2] for sample in samples]) == pytest.approx(MASS_KG * 9.81, rel=0.1)


def test_resting_soft_body_yields_to_a_body_moved_by_tf(resting):
    height_m = nodes(resting)[:, 2].max()
    for tick in range(250):
        resting.bodies["press"].set_base_pose(Pose((0.0, 0.0, height_m + 0.05 - 0.0002 * tick)))
        resting.step()
    assert nodes(resting)[:, 2].max() == pytest.approx(height_m - 0.05, abs=0.01)


def test_surface_is_sampled_as_triangles_with_rate_and_colour(build, tmp_path):
    orange = [0.9, 0.5, 0.1, 1.0]
    world = build(block(tmp_path, surface_hz=25, changeVisualShape={"rgbaColor": orange}))
    surfaces = [sample for sample in run(world, 100) if isinstance(sample, SurfaceSample)]
    assert len(surfaces) == 10
    corners = np.array(surfaces[-1].corners)
    assert corners.shape == (3 * 108, 3), "6 sides of 3 x 3 squares of 2 triangles"
    assert corners.min(axis=0) == pytest.approx(nodes(world).min(axis=0), abs=1e-6)
    assert corners.max(axis=0) == pytest.approx(nodes(world).max(axis=0), abs=1e-6)
    assert surfaces[-1].rgba == pytest.approx(orange)


def test_cloth_from_an_obj_file_hangs_by_its_anchors(build):
    cloth = {
        "name": "cloth",
        "loadSoftBody": {
            "fileName": "cloth_z_up.obj",
            "basePosition": [0.0, 0.0, 1.0],
            "scale": 0.3,
            "mass": 0.2,
            "useMassSpring": True,
            "useBendingSprings": True,
            "springElasticStiffness": 100.0,
            "springDampingStiffness": 0.1,
            "collisionMargin": 0.02,
        },
        "createSoftBodyAnchor": [[0, -1], [1]],
    }
    world = build(cloth)
    before = nodes(world, "cloth")
    run(world, 300)
    after = nodes(world, "cloth")
    assert after[:2] == pytest.approx(before[:2], abs=1e-9)
    assert after[:, 2].min() < 0.8


def test_an_anchor_ties_a_corner_to_a_body_by_name(build, tmp_path):
    hanging = box("hook", (0.05, 0.05, 0.05), basePosition=[0.0, 0.0, 1.2], baseMass=50.0)
    world = build(
        block(tmp_path, createSoftBodyAnchor=[[63, "hook"], [62, "hook", -1, [0.0, 0.0, 0.0]]]),
        dynamic=(hanging,),
        setGravity={"gravZ": -1.0},
    )
    apart = nodes(world)[63] - world.bodies["hook"].base_pose().position
    run(world, 100)
    assert nodes(world)[63] - world.bodies["hook"].base_pose().position == pytest.approx(apart, abs=0.02)


def test_an_anchor_ties_a_corner_to_a_robots_link(build, tmp_path):
    anchor = [0, "iiwa", "lbr_iiwa_link_7"]
    at_hand = block(tmp_path, load={"basePosition": [0, 0, 1.45]}, createSoftBodyAnchor=[anchor])
    world = build(at_hand, robots=(iiwa(),))
    before = nodes(world)[0]
    run(world, 200)
    assert nodes(world)[0] == pytest.approx(before, abs=0.02)
    assert nodes(world)[:, 2].min() < 1.3, "the rest hangs down"


@pytest.mark.parametrize(
    ("written", "understood"),
    [
        ([3], (3, None, -1)),
        ([3, -1, -1], (3, None, -1)),
        ([3, "hook"], (3, "hook", -1)),
        ([3, "hook", "lid", [0, 0, 0]], (3, "hook", "lid")),
        ([7, 3, "hook", 2], (3, "hook", 2)),
        ([7, 3, -1, -1], (3, None, -1)),
        ([7, 3, -1, -1, [0, 0, 0]], (3, None, -1)),
    ],
)
def test_anchors_are_read_with_and_without_the_bodys_own_id(written, understood):
    anchor = CreateSoftBodyAnchor.model_validate(written)
    assert (anchor.node, anchor.body, anchor.link) == understood


@pytest.mark.parametrize(
    ("anchor", "told"),
    [
        ([64], "createSoftBodyAnchor[0]: expected a node from 0 to 63, got 64"),
        ([0, "nobody"], "[0]: expected the name of a rigid body that is there already, got 'nobody': ground"),
        ([0, "jelly"], "[0]: expected the name of a rigid body that is there already, got 'jelly': ground"),
        ([0, "ground", "lid"], "unknown link of ground 'lid'"),
        ([0, "ground", 1], "createSoftBodyAnchor[0]: 'ground' has 0 links in addition to the base, got 1"),
        ([0, 2], "expected the name of a body, or -1 for the world; got 2"),
        ([-1], "createSoftBodyAnchor[0]: must be >= 0, got -1"),
        ("0", "createSoftBodyAnchor[0]: expected a list"),
    ],
)
def test_a_wrong_anchor_is_named_and_leaves_nothing_behind(build, tmp_path, anchor, told):
    with pytest.raises(ConfigError) as caught:
        build(block(tmp_path, createSoftBodyAnchor=[anchor]))
    assert "jelly.yaml: " in str(caught.value)
    assert told in str(caught.value)


def test_soft_body_requires_a_deformable_world(build, tmp_path):
    with pytest.raises(ConfigError) as caught:
        build(block(tmp_path), resetSimulation={})
    assert str(caught.value) == (
        "jelly.yaml: soft bodies need resetSimulation: {flags: RESET_USE_DEFORMABLE_WORLD} in the main file"
    )


def test_a_failed_add_leaves_the_world_as_it_was(build, tmp_path):
    world = build(block(tmp_path))
    config = world.bodies["jelly"].config
    bad = CreateSoftBodyAnchor.model_validate([0, "nobody"])
    good = CreateSoftBodyAnchor.model_validate([0, "ground"])
    with pytest.raises(ConfigError):
        world.add("soft", config.model_copy(update={"name": "second", "createSoftBodyAnchor": (good, bad)}))
    assert world.pb.getNumBodies() == 2
    assert world.pb.getNumConstraints() == 0
    run(world, 10)


BROKEN = {
    "empty.vtk": ("", "it has no POINTS"),
    "cut.vtk": ("WHOLE", "it ends too early"),
    "index.vtk": ("WHOLE", "cell 0 is not a tetrahedron of the 64 points"),
    "nan.vtk": ("WHOLE", "point 0 is not three numbers"),
    "index.obj": ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "a face names corner 9 of 3"),
    "points.obj": ("v 0 0 0\nv 1 0 0\nv 0 1 0\n", "is empty"),
    "binary.obj": (b"\xff\xfe\x00", "is not text"),
    "mesh.stl": ("solid", "expected one of .obj, .vtk"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_mesh_is_refused_before_pybullet_crashes_on_it(build, tmp_path, name):
    text, told = BROKEN[name]
    if text == "WHOLE":
        text = open(write_block(tmp_path)).read()
        if name == "cut.vtk":
            text = text[: len(text) // 3]
        elif name == "index.vtk":
            text = text.replace("\n4 0 ", "\n4 999 ", 1)
        else:
            text = text.replace("-0.100000", "nan", 1)
    (tmp_path / name).write_bytes(text if isinstance(text, bytes) else text.encode())
    load = {"fileName": name, "useNeoHookean": False}
    with pytest.raises(ConfigError, match=r"^jelly.yaml: loadSoftBody.fileName: ") as caught:
        build(block(tmp_path, load=load))
    assert told in str(caught.value)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"loadSoftBody": None}, "loadSoftBody: missing; a soft body needs it, or loadURDF"),
        ({"loadURDF": {"fileName": "plane.urdf"}}, "loadURDF: does not go with loadSoftBody"),
        (
            {"loadSoftBody": None, "loadURDF": {"fileName": "plane.urdf"}},
            "plane.urdf: expected a <deformable> with a mesh; rigid objects belong to the list `urdfs`",
        ),
        ({"createSoftBodyAnchors": []}, "did you mean 'createSoftBodyAnchor'?"),
    ],
)
def test_faults_in_a_file_are_reported_by_key(build, tmp_path, change, told):
    with pytest.raises(ConfigError) as caught:
        build({**block(tmp_path), **change})
    assert told in str(caught.value)


@pytest.fixture
def deformable_urdf(tmp_path):
    write_block(tmp_path)
    path = tmp_path / "jelly.urdf"
    path.write_text(
        '<robot name="jelly"><deformable name="jelly"><inertial><mass value="2"/>'
        '<inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial>'
        '<collision_margin value="0.004"/><repulsion_stiffness value="800"/><friction value="0.5"/>'
        '<neohookean mu="4000" lambda="8000" damping="0.02"/><visual filename="block.vtk"/></deformable></robot>'
    )
    return {"name": "jelly", "loadURDF": {"fileName": str(path), "basePosition": [0.0, 0.0, 0.5]}}


def test_a_urdf_with_a_deformable_is_a_soft_body(build, deformable_urdf):
    world = build(deformable_urdf)
    run(world, 500)
    heights = nodes(world)[:, 2]
    assert heights.min() == pytest.approx(0.0, abs=0.01)
    assert 0.1 < heights.max() < 0.2


def test_a_urdf_with_a_deformable_is_no_urdf_object(build, deformable_urdf):
    with pytest.raises(ConfigError, match="soft bodies belong to the list `soft_objects`"):
        build(urdfs=(deformable_urdf,))


def test_bodies_that_are_tied_together_go_one_by_one(build, tmp_path):
    soft = block(tmp_path, createSoftBodyAnchor=[[63, "hook"], [0, -1]])
    world = build(soft, dynamic=(box("hook", basePosition=[0.0, 0.0, 1.3]),))
    run(world, 20)
    world.remove("hook")
    assert world.pb.getNumConstraints() == 1
    run(world, 50)
    world.remove("jelly")
    assert world.pb.getNumConstraints() == 0
    run(world, 50)
    assert list(world.bodies) == ["ground"]


def test_it_can_be_added_again_and_again(build, tmp_path):
    world = build(block(tmp_path))
    config = world.bodies["jelly"].config
    for _ in range(20):
        run(world, 5)
        world.remove("jelly")
        world.add("soft", config)
    run(world, 20)
    assert world.bodies["jelly"].base_pose().position[2] == pytest.approx(1.0, abs=0.05)


def test_a_reset_puts_it_back_with_its_anchors(build, tmp_path):
    soft = block(tmp_path, createSoftBodyAnchor=[[63, "hook"]])
    world = build(soft, dynamic=(box("hook", basePosition=[0.0, 0.0, 1.3]),))
    before = nodes(world)
    run(world, 100)
    for _ in range(3):
        world.reset()
        assert nodes(world) == pytest.approx(before)
        assert world.pb.getNumConstraints() == 1
        run(world, 50)
    assert world.state_hash()


def test_it_can_be_put_somewhere_at_rest(build, tmp_path):
    world = build(block(tmp_path), collision=())
    run(world, 30)
    world.bodies["jelly"].teleport(Pose((1.0, 2.0, 5.0)))
    run(world, 25)
    position = world.bodies["jelly"].base_pose().position
    assert position == pytest.approx((1.0, 2.0, 5.0 - 0.5 * 9.81 * 0.1**2), abs=0.01)


def test_unsupported_operations_on_a_soft_body_are_refused(build, tmp_path):
    world = build(block(tmp_path))
    with pytest.raises(PhysicsError, match="a soft body has no twist"):
        world.bodies["jelly"].base_twist()
    with pytest.raises((ValueError, UnknownNameError), match="soft"):
        world.change_dynamics("jelly", ChangeDynamics(mass=3.0))
    with pytest.raises((ValueError, UnknownNameError), match="soft"):
        world.dynamics("jelly")


@pytest.fixture(params=["EGL", "TinyRenderer"])
def rendering(request, tmp_path):
    red = block(tmp_path, changeVisualShape={"rgbaColor": [0.9, 0.1, 0.1, 1.0]})
    path = write_world(
        tmp_path,
        collision=(GROUND,),
        dynamic=(box("crate", basePosition=[0.4, 0.0, 0.1]),),
        robots=(iiwa(loadURDF={**iiwa()["loadURDF"], "basePosition": [-0.5, 0, 0]}),),
        soft=(red,),
        timeStep=TICK_S,
        **DEFORMABLE,
    )
    rendering = Rendering(tmp_path, World.from_file(path), use_egl=request.param == "EGL")
    rendering.demand("colour", "depth", "segmentation")
    yield rendering
    rendering.close()


def test_cameras_see_it_where_it_is_and_nothing_else_moves(rendering):
    world = rendering.world
    down = Pose((0.0, 0.0, 3.0), pybullet.getQuaternionFromEuler([np.pi, 0.0, 0.0]))
    others = [world.bodies[name].body_id for name in ("crate", "iiwa")]
    jelly = world.bodies["jelly"].body_id
    arm = world.bodies["iiwa"].body_id
    for joint in range(7):
        world.pb.resetJointState(arm, joint, 0.3)
    first = rendering.look(down)
    nearest = first["depth"][first["segmentation"] == jelly].min()
    assert nearest == pytest.approx(3.0 - nodes(world)[:, 2].max(), abs=0.01)
    for _ in range(300):
        world.pb.stepSimulation()
    for joint in range(7):
        world.pb.resetJointState(arm, joint, 0.3)
    world.bodies["crate"].teleport(Pose((0.4, 0.0, 0.1)))
    for _ in range(3):
        last = rendering.look(down)
    depth = last["depth"][last["segmentation"] == jelly]
    assert depth.min() == pytest.approx(3.0 - nodes(world)[:, 2].max(), abs=0.01)
    assert depth.min() > nearest + 0.5
    for body in others:
        before, after = first["segmentation"] == body, last["segmentation"] == body
        assert np.count_nonzero(before & after) > 0.97 * np.count_nonzero(before | after) > 0
    world.remove("jelly")
    gone = rendering.look(down)
    assert np.isin(gone["segmentation"][last["segmentation"] == jelly], (world.bodies["ground"].body_id, *others)).all()


def test_pybullet_takes_every_key_with_a_value_of_its_type(tmp_path):
    """In a process of its own, since odd values may end it."""
    values = {
        "fileName": write_block(tmp_path),
        "simFileName": write_block(tmp_path),
        "basePosition": [0, 0, 1],
        "baseOrientation": [0, 0, 0, 1],
    }
    for key, schema in json_schema(LoadSoftBody, "soft body")["properties"].items():
        assert schema["description"].endswith(".")
        values.setdefault(key, True if "boolean" in types_in(schema) else 0.5)
    arguments = LoadSoftBody.parse(values, "f").kwargs()
    assert set(arguments) == set(LoadSoftBody.model_fields)
    code = (
        "import pybullet as p; p.connect(p.DIRECT); p.resetSimulation(flags=p.RESET_USE_DEFORMABLE_WORLD); "
        f"assert p.loadSoftBody(**{arguments!r}) == 0"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)
