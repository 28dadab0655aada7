"""URDFs of which PyBullet says no more than "Cannot load URDF file" are reported with the part that is missing."""

from __future__ import annotations

from pathlib import Path

import pybullet
import pybullet_data
import pytest

from robot_model.urdf.document import UrdfDocument
from robot_model.urdf.structure import missing_parts
from rpbi.urdf.loading import urdf_problems

INERTIAL = "<inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/></inertial>"
LIMIT = "<limit lower='0' upper='1' effort='1' velocity='1'/>"
SHAPES = "<geometry> needs one of box, sphere, cylinder, capsule, plane, mesh"


def joint(kind: str, parts: str = "") -> str:
    return (
        f"<link name='a'>{INERTIAL}</link><link name='b'>{INERTIAL}</link><joint name='j' type='{kind}'>"
        f"<parent link='a'/><child link='b'/>{parts}</joint>"
    )


def shape(text: str, part: str = "collision") -> str:
    return f"<link name='a'><{part}><geometry>{text}</geometry></{part}></link>"


FAULTS = {
    joint("revolute"): 'joint \'j\': a revolute joint needs <limit lower="" upper="" effort="" velocity=""/>, or '
    "type continuous",
    joint("prismatic"): 'joint \'j\': a prismatic joint needs <limit lower="" upper="" effort="" velocity=""/>',
    joint("continuous", "<dynamics/>"): "joint 'j': <dynamics> needs damping or friction",
    shape("<cylinder radius='1'/>"): "link 'a': collision: <cylinder> has no length",
    shape("<capsule length='1'/>"): "link 'a': collision: <capsule> has no radius",
    shape("<box/>", "visual"): "link 'a': visual: <box> has no size",
    shape("<sphere/>"): "link 'a': collision: <sphere> has no radius",
    shape("<plane/>"): "link 'a': collision: <plane> has no normal",
    shape("<mesh/>"): "link 'a': collision: <mesh> has no filename",
    shape("<cone/>"): f"link 'a': collision: {SHAPES}, got <cone>",
    "<link name='a'><visual/></link>": f"link 'a': visual: {SHAPES}",
    "<link name='a'><inertial><inertia ixx='1' iyy='1' izz='1'/></inertial></link>": "link 'a': <inertial> has no "
    "<mass>",
    "<link name='a'><inertial><mass value='1'/><inertia ixx='1'/></inertial></link>": "link 'a': inertial: <inertia> "
    "has no iyy, izz",
    f"<link name='a'>{INERTIAL}<contact><restitution/></contact></link>": "link 'a': contact: <restitution> has no "
    "value",
}
SOUND = (joint("revolute", LIMIT), joint("continuous"), joint("fixed"), joint("revolute", "<limit/>"))


@pytest.fixture(scope="module")
def client():
    number = pybullet.connect(pybullet.DIRECT)
    yield number
    pybullet.disconnect(number)


def test_missing_parts_are_named_where_pybullet_only_refuses(tmp_path, client):
    for index, (parts, problem) in enumerate({**FAULTS, **dict.fromkeys(SOUND, "")}.items()):
        file = tmp_path / f"{index}.urdf"  # PyBullet remembers the text of a file by its name
        file.write_text(f"<robot name='r'>{parts}</robot>")
        assert urdf_problems(str(file)) == ([f"{file}: {problem}"] if problem else []), parts
        if not problem:
            pybullet.loadURDF(str(file), physicsClientId=client)
            continue
        with pytest.raises(pybullet.error, match="Cannot load URDF file"):
            pybullet.loadURDF(str(file), physicsClientId=client)


def test_no_part_is_missing_from_the_urdfs_of_pybullet():
    for path in Path(pybullet_data.getDataPath()).rglob("*.urdf"):
        document = UrdfDocument(str(path))
        if document.tag == "robot" and path.name != "concave_box.urdf":  # whose file of signed distances is missing
            assert list(missing_parts(document)) == [], path
