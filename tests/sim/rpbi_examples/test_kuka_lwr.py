"""The KUKA LWR4+ description: kinematics, limits, masses and pictures are as published and load cleanly."""

from __future__ import annotations

import copy
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pybullet
import pytest
from pybullet_utils.bullet_client import BulletClient

ROBOTS = Path(__file__).resolve().parents[3] / "src" / "rpbi_examples" / "robots"
MESHES = ROBOTS / "kuka_lwr"
TOOLS = ROBOTS.parents[2] / "dev/tools/kuka_lwr"
URDF = ElementTree.parse(ROBOTS / "kuka_lwr.urdf")
HOME_DEG = (0, 30, 0, -90, 0, 60, 0)
ARM_LINKS = [f"lwr_arm_{i}_link" for i in range(8)]
TOOL_LINKS = [
    "adaptor_kuka",
    "force_torque_sensor",
    "end_effector",
    "end_effector_sponge",
    "end_effector_ball",
]


class Kuka:
    """The arm alone in a PyBullet client, fixed at the origin."""

    def __init__(self, pb: Any, file: Path, flags: int = 0) -> None:
        self.pb = pb
        self.body = pb.loadURDF(str(file), useFixedBase=True, flags=flags)
        infos = [pb.getJointInfo(self.body, i) for i in range(pb.getNumJoints(self.body))]
        self.infos = {info[1].decode(): info for info in infos}
        self.links = {info[12].decode(): info[0] for info in infos}
        self.driven = [info for info in infos if info[2] != pybullet.JOINT_FIXED]
        self.indices = [info[0] for info in self.driven]

    def reset(self, q: Any) -> None:
        """Puts the seven joints at q [rad]."""
        for index, value in zip(self.indices, q, strict=True):
            self.pb.resetJointState(self.body, index, value)

    def hold(self, q: Any) -> None:
        """Drives the seven joints to q [rad] with no more than the URDF's efforts."""
        self.pb.setJointMotorControlArray(
            self.body, self.indices, pybullet.POSITION_CONTROL, q, forces=[info[10] for info in self.driven]
        )

    def q(self) -> np.ndarray:
        """The seven joint positions [rad]."""
        return np.array([state[0] for state in self.pb.getJointStates(self.body, self.indices)])

    def position(self, link: str) -> np.ndarray:
        """Position of a link's URDF frame in the arm's base frame [m]."""
        return np.array(self.pb.getLinkState(self.body, self.links[link], computeForwardKinematics=True)[4])


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """The description with absolute mesh paths."""
    text = (ROBOTS / "kuka_lwr.urdf").read_text().replace("package://rpbi_examples/robots", str(ROBOTS))
    path = tmp_path / "kuka_lwr.urdf"
    path.write_text(text)
    return path


@pytest.fixture
def pb() -> Iterator[Any]:
    client = BulletClient(pybullet.DIRECT)
    client.setGravity(0.0, 0.0, -9.81)
    client.setTimeStep(0.01)
    yield client
    client.disconnect()


@pytest.fixture
def kuka(pb: Any, file: Path) -> Kuka:
    return Kuka(pb, file)


def read_obj(path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices (n, 3), normals (n, 3) and faces (m, 3) of one of our meshes."""
    rows = [line.split() for line in path.read_text().splitlines()]
    vertices, normals = (np.array([row[1:] for row in rows if row[0] == kind], float) for kind in ("v", "vn"))
    faces = [[int(corner.split("//")[0]) - 1 for corner in row[1:]] for row in rows if row[0] == "f"]
    return vertices, normals, np.array(faces)


def meshes_of(link: ElementTree.Element) -> list[Path]:
    """The mesh files of a link's visuals."""
    return [MESHES / Path(mesh.attrib["filename"]).name for mesh in link.iterfind("visual/geometry/mesh")]


def test_bullet_loads_it_without_a_word(pb: Any, file: Path, capfd: pytest.CaptureFixture[str]) -> None:
    Kuka(pb, file)
    assert "arning" not in "".join(capfd.readouterr())


def test_chain_has_the_names_and_order_of_the_authors_release(kuka: Kuka) -> None:
    assert kuka.pb.getBodyInfo(kuka.body)[0] == b"base"
    assert list(kuka.links) == ARM_LINKS + TOOL_LINKS
    assert [info[1].decode() for info in kuka.driven] == [f"lwr_arm_{i}_joint" for i in range(7)]
    assert set(kuka.infos) == {info[1].decode() for info in kuka.driven} | {
        "base_joint",
        "lwr_arm_7_joint",
        "force_torque_sensor_mount",
        "end_effector_joint",
        "end_effector_joint_sponge",
        "end_effector_ball",
    }


def test_arm_with_sponge_equals_the_other_without_its_ball() -> None:
    other = ElementTree.parse(ROBOTS / "kuka_lwr2.urdf").getroot()
    expected = copy.deepcopy(URDF.getroot())
    for ball in expected.findall("*[@name='end_effector_ball']"):
        expected.remove(ball)
    text = ElementTree.tostring(expected, "unicode").replace('"base"', '"lwr_world"')
    assert ElementTree.canonicalize(text, strip_text=True) == ElementTree.canonicalize(
        ElementTree.tostring(other, "unicode"), strip_text=True
    )


def test_limits_are_the_published_ones(kuka: Kuka) -> None:
    assert [info[9] for info in kuka.driven] == [2.967, 2.094, 2.967, 2.094, 2.967, 2.094, 2.967]
    assert [info[8] for info in kuka.driven] == [-info[9] for info in kuka.driven]
    assert [info[11] for info in kuka.driven] == [1.92, 1.92, 2.27, 2.27, 2.27, 3.14, 3.14]
    assert [info[10] for info in kuka.driven] == [204, 306, 204, 306, 204, 306, 204]


def test_ball_is_at_its_home_pose_below_the_wrist(kuka: Kuka) -> None:
    kuka.reset(np.radians(HOME_DEG))
    assert kuka.position("end_effector_ball") == pytest.approx([-0.5377, 0.0, 0.1511], abs=1e-4)
    orientation = kuka.pb.getLinkState(kuka.body, kuka.links["end_effector_ball"])[5]
    turn = np.reshape(kuka.pb.getMatrixFromQuaternion(orientation), (3, 3))
    assert turn == pytest.approx(np.diag([1.0, -1.0, -1.0]), abs=1e-6)


def test_stretched_arm_has_the_published_lengths(kuka: Kuka) -> None:
    kuka.reset(np.zeros(7))
    heights = {"lwr_arm_0_link": 0.0, "lwr_arm_2_link": 0.31, "lwr_arm_4_link": 0.71, "lwr_arm_6_link": 1.10}
    for link, height in (heights | {"lwr_arm_7_link": 1.178}).items():
        assert kuka.position(link) == pytest.approx([0.0, 0.0, height], abs=1e-6), link


@pytest.mark.parametrize(("turn_deg", "elbow"), [(0, (-0.4, 0, 0.31)), (90, (0, -0.4, 0.31))])
def test_first_joint_turns_the_arm_about_the_vertical(
    kuka: Kuka, turn_deg: float, elbow: tuple[float, float, float]
) -> None:
    kuka.reset(np.radians([turn_deg, 90, 0, 0, 0, 0, 0]))
    assert kuka.position("lwr_arm_4_link") == pytest.approx(elbow, abs=1e-6)


def test_arm_weighs_16_kg_with_a_low_centre_of_mass(kuka: Kuka) -> None:
    dynamics = {name: kuka.pb.getDynamicsInfo(kuka.body, index) for name, index in kuka.links.items()}
    assert sum(dynamics[link][0] for link in ARM_LINKS) == pytest.approx(16.0)
    assert all(dynamics[link][0] > 0.0 for link in ARM_LINKS + TOOL_LINKS)
    assert dynamics["lwr_arm_0_link"][3][2] == pytest.approx(0.055, abs=0.004)


def test_inertias_belong_to_bodies_that_can_exist() -> None:
    for inertia in list(URDF.iter("inertia"))[1:]:
        rows = (("ixx", "ixy", "ixz"), ("ixy", "iyy", "iyz"), ("ixz", "iyz", "izz"))
        matrix = [[float(inertia.attrib[key]) for key in row] for row in rows]
        smallest, middle, largest = np.linalg.eigvalsh(matrix)
        assert smallest > 0.0
        assert smallest + middle > largest


def test_inertias_are_those_of_the_meshes() -> None:
    script = subprocess.run([sys.executable, TOOLS / "print_inertials.py"], capture_output=True, text=True, check=True)
    text = (ROBOTS / "kuka_lwr.urdf").read_text()
    printed = [line for line in script.stdout.splitlines() if line.startswith(" ")]
    assert len(printed) == 5 * len(ARM_LINKS + TOOL_LINKS)
    assert [line for line in printed if line not in text.splitlines()] == []


def test_script_makes_the_meshes_again(tmp_path: Path) -> None:
    subprocess.run([sys.executable, TOOLS / "make_meshes.py", "--out", tmp_path], check=True)
    made = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    kept = {path.name: path.read_bytes() for path in MESHES.iterdir() if path.suffix in (".obj", ".mtl")}
    assert sorted(made) == sorted(kept)
    assert [name for name in made if made[name] != kept[name]] == []


def test_every_mesh_is_used_and_there_and_all_are_small() -> None:
    used = {path for link in URDF.iter("link") for path in meshes_of(link)}
    assert used == set(MESHES.glob("*.obj"))
    assert sum(path.stat().st_size for path in used) < 2e6


def test_arm_meshes_are_fine_but_light_enough_for_the_camera() -> None:
    links = {link.attrib["name"]: link for link in URDF.iter("link")}
    bodies = {name: len(read_obj(meshes_of(links[name])[0])[2]) for name in ARM_LINKS}
    assert min(bodies.values()) >= 300, bodies
    assert sum(len(read_obj(path)[2]) for link in links.values() for path in meshes_of(link)) < 30_000


@pytest.mark.parametrize("path", sorted(MESHES.glob("*.obj")), ids=lambda path: path.stem)
def test_mesh_normals_point_out_of_its_faces(path: Path) -> None:
    vertices, normals, faces = read_obj(path)
    assert np.linalg.norm(normals, axis=1) == pytest.approx(1.0, abs=2e-3)
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    flat = np.cross(b - a, c - a)
    cosines = np.einsum("ij,ikj->ik", flat / np.linalg.norm(flat, axis=1, keepdims=True), normals[faces])
    assert cosines.min() > 0.0


@pytest.mark.parametrize("name", ["base", "segment", "forearm", "wrist"])
def test_shell_is_watertight(name: str) -> None:
    faces = read_obj(MESHES / f"{name}.obj")[2]
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    assert len(np.unique(edges, axis=0)) == len(edges)
    assert {tuple(edge) for edge in edges} == {tuple(edge) for edge in edges[:, ::-1]}


def test_colours_of_the_meshes_are_those_of_the_description() -> None:
    rows = [line.split() for line in (MESHES / "materials.mtl").read_text().splitlines()]
    names = [row[1] for row in rows if row[0] == "newmtl"]
    colours = [[float(x) for x in row[1:]] for row in rows if row[0] == "Kd"]
    rgba = {m.attrib["name"]: m.find("color").attrib["rgba"].split() for m in URDF.iterfind("material")}
    assert dict(zip(names, colours, strict=True)) == {k: [float(x) for x in v[:3]] for k, v in rgba.items()}
    for visual in URDF.iter("visual"):
        mesh = MESHES / Path(visual.find("geometry/mesh").attrib["filename"]).name
        assert f"usemtl {visual.find('material').attrib['name']}\n" in mesh.read_text()


def test_straight_arm_shows_no_gap(kuka: Kuka) -> None:
    kuka.reset(np.zeros(7))
    for eye in ((3.0, 0.0, 0.6), (0.0, 3.0, 0.6)):
        view = kuka.pb.computeViewMatrix(eye, (0.0, 0.0, 0.6), (0.0, 0.0, 1.0))
        lens = kuka.pb.computeProjectionMatrixFOV(34.0, 100 / 350, 1.0, 5.0)
        image = kuka.pb.getCameraImage(100, 350, view, lens, renderer=pybullet.ER_TINY_RENDERER)
        rows = (np.reshape(image[4], (350, 100)) == kuka.body).sum(axis=1)
        seen = np.flatnonzero(rows)
        assert len(seen) > 250
        assert rows[seen[0] : seen[-1] + 1].min() >= 2


@pytest.mark.parametrize("q_deg", [HOME_DEG, (0,) * 7, (90, -90, 0, 90, 0, 90, 0)])
def test_arm_does_not_touch_itself(pb: Any, file: Path, q_deg: tuple[int, ...]) -> None:
    kuka = Kuka(pb, file, flags=pybullet.URDF_USE_SELF_COLLISION)
    kuka.reset(np.radians(q_deg))
    pb.performCollisionDetection()
    assert pb.getContactPoints(kuka.body, kuka.body) == ()


@pytest.mark.parametrize("flags", [0, pybullet.URDF_USE_INERTIA_FROM_FILE])
def test_motors_hold_the_arm_against_gravity_within_their_limits(pb: Any, file: Path, flags: int) -> None:
    kuka = Kuka(pb, file, flags=flags)
    kuka.reset(np.radians(HOME_DEG))
    kuka.hold(np.radians(HOME_DEG))
    for _ in range(100):
        pb.stepSimulation()
    assert kuka.q() == pytest.approx(np.radians(HOME_DEG), abs=1e-3)
    torques = np.array([state[3] for state in pb.getJointStates(kuka.body, kuka.indices)])
    assert 10.0 < np.abs(torques).max() < 60.0


def test_motors_follow_a_moving_target(kuka: Kuka) -> None:
    start = np.radians(HOME_DEG)
    kuka.reset(start)
    for tick in range(200):
        target = start + 0.5 * (1.0 - np.cos(np.pi * tick * 0.01))
        kuka.hold(target)
        kuka.pb.stepSimulation()
        assert np.abs(kuka.q() - target).max() < 0.2
    kuka.hold(start)
    for _ in range(100):
        kuka.pb.stepSimulation()
    assert kuka.q() == pytest.approx(start, abs=1e-3)
