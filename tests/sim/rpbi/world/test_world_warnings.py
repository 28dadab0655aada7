"""What is probably not meant in a world is told, and nothing else."""

from __future__ import annotations

import re
from pathlib import Path

import pybullet
import pytest
from worlds import BOX_FLOOR, FLOOR, ball, box, iiwa, write_world

from rpbi.world import World
from rpbi.world.world_warnings import world_warnings

ROOT = Path(__file__).resolve().parents[4]
SHIPPED = [
    path
    for path in sorted(ROOT.glob("src/*/configs/**/*.yaml"))
    if "\ntimeStep:" in path.read_text() and path.parent.name != "pushes"
]
"""All main files, except those whose robot comes with the data of an experiment."""

GRAVITY = {"setGravity": {"gravZ": -9.81}}
PIN = """<robot name="pin"><link name="base"/>
<link name="rod"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="slide" type="prismatic"><parent link="base"/><child link="rod"/><axis xyz="0 0 1"/>
<limit lower="0.1" upper="0.2" effort="1" velocity="1"/></joint></robot>"""


@pytest.fixture
def warnings_of(tmp_path):
    """Returns the warnings of a world."""

    def build(**parts) -> list[str]:
        world = World.from_file(write_world(tmp_path, **parts), connection_mode=pybullet.DIRECT)
        try:
            return [str(warning).replace(f"{tmp_path}/", "") for warning in world_warnings(world)]
        finally:
            world.close()

    return build


def follower(name, tf_id, **more):
    table = {key: value for key, value in box(name, **more).items() if key != "baseMass"}
    return {**table, "object_tf": {"tf_id": tf_id}}


def test_a_sound_world_has_none(warnings_of):
    resting = box(basePosition=[1.0, 0.0, 0.1])  # on the floor
    assert warnings_of(collision=(BOX_FLOOR,), dynamic=(resting,), robots=(iiwa(),)) == []


def test_missing_gravity_is_reported_if_bodies_could_fall(tmp_path, warnings_of):
    weightless = {"name": "free", "loadURDF": {"fileName": "cube_small.urdf", "basePosition": [0, 0, 1]}}
    path = write_world(tmp_path, dynamic=(ball(),), urdfs=(weightless,), robots=(iiwa(),), collision=(BOX_FLOOR,))
    text = (tmp_path / "world.yaml").read_text().replace("setGravity:\n  gravZ: -9.81\n", "")
    (tmp_path / "world.yaml").write_text(text)
    world = World.from_file(path)
    [told] = [str(each) for each in world_warnings(world) if each.key == "setGravity"]
    world.close()
    assert "no gravity, and ball, free will not fall" in told
    assert not [each for each in warnings_of(dynamic=(ball(),), setGravity={"gravZ": 0.0}) if "gravity" in each]
    assert warnings_of(robots=(iiwa(),), collision=(BOX_FLOOR,), setGravity={}) == []


def test_overlapping_bodies_are_reported_with_their_depth(warnings_of):
    low = box("low", basePosition=[1.0, 0.0, 0.06])
    other = box("other", basePosition=[1.18, 0.0, 0.1])
    told = warnings_of(collision=(BOX_FLOOR,), dynamic=(low, other), robots=(iiwa(),))
    assert told == [
        "floor.yaml: at the start, 'floor' and 'low' overlap by 0.04 m, and will be pushed apart",
        "low.yaml: at the start, 'low' and 'other' overlap by 0.02 m, and will be pushed apart",
    ]


def test_overlapping_robot_link_is_named_unless_both_are_fixed(warnings_of):
    plinth = {**follower("plinth", "x"), "basePosition": [0.0, 0.0, -0.05]}  # the foot of the arm is in it
    del plinth["object_tf"]
    hit = ball("hit", radius_m=0.05, basePosition=[0.0, 0.0, 1.2])
    told = warnings_of(collision=(plinth,), dynamic=(hit,), robots=(iiwa(),))
    assert len(told) == 1 and "'hit' and 'iiwa/lbr_iiwa_link_" in told[0]


def test_bodies_that_follow_a_configured_frame_are_checked_there(warnings_of):
    table = follower("table", "rpbi/table")
    thing = box("thing", basePosition=[3.0, 0.0, 0.15])
    poses = [{"tf_id": "rpbi/table", "position": [3.0, 0.0, 0.0]}]
    told = warnings_of(collision=(table,), dynamic=(thing,), poses=poses)
    assert told == ["table.yaml: at the start, 'table' and 'thing' overlap by 0.05 m, and will be pushed apart"]
    at_origin = box("thing", basePosition=[0.0, 0.0, 0.15])
    assert warnings_of(collision=(table,), dynamic=(at_origin,), poses=poses) == []


def test_unpublished_frames_are_reported_with_their_followers_and_a_remedy(warnings_of):
    lone, near = follower("lone", "bench"), follower("near", "rpbi/tabel", basePosition=[9.0, 0.0, 0.0])
    held, kept = follower("held", "rpbi/iiwa/lbr_iiwa_link_7"), follower("kept", "rpbi/ball")
    camera = {"name": "eye", "object_tf": {"tf_id": "rpbi/iiwa/lbr_iiwa_link_9"}}
    parts = {"collision": (lone, near, held, kept), "poses": [{"tf_id": "rpbi/table"}, {"tf_id": "p", "parent": "q"}]}
    told = warnings_of(**parts, dynamic=(ball(basePosition=[5, 5, 5]),), robots=(iiwa(),), rgbd_sensor=camera)
    nothing = "nothing here publishes the TF frame"
    assert told == [
        f"world.yaml: poses[1].parent: {nothing} 'q'; say where it is under `poses`, or have another node publish it",
        f"lone.yaml: object_tf.tf_id: 'lone' follows it: {nothing} 'bench'; say where it is under `poses`, or have "
        "another node publish it",
        f"near.yaml: object_tf.tf_id: 'near' follows it: {nothing} 'rpbi/tabel'; did you mean 'rpbi/table'?; say where "
        "it is under `poses`, or have another node publish it",
        f"held.yaml: object_tf.tf_id: 'held' follows it: {nothing} 'rpbi/iiwa/lbr_iiwa_link_7'; 'iiwa' does with "
        "broadcast_link_states: true",
        f"kept.yaml: object_tf.tf_id: 'kept' follows it: {nothing} 'rpbi/ball'; 'ball' does with broadcast_hz",
        f"world.yaml: object_tf.tf_id: 'eye' follows it: {nothing} 'rpbi/iiwa/lbr_iiwa_link_9'; 'iiwa' does with "
        "broadcast_link_states: true",
    ]
    told = warnings_of(
        **parts,
        dynamic=(ball(basePosition=[5, 5, 5], broadcast_hz=10.0),),
        robots=(iiwa(broadcast_link_states=True),),
        rgbd_sensor=camera,
    )
    assert [warning.split(":")[0] for warning in told] == ["world.yaml", "lone.yaml", "near.yaml", "world.yaml"]
    assert "'rpbi/iiwa/lbr_iiwa_link_9'; did you mean 'rpbi/iiwa/lbr_iiwa_link_" in told[-1]
    twice = warnings_of(dynamic=(ball(broadcast_hz=10.0),), poses=[{"tf_id": "rpbi/ball"}])
    assert twice == ["world.yaml: poses[0].tf_id: 'ball' publishes 'rpbi/ball' too"]


def test_links_published_by_robot_state_publisher_count_as_present(warnings_of):
    held = follower("held", "rpbi/iiwa/lbr_iiwa_link_7")
    assert warnings_of(collision=(held,), robots=(iiwa(broadcast_root_tf_hz=10.0),)) == []


@pytest.mark.parametrize("kind", ["robots", "urdfs"])
def test_joints_that_start_beyond_limits_are_reported(tmp_path, warnings_of, kind):
    (tmp_path / "pin.urdf").write_text(PIN)
    pin = {"name": "pin", "loadURDF": {"fileName": "pin.urdf", "useFixedBase": True}}
    if kind == "robots":
        pin["setJointMotorControlArray"] = {"controlMode": "POSITION_CONTROL"}
    [told] = warnings_of(**{kind: (pin,)})
    assert told.endswith("at the start, joint 'slide' must be within 0.1 to 0.2 m, got 0")
    if kind == "robots":
        assert warnings_of(robots=({**pin, "initial_joint_position": {"slide": 0.15}},)) == []


def test_robot_that_waits_for_another_is_reported(warnings_of):
    [told] = warnings_of(robots=(iiwa(initial_joint_state_topic="real/joint_states"),))
    assert (
        told == "iiwa.yaml: initial_joint_state_topic: the world only starts if joint states come on real/joint_states"
    )


PLANE = "floor.yaml: createCollisionShape.shapeType: "
ADVICE = "use a box, such as {shapeType: GEOM_BOX, halfExtents: [50, 50, 0.5], collisionFramePosition: [0, 0, -0.5]}"


@pytest.mark.parametrize("height_m", [0.1, 0.1001, 3.0])
def test_body_resting_on_a_plane_is_reported_with_the_remedy(warnings_of, height_m):
    thing = box(basePosition=[1.0, 0.0, height_m])
    [told] = warnings_of(collision=(FLOOR,), dynamic=(thing,), robots=(iiwa(),))
    assert told.startswith(f"{PLANE}'box' rests on this plane: planes lose contact points") and told.endswith(ADVICE)
    assert warnings_of(collision=(BOX_FLOOR,), dynamic=(thing,), robots=(iiwa(),)) == []


def test_several_bodies_on_a_plane_give_one_warning(warnings_of):
    boxes = tuple(box(f"box_{index}", basePosition=[0.5 * index, 0.0, 0.1]) for index in range(4))
    cube = {"name": "cube", "loadURDF": {"fileName": "cube_small.urdf", "basePosition": [0, 3, 0.5]}}
    [told] = warnings_of(collision=(FLOOR,), dynamic=boxes, urdfs=(cube,))
    assert told.startswith(f"{PLANE}'box_0', 'box_1', 'box_2' and 2 more rest on this plane: ")
    plane = {"name": "plane", "loadURDF": {"fileName": "plane_implicit.urdf"}}
    [told] = warnings_of(dynamic=boxes[:1], urdfs=(plane,))
    assert told.startswith("plane.yaml: loadURDF.fileName: 'box_0' rests on this plane: ")


def test_bodies_without_plane_problems_are_not_reported(warnings_of):
    table = follower("table", "rpbi/table")
    poses = [{"tf_id": "rpbi/table", "position": [3.0, 0.0, 0.1]}]
    upon = box("upon", basePosition=[3.0, 0.0, 0.3])
    balls = ball(basePosition=[1.0, 0.0, 0.1])
    assert warnings_of(collision=(FLOOR, table), dynamic=(upon, balls), poses=poses) == []
    wall = {**FLOOR, "createCollisionShape": {"shapeType": "GEOM_PLANE", "planeNormal": [1.0, 0.0, 0.0]}}
    assert warnings_of(collision=(wall,), dynamic=(box(basePosition=[0.1, 0.0, 0.0]),)) == []
    free = {"setGravity": {"gravZ": 0.0}}
    assert warnings_of(collision=(FLOOR,), dynamic=(box(basePosition=[0.0, 0.0, 0.1]),), **free) == []


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: str(path.relative_to(ROOT / "src")))
def test_shipped_worlds_warn_only_of_frames_of_other_nodes(path):
    world = World.from_file(str(path), connection_mode=pybullet.DIRECT)
    found = [str(warning) for warning in world_warnings(world) if "follows it" not in warning.message]
    world.close()
    assert found == []


def test_no_page_and_no_template_shows_a_plane_to_copy():
    texts = {path: path.read_text() for path in ROOT.glob("docs/templates/**/*.yaml")}
    texts |= {
        path: "".join(re.findall("```yaml.*?```", path.read_text(), re.DOTALL)) for path in ROOT.glob("docs/*.md")
    }
    assert len(texts) > 40
    assert [path.name for path, text in texts.items() if "GEOM_PLANE" in text] == []


def test_bodies_in_maximal_coordinates_are_checked_without_pybullets_shapes(warnings_of):
    cube = {"name": "cube", "loadURDF": {"fileName": "cube_small.urdf", "useMaximalCoordinates": True}}
    found = warnings_of(
        collision=(FLOOR,), urdfs=({**cube, "loadURDF": {**cube["loadURDF"], "basePosition": [0, 0, 1]}},)
    )
    assert any("cube" in each for each in found)


def told(warnings: list[str], part: str) -> list[str]:
    return [each for each in warnings if part in each]


def test_gravity_upwards_and_positions_in_millimetres(warnings_of):
    far = box("far", basePosition=[500.0, 0.0, 300.0])
    arm = iiwa(loadURDF={"fileName": "kuka_iiwa/model.urdf", "useFixedBase": True, "basePosition": [0, 150.0, 0]})
    poses = [{"tf_id": "bench", "position": [0.0, 0.0, 750.0]}]
    assert warnings_of(dynamic=(far,), robots=(arm,), poses=poses, setGravity={"gravZ": 9.81}) == [
        "world.yaml: poses[0].position: is 750 m from the origin: positions are in metres",
        "far.yaml: basePosition: is 583.1 m from the origin: positions are in metres",
        "iiwa.yaml: loadURDF.basePosition: is 150 m from the origin: positions are in metres",
        "world.yaml: setGravity.gravZ: 9.81 m/s^2 points upwards, so that bodies rise; on Earth it is -9.81",
    ]


@pytest.mark.parametrize("shape", [{"shapeType": "GEOM_SPHERE", "radius": 0.1}, {"shapeType": "GEOM_CAPSULE"}])
def test_round_bodies_without_rolling_friction_on_level_ground_are_reported(warnings_of, shape):
    def round_body(**dynamics):
        return ball(basePosition=[0.0, 0.0, 2.0], createCollisionShape=shape, changeDynamics=dynamics)

    (only,) = warnings_of(collision=(BOX_FLOOR,), dynamic=(round_body(lateralFriction=0.5),))
    assert only.startswith("ball.yaml: changeDynamics.rollingFriction: 'ball' rolls on 'floor' without end")
    assert warnings_of(collision=(BOX_FLOOR,), dynamic=(round_body(rollingFriction=0.001),)) == []
    assert warnings_of(collision=(BOX_FLOOR,), dynamic=(round_body(rollingFriction=0.0),)) == []
    sloped = {**BOX_FLOOR, "baseOrientation": [0.1, 0.0, 0.0, 0.995]}
    assert warnings_of(collision=(sloped,), dynamic=(round_body(lateralFriction=0.5),)) == []


INERTIA = "<inertia ixx='1' iyy='1' izz='1'/>"


def chain(*joints: str, root_kg: float = 1.0, effort: float = 1.0, upper: float = 1.0) -> str:
    """Returns a URDF of links of 1 kg on joints of these types, one after the other."""
    links = [f"<link name='l0'><inertial><mass value='{root_kg}'/>{INERTIA}</inertial></link>"]
    for index, kind in enumerate(joints):
        links.append(
            f"<link name='l{index + 1}'><inertial><mass value='1'/>{INERTIA}</inertial></link>"
            f"<joint name='j{index}' type='{kind}'><parent link='l{index}'/><child link='l{index + 1}'/>"
            f"<limit lower='-1' upper='{upper}' effort='{effort}' velocity='1'/></joint>"
        )
    return f"<robot name='chain'>{''.join(links)}</robot>"


def test_an_arm_that_is_not_fixed(tmp_path, warnings_of):
    def warnings_about(urdf, **load):
        (tmp_path / "arm.urdf").write_text(urdf)
        arm = iiwa("arm", loadURDF={"fileName": "arm.urdf", "basePosition": [0, 0, 1], **load})
        return told(warnings_of(collision=(BOX_FLOOR,), robots=(arm,)), "useFixedBase")

    arm = chain(*["revolute"] * 4)
    (only,) = warnings_about(arm)
    assert only.startswith("arm.yaml: loadURDF.useFixedBase: missing, so this arm is not fixed and will fall over")
    assert warnings_about(arm, useFixedBase=True) == warnings_about(arm, useFixedBase=False) == []
    assert warnings_about(chain(*["revolute"] * 4, root_kg=0.0)) == [], "PyBullet fixes it"
    assert warnings_about(chain("revolute", "revolute")) == [], "no arm"
    legged = iiwa("legged", loadURDF={"fileName": "quadruped/quadruped.urdf", "basePosition": [0, 0, 1]})
    assert told(warnings_of(robots=(legged,)), "useFixedBase") == []


def test_motors_of_effort_0_and_links_of_mass_0(tmp_path, warnings_of):
    (tmp_path / "arm.urdf").write_text(chain("revolute", "continuous", effort=0.0))
    arm = iiwa("arm", loadURDF={"fileName": "arm.urdf", "useFixedBase": True})
    (only,) = warnings_of(robots=(arm,))
    assert "effort 0 in the URDF, for 'j0', 'j1', means no limit" in only
    assert warnings_of(robots=({**arm, "enforce_effort_limits": False},)) == []
    light = chain("revolute", "fixed", "revolute").replace(
        "<link name='l3'><inertial><mass value='1'/>", "<link name='l3'><inertial><mass value='0'/>"
    )
    (tmp_path / "arm.urdf").write_text(light)
    assert warnings_of(robots=(arm,)) == [
        "arm.yaml: loadURDF.fileName: all links that these joints move have mass 0: 'j2'"
    ]
    lump = "<collision><geometry><box size='0.1 0.1 0.1'/></geometry></collision></link>"
    (tmp_path / "lump.urdf").write_text(chain(root_kg=0.0).replace("</link>", lump))
    load = {"fileName": "lump.urdf", "basePosition": [0, 0, 1]}
    (only,) = warnings_of(collision=(BOX_FLOOR,), urdfs=({"name": "lump", "loadURDF": load},))
    assert "'lump' has mass 0, so it stays 0.95 m above what is below it" in only
    for meant in ({"useFixedBase": True}, {"basePosition": [0, 0, 0.05]}):
        assert warnings_of(collision=(BOX_FLOOR,), urdfs=({"name": "lump", "loadURDF": {**load, **meant}},)) == []


@pytest.mark.parametrize(
    ("degrees", "angles", "part"),
    [
        (True, [1.5708, 0.0, -0.7854], "look like radians"),
        (True, [0.3, -0.41, 0.77], "look like radians"),
        (True, [2.0, 0.5, -1.0], ""),
        (True, [90.0, 1.57, -45.0], ""),
        (False, [0.0, 0.0, 0.0], ""),
        (False, [1.57, 3.0, 6.28], ""),
        (False, [90.0, 0.0, 0.0], "look like degrees"),
    ],
)
def test_start_positions_in_the_other_unit(tmp_path, warnings_of, degrees, angles, part):
    (tmp_path / "arm.urdf").write_text(chain(*["continuous"] * 3, upper=-2.0))
    start = {f"j{index}": angle for index, angle in enumerate(angles)}
    more = {"initial_joint_position": start, "initial_revolute_joint_positions_are_deg": degrees}
    arm = iiwa("arm", loadURDF={"fileName": "arm.urdf", "useFixedBase": True}, **more)
    found = warnings_of(robots=(arm,))
    assert len(found) == bool(part) and all(part in each for each in found)


def test_other_angles_in_the_wrong_unit(tmp_path, warnings_of):
    turned = chain("revolute", upper=180.0).replace("<limit", "<origin rpy='0 0 90'/><limit")
    (tmp_path / "arm.urdf").write_text(turned)
    arm = iiwa("arm", loadURDF={"fileName": "arm.urdf", "useFixedBase": True})
    poses = [{"tf_id": "eye", "rpy": [0.0, 0.0, 90.0]}]
    camera = {"name": "eye", "object_tf": {"tf_id": "eye"}, "intrinsics": {"fov": 1.05}}
    assert warnings_of(robots=(arm,), poses=poses, rgbd_sensor=camera) == [
        "world.yaml: poses[0].rpy: [0.0, 0.0, 90.0] looks like degrees: expected [rad]",
        "world.yaml: rgbd_sensor.intrinsics.fov: 1.05 looks like radians: expected [deg]",
        "arm.yaml: loadURDF.fileName: joint 'j0': origin.rpy: '0 0 90' looks like degrees: expected [rad]",
        "arm.yaml: loadURDF.fileName: joint 'j0': its limit of -1 to 180 looks like degrees: expected [rad]",
    ]
