"""Hostile URDFs: robots that are invented part by part, and good files with changed bytes."""

from __future__ import annotations

import re
from pathlib import Path
from random import Random
from xml.sax.saxutils import quoteattr

import pybullet_data

from .texts import NAMES, name, number, positive, spoil, vector

DATA = Path(pybullet_data.getDataPath())
GOOD = ("kuka_iiwa/model.urdf", "cube.urdf", "cartpole.urdf", "r2d2.urdf", "teddy_vhacd.urdf", "humanoid/humanoid.urdf")
KINDS = ("revolute", "continuous", "prismatic", "fixed", "planar", "floating", "spherical")
FIFO = "pipe.png"
"""A named pipe that the folder of each file has."""


def write_urdf(random: Random, folder: Path) -> Path:
    """Writes a hostile URDF into a folder and returns its path."""
    path = folder / "robot.urdf"
    chance = random.random()
    if chance < 0.45:
        data = _robot(random).encode(errors="replace")
    elif chance < 0.85:
        source = DATA / random.choice(GOOD)
        text = re.sub(r'filename="(?!package)', f'filename="{source.parent}/', source.read_text())
        data = spoil(random, text.encode())
    elif chance < 0.93:
        data = spoil(random, _robot(random).encode(errors="replace"))
    else:
        data = random.choice(_LARGE)(random).encode(errors="replace")
    path.write_bytes(data)
    return path


def _robot(random: Random) -> str:
    count = random.choice((1, 2, 3, 5, 8, 20))
    names = [name(random, f"link{index}", 0.01) for index in range(count)]
    parts = [_link(random, each) for each in names]
    for index in range(1, count):
        parent = names[random.randrange(index)] if random.random() < 0.98 else random.choice((*names, *NAMES))
        parts.append(_joint(random, index, parent, names[index]))
    if random.random() < 0.2:
        parts.append(_material(random))
    if random.random() < 0.1:
        parts.append(random.choice(_OTHERS))
    if random.random() < 0.1:
        random.shuffle(parts)
    text = _element("robot", {"name": name(random, "robot", 0.04)}, *parts)
    return random.choice(_WRAPPED)(text) if random.random() < 0.1 else text


_WRAPPED = (
    lambda text: f'<?xml version="1.0" encoding="UTF-16"?>\n{text}',
    lambda text: f'<!DOCTYPE robot [<!ENTITY a "{"b" * 1000}">]>\n{text}',
    lambda text: f'<!DOCTYPE r SYSTEM "/dev/zero">{text}',
    lambda text: f"<!-- %n%n -- %s -->{text}<!-- ",
    lambda text: text.replace(">", "><![CDATA[%n <robot>]]>", 1),
    lambda text: text.replace("><", "><?%n %s?><", 1),
    lambda text: f"{text}<robot name='%n'><link name='%n'/></robot>",
    lambda text: text.replace("robot", "sdf"),
    lambda text: "\ufeff" + text,
    lambda text: text.replace("<link", "\0<link", 1),
)
_OTHERS = (
    "<gazebo><plugin filename='/dev/zero'>%n%s</plugin></gazebo>",
    "<transmission name='%n'><type>%n</type></transmission>",
    "<sensor name='%n' type='x'><parent link='%n'/></sensor>",
    "<deformable name='soft'><visual filename='pipe.png'/><collision filename='/dev/zero'/></deformable>",
    "<deformable name='%n'><inertial><mass value='x'/></inertial></deformable>",
    "<xacro:macro name='x'/>",
    "<link/><joint/><material/>",
)


def _element(tag: str, attributes: dict[str, str], *parts: str) -> str:
    words = "".join(f" {key}={quoteattr(text)}" for key, text in attributes.items())
    return f"<{tag}{words}>" + "\n".join(parts) + f"</{tag}>"


def _link(random: Random, called: str) -> str:
    parts = []
    if random.random() < 0.9:
        parts.append(_inertial(random))
    for kind in ("visual", "collision"):
        for _ in range(random.choice((0, 1, 1, 1, 3))):
            more = [_material(random)] if kind == "visual" and random.random() < 0.3 else []
            concave = {"concave": "yes"} if random.random() < 0.05 else {}
            parts.append(
                _element(kind, {"name": name(random, "x"), **concave}, _origin(random), _geometry(random), *more)
            )
    if random.random() < 0.1:
        inner = [_element(tag, {"value": number(random, 0.2)}) for tag in random.sample(_CONTACT, 3)]
        parts.append(_element("contact", {}, *inner))
    if random.random() < 0.03:
        parts.append("<audio_source><uri/><pitch/></audio_source>")
    return _element("link", {"name": called} if random.random() < 0.99 else {}, *parts)


_CONTACT = ("lateral_friction", "rolling_friction", "restitution", "stiffness", "damping", "friction_anchor")


def _inertial(random: Random) -> str:
    moments = {key: positive(random) for key in ("ixx", "iyy", "izz")} | {key: "0" for key in ("ixy", "ixz", "iyz")}
    if random.random() < 0.05:
        moments.pop(random.choice([*moments]))
    mass = {"value": positive(random, 0.06)} if random.random() < 0.98 else {}
    return _element("inertial", {}, _origin(random), _element("mass", mass), _element("inertia", moments))


def _origin(random: Random) -> str:
    return _element("origin", {"xyz": vector(random), "rpy": vector(random)}) if random.random() < 0.9 else "<origin/>"


def _geometry(random: Random) -> str:
    shapes = (
        lambda: _element("box", {"size": " ".join(positive(random) for _ in range(3))}),
        lambda: _element("sphere", {"radius": positive(random)}),
        lambda: _element("cylinder", {"radius": positive(random), "length": positive(random)}),
        lambda: _element("capsule", {"radius": positive(random), "length": positive(random)}),
        lambda: _element("mesh", {"filename": _mesh(random), "scale": vector(random)}),
        lambda: random.choice(("<plane normal='0 0 1'/>", "<box/>", "<%n/>", "", "<mesh/>", "<cdf filename='x.cdf'/>")),
    )
    weights = (10, 10, 10, 5, 4, 1)
    return _element("geometry", {}, random.choices(shapes, weights)[0]())


def _mesh(random: Random) -> str:
    files = (
        str(DATA / "cube.obj"),
        "package://cube.obj",
        "cube.obj",
        FIFO,
        "x.cdf",
        "/dev/zero.obj",
        "x.obj?%n",
        ".obj",
    )
    return files[0] if random.random() < 0.7 else random.choice((*files, *NAMES))


def _material(random: Random) -> str:
    parts = [_element("color", {"rgba": vector(random, 4)})] if random.random() < 0.7 else []
    if random.random() < 0.4:
        files = (str(DATA / "cube.png"), FIFO, "../" * 20 + "dev/zero", "/dev/zero", "no.png", "robot.urdf", *NAMES)
        parts.append(_element("texture", {"filename": random.choice(files)}))
    return _element("material", {"name": name(random, "paint", 0.05)} if random.random() < 0.97 else {}, *parts)


def _joint(random: Random, index: int, parent: str, child: str) -> str:
    kind = random.choice(KINDS) if random.random() < 0.97 else random.choice(NAMES)
    parts = [_element("parent", {"link": parent}), _element("child", {"link": child}), _origin(random)]
    if random.random() < 0.9:
        axis = random.choice(("0 0 1", "1 0 0", vector(random), "0 0 0"))
        parts.append(_element("axis", {"xyz": axis}))
    if random.random() < 0.9:
        lower, upper = sorted((random.uniform(-3, 3), random.uniform(-3, 3)))
        limits = {
            "lower": f"{lower:g}",
            "upper": f"{upper:g}",
            "effort": positive(random),
            "velocity": positive(random),
        }
        parts.append(_element("limit", limits))
    if random.random() < 0.3:
        parts.append(_element("dynamics", {"damping": number(random), "friction": positive(random)}))
    if random.random() < 0.15:
        leader = f"joint{random.randrange(index + 2)}"
        parts.append(
            _element("mimic", {"joint": leader, "multiplier": number(random, 0.2), "offset": number(random, 0.1)})
        )
    return _element("joint", {"name": name(random, f"joint{index}"), "type": kind}, *parts)


def _chain(random: Random, count: int, kind: str, shape: str = "") -> str:
    mass = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    parts = [f'<link name="l{index}">{mass}{shape}</link>' for index in range(count + 1)]
    for index in range(count):
        ends = f'<parent link="l{index}"/><child link="l{index + 1}"/>'
        limits = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'
        parts.append(f'<joint name="j{index}" type="{kind}">{ends}{limits}</joint>')
    if random.random() < 0.5:
        parts.reverse()
    return _element("robot", {"name": "chain"}, *parts)


SHAPES = '<collision><geometry><box size="1 1 1"/></geometry></collision>'
_LARGE = (
    lambda random: _chain(random, random.choice((126, 127, 128, 129, 200)), random.choice(KINDS)),
    lambda random: _chain(random, random.choice((1999, 2000, 3000)), random.choice(KINDS)),
    lambda random: _chain(random, 1, "revolute", SHAPES * random.choice((100, 1000, 5000))),
    lambda random: "<!-- " * random.choice((15_000, 300_000)),
    lambda random: "<robot " * 50_000 + "</robot " * 50_000,
    lambda random: "<robot name='r'><link name='a'/>" + "<mesh filename='" * 20_000 + "</robot>",
    lambda random: "<robot name='r'>" + "<link>" * random.choice((90, 200, 50_000)) + "</robot>",
    lambda random: (
        f"<robot name='r'><link name='a'/><gazebo>{'<x a=' + quoteattr('y' * 90) + '/>'}</gazebo></robot>" * 2000
    ),
    lambda random: "<robot name='r'><link name='a'/>" + "<x/>" * 400_000 + "</robot>",
    lambda random: "<robot name='r'><link name='a'" + " b='c'" * 1000 + "/></robot>",
    lambda random: "<robot name='r'><link name='a'/>" + " " * 1_900_000 + "</robot>",
    lambda random: "<robot name='r'><link name='a'/></robot>" + " " * 3_000_000,
)
