"""Moments of inertia are the URDF's, of any size, and where it has none PyBullet guesses them."""

from __future__ import annotations

import numpy as np
import pybullet_data
import pytest
from worlds import iiwa, write_world

from custom_ros_tools.errors import ConfigError
from robot_model.urdf.document import UrdfDocument
from robot_model.urdf.for_pybullet import frame_masses
from rpbi.control.joint_command import JointCommand
from rpbi.samples import JointStateSample, LinkPoseSample, WrenchSample
from rpbi.world import World
from rpbi.world.world_warnings import world_warnings

DT_S = 0.001
BOX = '<collision><geometry><box size="0.1 0.2 0.3"/></geometry></collision>'
BOX_MOMENTS = ((0.2**2 + 0.3**2) / 12, (0.1**2 + 0.3**2) / 12, (0.1**2 + 0.2**2) / 12)  # of 1 kg [kg m^2]


@pytest.fixture
def build(tmp_path):
    worlds = []

    def build_world(**parts) -> World:
        worlds.append(World.from_file(write_world(tmp_path, timeStep=DT_S, **parts)))
        return worlds[-1]

    yield build_world
    for world in worlds:
        world.close()


def swinging(inertia):
    """Returns a URDF of a lump that swings on a hinge."""
    return f"""<robot name="bell"><link name="frame"/><link name="lump">{inertia}{BOX}</link>
    <joint name="hinge" type="revolute"><parent link="frame"/><child link="lump"/><axis xyz="1 0 0"/>
    <limit lower="-3" upper="3" effort="100" velocity="100"/></joint></robot>"""


def inertial(ixx, iyy, izz, mass=1.0):
    tensor = f'<inertia ixx="{ixx}" iyy="{iyy}" izz="{izz}" ixy="0" ixz="0" iyz="0"/>'
    return f'<inertial><mass value="{mass}"/>{tensor}</inertial>'


@pytest.fixture
def moments_of(build, tmp_path):
    """Returns the lump's principal moments of inertia, less what it weighs."""

    def load(inertia, scaling=1.0, **more):
        file = tmp_path / f"bell{len(list(tmp_path.iterdir()))}.urdf"  # PyBullet caches files by name
        file.write_text(swinging(inertia))
        load_urdf = {"fileName": str(file), "useFixedBase": True, "globalScaling": scaling}
        world = build(urdfs=({"name": "bell", "loadURDF": load_urdf, **more},))
        return world.pb.getDynamicsInfo(world.bodies["bell"].body_id, 0)[2]

    return load


def test_efforts_of_a_moving_arm_are_those_of_its_urdf(build):
    pinocchio = pytest.importorskip("pinocchio", reason="needs ./rpbi setup ik")
    arm = iiwa(setJointMotorControlArray={"controlMode": "TORQUE_CONTROL"}, joint_state_publisher_hz=1 / DT_S)
    world = build(robots=(arm,))
    body = world.bodies["iiwa"]
    for link in body.link_indices:
        world.pb.changeDynamics(body.body_id, link, linearDamping=0.0, angularDamping=0.0, jointDamping=0.0)
    model = pinocchio.buildModelFromUrdf(body.config.loadURDF.fileName)
    random = np.random.default_rng(1)
    names = [joint.name for joint in body.model.driven]
    for _ in range(20):
        q, dq, tau = (random.uniform(-1.0, 1.0, 7) * size for size in (1.5, 2.0, 30.0))
        body.set_joint_state(JointCommand(names, q.tolist(), dq.tolist()))
        world.put("iiwa/target", JointCommand(names, effort=tau.tolist()))
        sample = next(sample for sample in world.step() if isinstance(sample, JointStateSample))
        ddq = (np.array(sample.velocity) - dq) / DT_S
        expected = pinocchio.rnea(model, model.createData(), q, dq, ddq)
        assert np.linalg.norm(tau - expected) < 0.01 * np.linalg.norm(expected)


def test_pybullet_guesses_inertia_that_the_urdf_does_not_give(moments_of):
    assert moments_of("") == pytest.approx(BOX_MOMENTS)


@pytest.mark.parametrize("impossible", [inertial(0, 0, 0), inertial(0.1, 0.2, 0.9), inertial(-0.1, 0.2, 0.25)])
def test_impossible_inertia_is_guessed_and_reported(moments_of, caplog, impossible):
    assert moments_of(impossible) == pytest.approx(BOX_MOMENTS)
    assert "bell: moments of inertia of lump are impossible: guessed from the shape" in caplog.messages


def own_messages(caplog):
    """Returns messages but for those that PyBullet prints."""
    return [record.getMessage() for record in caplog.records if record.name != "pybullet"]


def test_they_grow_with_the_lengths(moments_of, caplog):
    assert moments_of(inertial(0.01, 0.02, 0.025), scaling=2.0) == pytest.approx((0.04, 0.08, 0.1))
    assert not own_messages(caplog)


def test_placeholder_inertia_is_reported_with_the_key_that_guesses(moments_of, caplog):
    assert moments_of(inertial(1, 1, 1)) == pytest.approx((1.0, 1.0, 1.0))
    assert own_messages(caplog) == [
        "bell: moments of inertia of lump are far too large for their size; inertia_from_urdf: false guesses them"
    ]


def test_a_key_has_pybullet_guess_all(moments_of, caplog):
    assert moments_of(inertial(1, 1, 1), inertia_from_urdf=False) == pytest.approx(BOX_MOMENTS)
    assert not own_messages(caplog)


def test_non_finite_inertia_is_refused(moments_of):
    with pytest.raises(ConfigError, match="link 'lump': inertia.ixx: expected finite numbers, got 'nan'"):
        moments_of(inertial("nan", 0.02, 0.025))


def test_urdf_readable_only_by_pybullet_keeps_its_inertia(moments_of):
    prefixed = inertial(0.01, 0.02, 0.025) + "<sensor:camera/>"
    assert moments_of(prefixed) == pytest.approx((0.01, 0.02, 0.025))


def test_flags_of_the_user_stay(build, tmp_path):
    (tmp_path / "bell.urdf").write_text(swinging(inertial(0.01, 0.02, 0.025)))
    flags = {"fileName": str(tmp_path / "bell.urdf"), "flags": "URDF_IGNORE_COLLISION_SHAPES"}
    world = build(urdfs=({"name": "bell", "loadURDF": flags},))
    body_id = world.bodies["bell"].body_id
    assert world.pb.getDynamicsInfo(body_id, 0)[2] == pytest.approx((0.01, 0.02, 0.025))
    assert not world.pb.getCollisionShapeData(body_id, 0)


FRAME = (
    '<link name="{name}"/><joint name="to_{name}" type="fixed"><parent link="{parent}"/><child link="{name}"/></joint>'
)
"""A link that is a mere frame."""


def with_frames(urdf, *parents):
    """Returns a URDF with a mere frame on each of these links."""
    frames = [FRAME.format(name=f"frame{number}", parent=parent) for number, parent in enumerate(parents)]
    return urdf.replace("</robot>", "".join(frames) + "</robot>")


WRIST = f"""<robot name="arm"><link name="base"/><link name="tool">{inertial(1e-3, 1e-3, 1e-3, 0.5)}{BOX}</link>
<joint name="wrist" type="fixed"><parent link="base"/><child link="tool"/><origin xyz="0 0 1"/></joint></robot>"""


def test_a_frame_at_a_tool_weighs_nothing(build, tmp_path):
    (tmp_path / "arm.urdf").write_text(with_frames(WRIST, "tool", "frame0"))
    sensors = {
        "enabled_joint_force_torque_sensors": [{"joint": "wrist", "hz": 1 / DT_S}],
        "broadcast_link_states": True,
    }
    arm = iiwa("arm", loadURDF={"fileName": str(tmp_path / "arm.urdf"), "useFixedBase": True}, **sensors)
    world = build(robots=(arm,), setGravity={"gravZ": -9.81})
    samples = [*world.step(), *world.read_rest()]
    (wrench,) = [sample for sample in samples if isinstance(sample, WrenchSample)]
    assert wrench.force == pytest.approx((0.0, 0.0, 0.5 * 9.81), abs=1e-6)
    (links,) = [sample for sample in samples if isinstance(sample, LinkPoseSample)]
    assert {frame.rpartition("/")[2] for frame in links.frames} >= {"tool", "frame0", "frame1"}, "they stay"
    assert world_warnings(world) == []


@pytest.mark.parametrize("is_fixed", [True, False])
def test_massless_frames_do_not_change_the_motion(build, tmp_path, is_fixed):
    """A bell on a hinge, or thrown with its hinge, the root of which is a frame then."""
    bell = swinging(inertial(0.3, 0.2, 0.1, mass=2.0).replace("<mass", '<origin xyz="0 0.1 -0.2"/><mass'))
    if not is_fixed:
        bell = bell.replace('<link name="frame"/>', f'<link name="frame">{inertial(0.1, 0.1, 0.1)}{BOX}</link>')
    framed = with_frames(bell, "lump", "frame", "frame0")
    if not is_fixed:
        foot = FRAME.format(name="foot", parent="").replace(
            'parent link=""/><child link="foot"', 'parent link="foot"/><child link="frame"'
        )
        framed = framed.replace("</robot>", f"{foot}</robot>")
    objects = []
    for name, text in (("bare", bell), ("framed", framed)):
        (tmp_path / f"{name}.urdf").write_text(text)
        load = {"fileName": str(tmp_path / f"{name}.urdf"), "useFixedBase": is_fixed, "basePosition": [0, 0, 1]}
        start = (
            {}
            if is_fixed
            else {"resetBaseVelocity": {"linearVelocity": [1.0, 0.0, 2.0], "angularVelocity": [1.0, 2.0, 3.0]}}
        )
        objects.append({"name": name, "loadURDF": load, **start})
    moves = []
    for each in objects:
        world = build(urdfs=(each,), setGravity={"gravY": -4.0, "gravZ": -9.81})
        body = world.bodies[each["name"]]
        for _ in range(300):
            world.step()
        hinge = next(i for i in body.joint_indices if world.pb.getJointInfo(body.body_id, i)[1] == b"hinge")
        moves.append((*body.base_pose().position, *world.pb.getJointState(body.body_id, hinge)[:2]))
    assert moves[1] == pytest.approx(moves[0], rel=1e-4, abs=1e-6)
    assert abs(moves[0][3]) > 0.05, "it swings"


def test_movable_links_without_mass_are_reported(build, tmp_path):
    (tmp_path / "bell.urdf").write_text(with_frames(swinging(""), "lump"))
    load = {"fileName": str(tmp_path / "bell.urdf")}
    fixed = build(urdfs=({"name": "bell", "loadURDF": {**load, "useFixedBase": True}},), setGravity={"gravZ": -9.81})
    (told,) = world_warnings(fixed)
    assert (told.key, told.message) == (
        "loadURDF.fileName",
        "without <inertial>, PyBullet gives 1 kg to each of these links: lump",
    )
    free = build(urdfs=({"name": "bell", "loadURDF": load},), setGravity={"gravZ": -9.81})
    assert world_warnings(free)[0].message.endswith(": frame, lump"), "nothing is fixed to its root"


def test_a_urdf_without_frames_is_loaded_as_it_is():
    for file in ("kuka_iiwa/model.urdf", "franka_panda/panda.urdf", "r2d2.urdf", "humanoid/humanoid.urdf"):
        document = UrdfDocument(f"{pybullet_data.getDataPath()}/{file}")
        assert frame_masses(document, is_fixed=True) == {}


def test_a_root_that_is_called_world_stays_fixed(build):
    load = {"fileName": f"{pybullet_data.getDataPath()}/xarm/xarm6_robot.urdf"}
    world = build(urdfs=({"name": "arm", "loadURDF": load},), setGravity={"gravZ": -9.81})
    for _ in range(10):
        world.step()
    assert world.bodies["arm"].base_pose().position == (0.0, 0.0, 0.0)
