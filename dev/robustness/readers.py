"""Readers of hostile files: each returns if it accepts the file, or raises an InterfaceError or ValueError."""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from random import Random

import pybullet
from worlds import ball, write_world

from custom_ros_tools.config import load_config
from custom_ros_tools.errors import InterfaceError
from ik_ros.tasks.robot import PinocchioRobot
from operator_node.avatar.human_urdf import urdf_offsets
from robot_model.chain import Chain
from robot_model.model import RobotModel
from robot_model.urdf.document import UrdfDocument, mimics_of
from robot_model.urdf.files import write_description
from robot_model.urdf.for_ros import description_for_ros
from rpbi.engine.client import Client
from rpbi.kinematics import Kinematics
from rpbi.render.mirror import Mirror
from rpbi.world import World
from rpbi.world.loading import load_world
from rpbi.world.saved.description import WorldDescription

from .meshes import write_mesh
from .urdfs import FIFO, write_urdf
from .yamls import GOOD, KINDS, write_yaml

TICKS = 5
Readers = Mapping[str, Callable[[], object]]
"""Readers by name."""
Entry = tuple[str, dict[str, object]]
"""Argument of `write_world`, and the text of its file."""


def hostile(kind: str, seed: int, folder: Path) -> tuple[tuple[str, dict[str, object] | Path], Readers]:
    """Writes a hostile file into a folder of its own.

    Args:
        kind: `urdf`, `mesh` or `yaml`.

    Returns:
        What a service of the simulator gets, the list of the main file and an object or a file of one, and what reads
        the file here.
    """
    random = Random(f"{kind} {seed}")
    os.mkfifo(folder / FIFO)
    if kind == "urdf":
        path = write_urdf(random, folder)
        entry = _urdf_entry(random, path)
        return entry, {"world": lambda: _build(folder, entry), **_urdf_readers(path, folder)}
    if kind == "mesh":
        entry = _mesh_entry(random, write_mesh(random, folder), folder)
        return entry, {"world": lambda: _build(folder, entry)}
    file, of_kind = write_yaml(random, folder)
    return (KINDS[of_kind], file), {
        "file": lambda: load_config(str(file)),
        "world": lambda: _build_with(folder, KINDS[of_kind], file),
    }


def _urdf_entry(random: Random, path: Path) -> Entry:
    load = {"fileName": str(path), "useFixedBase": random.random() < 0.5}
    if random.random() < 0.1:
        load["flags"] = random.choice(("URDF_MERGE_FIXED_LINKS", "URDF_USE_SELF_COLLISION", "URDF_MAINTAIN_LINK_ORDER"))
    section, more = random.choice(
        (
            ("urdfs", {}),
            ("urdfs", {}),
            ("robots", {}),
            ("robots", {"is_visual_robot": True}),
            ("robots", {"planar_base": {}}),
        )
    )
    config = {**(GOOD["robot"] if section == "robots" else {}), "name": "it", "loadURDF": load, **more}
    return section, config


def _mesh_entry(random: Random, path: Path, folder: Path) -> Entry:
    if path.suffix == ".vtk" or random.random() < 0.1:
        return "soft", {"name": "it", "loadSoftBody": {"fileName": str(path), "useMassSpring": True}}
    if random.random() < 0.5:
        shape = {"shapeType": "GEOM_MESH", "fileName": str(path)}
        return "dynamic", {**ball("it"), "createVisualShape": shape, "createCollisionShape": shape}
    geometry = f'<geometry><mesh filename="{path.name}"/></geometry>'
    urdf = folder / "robot.urdf"
    parts = f"<visual>{geometry}</visual><collision>{geometry}</collision>"
    urdf.write_text(f'<robot name="r"><link name="l">{parts}</link></robot>')
    return "urdfs", {"name": "it", "loadURDF": {"fileName": str(urdf)}}


def _build(folder: Path, entry: Entry) -> None:
    section, config = entry
    flags = {"resetSimulation": {"flags": "RESET_USE_DEFORMABLE_WORLD"}} if section == "soft" else {}
    _run(write_world(folder, **{section: (config,)}, **flags))


def _build_with(folder: Path, section: str, file: Path) -> None:
    data = file.read_bytes()
    world = write_world(folder, **{section: ({"name": file.stem},)})
    file.write_bytes(data)
    _run(world)


def _run(main: str) -> None:
    """Builds a world, runs it for some ticks, and builds the same in the renderer's copy and in a replay."""
    with contextlib.closing(World(load_world(main), connection_mode=pybullet.DIRECT)) as world:
        text = world.describe()
        for _ in range(TICKS):
            world.step()
        copy = Client(pybullet.DIRECT)
        mirror = Mirror(copy)
        for entry in world.log:
            mirror.apply(entry)
        mirror.close()
        copy.disconnect()
    World.from_description(WorldDescription(text)).close()


def _urdf_readers(path: Path, folder: Path) -> Readers:
    file = str(path)
    return {
        "kinematics": lambda: _solve(file),
        "guard": lambda: RobotModel(file),
        "ik": lambda: _ik(file),
        "ros": lambda: description_for_ros(file),
        "mimics": lambda: mimics_of(file),
        "avatar": lambda: urdf_offsets("robot_description", path.read_text(errors="replace")),
        "replay": lambda: _replay(path, folder),
    }


def _solve(file: str) -> None:
    with contextlib.closing(Kinematics(file)) as kinematics:
        for link in kinematics._links[:2]:
            kinematics.forward([0.0] * len(kinematics.joint_names), link)


def _ik(file: str) -> None:
    PinocchioRobot(file)
    links = UrdfDocument(file).links
    Chain(file, links[0], links[-1])


def _replay(path: Path, folder: Path) -> None:
    """Builds the world of a recorded session whose robot description was exchanged."""
    good = write_description('<robot name="good"><link name="a"/></robot>')
    config = {"name": "it", "loadURDF": {"fileName": good}}
    place = folder / "session"
    place.mkdir(exist_ok=True)
    with contextlib.closing(World(load_world(write_world(place, urdfs=(config,))))) as world:
        described = json.loads(world.describe())
    described["descriptions"] = {good: path.read_text(errors="replace")}
    World.from_description(WorldDescription(json.dumps(described))).close()


REFUSALS = (InterfaceError, ValueError)
"""Errors that readers raise for a file that they refuse; the caller reports them in a line."""
