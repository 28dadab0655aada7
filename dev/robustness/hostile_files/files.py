"""Broken and hostile files, made from good ones by a seed, and the outcomes of their readers.

Each file is read in a process of its own, a fork of this one, so that a crash is seen and costs little. Worlds are read
by the program behind `./rpbi check`, and by the simulator node, which needs a ROS master.
"""

from __future__ import annotations

import contextlib
import io
import os
import random
import re
import signal
import struct
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import genpy
import pybullet
import pybullet_data
import rosbag
import rospy
import yaml
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from worlds import FLOOR, ball, iiwa, write_world

from custom_ros_tools.console.modules import command_of
from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.lifecycle.run_node import run_node
from ros_pybullet_interface.msg import SimulationState, WorldCommand, WorldCommands
from rpbi.ros.console.check import check
from rpbi.ros.node import SimulatorNode
from rpbi.world import World
from rpbi.world.loading import load_world
from rpbi.world.saved.values import to_text
from rpbi_data import bag_to_dataframes, topic_report

DATA = Path(pybullet_data.getDataPath())
URDFS = ("kuka_iiwa/model.urdf", "cube.urdf", "cartpole.urdf", "teddy_vhacd.urdf")
MESHES = (
    "cube.obj",
    "teddy2_VHACD_CHs.obj",
    "kuka_iiwa/meshes/link_7.stl",
    "racecar/meshes/cone.dae",
    "cloth_z_up.obj",
)
NUMBERS = (
    "nan",
    "inf",
    "-1",
    "0",
    "1e300",
    "-1e300",
    "1e-300",
    "",
    "x",
    "${mass}",
    "99999999999999999999",
    "0x7fffffff",
)
WORDS = ("", " ", "world", "base", "a" * 300, "a" * 5000, "../" * 40, "/proc/kmsg", "%s%n", "ä\u202e", "-", "null")
LONGEST_S = 120.0
"""Time after which a reader counts as hanging."""
TICKS = 20


class Outcome(NamedTuple):
    """Outcome of a reader of a file.

    Attributes:
        verdict: `taken`, `refused`, or what must not be: `signal N`, `traceback`, `hang`, `silent` or `code`.
        text: What was said.
    """

    verdict: str
    text: str

    @property
    def is_fine(self) -> bool:
        return self.verdict in ("taken", "refused")


class Hostile(NamedTuple):
    """A hostile file.

    Attributes:
        kind: What it was.
        seed: By which it was spoilt.
        path: The file.
        readers: What reads it, by name, the first without ROS; a refusal is an InterfaceError, or an exit with 1.
    """

    kind: str
    seed: int
    path: Path
    readers: dict[str, Callable[[], object]]

    @property
    def canary(self) -> Path:
        """The file that exists if code in the hostile one was run."""
        return self.path.parent / "canary"


def outcome_of(read: Callable[[], object], canary: Path | None = None) -> Outcome:
    """Reads a file in its own process."""
    said, saying = os.pipe()
    sys.stdout.flush()
    sys.stderr.flush()
    child = os.fork()
    if not child:
        os.close(said)
        _read_and_exit(read, saying)
    os.close(saying)
    os.set_blocking(said, False)
    text, end_s = b"", time.monotonic() + LONGEST_S
    while True:
        with contextlib.suppress(BlockingIOError):
            text += os.read(said, 1 << 16)
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            break
        if time.monotonic() > end_s:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            break
        time.sleep(0.002)
    with contextlib.suppress(BlockingIOError):
        text += os.read(said, 1 << 16)
    os.close(said)
    words = text.decode(errors="replace")
    if not ended:
        return Outcome("hang", words)
    if canary is not None and canary.exists():
        return Outcome("code", words)
    if os.WIFSIGNALED(status):
        return Outcome(f"signal {os.WTERMSIG(status)}", words)
    verdict = {0: "taken", 1: "refused"}.get(os.WEXITSTATUS(status), "traceback")
    if verdict == "refused" and not words.strip():
        return Outcome("silent", words)
    return Outcome("traceback" if "Traceback" in words else verdict, words)


def _read_and_exit(read: Callable[[], object], saying: int) -> None:
    code = 2
    try:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 1)  # PyBullet's own words
        os.dup2(saying, 2)
        sys.stdout = io.StringIO()
        sys.stderr = io.TextIOWrapper(io.FileIO(saying, "w", closefd=False), write_through=True)
        read()
        code = 0
    except InterfaceError as error:
        os.write(saying, str(error)[:4000].encode())
        code = 1
    except SystemExit as end:
        code = {None: 0, 0: 0, 1: 1}.get(end.code, code)
    except BaseException:
        os.write(saying, traceback.format_exc()[-4000:].encode())
    finally:
        os._exit(code)


def hostile_files(kind: str, seeds: range, folder: Path) -> Iterator[Hostile]:
    """Yields a hostile file of a kind for each seed."""
    for seed in seeds:
        place = folder / f"{kind}{seed}"
        place.mkdir()
        yield Hostile(kind, seed, *_MAKERS[kind](random.Random(f"{kind} {seed}"), place))


# --- What is done to texts and bytes


def spoil_text(random: random.Random, text: str) -> str:
    """Returns a text with up to four changes."""
    for _ in range(random.randint(1, 4)):
        text = random.choice(_TEXT_CHANGES)(random, text)
    return text


def _line(random: random.Random, text: str) -> tuple[list[str], int]:
    lines = text.splitlines() or [""]
    return lines, random.randrange(len(lines))


def _drop_line(random: random.Random, text: str) -> str:
    lines, index = _line(random, text)
    return "\n".join(lines[:index] + lines[index + 1 :])


def _repeat_line(random: random.Random, text: str) -> str:
    lines, index = _line(random, text)
    return "\n".join([*lines[: index + 1], *lines[index:]])


def _swap_lines(random: random.Random, text: str) -> str:
    lines, index = _line(random, text)
    other = random.randrange(len(lines))
    lines[index], lines[other] = lines[other], lines[index]
    return "\n".join(lines)


def _cut(random: random.Random, text: str) -> str:
    return text[: random.randrange(len(text) or 1)]


def _other_number(random: random.Random, text: str) -> str:
    return _one(random, text, r"-?\d+\.?\d*(?:e-?\d+)?", lambda _: random.choice(NUMBERS))


def _other_word(random: random.Random, text: str) -> str:
    return _one(random, text, r"(?<=\")[^\"]*(?=\")|(?<=: )\w[^\n]*", lambda _: random.choice(WORDS))


def _borrowed_word(random: random.Random, text: str) -> str:
    words = re.findall(r"(?<=\")[^\"\n]*(?=\")|(?<=: )\w[^\n]*", text) or [""]
    return _one(random, text, r"(?<=\")[^\"]*(?=\")|(?<=: )\w[^\n]*", lambda _: random.choice(words))


def _drop_element(random: random.Random, text: str) -> str:
    return _one(random, text, r"<(\w+)[^<>]*(?:/>|>[^<]*</\1>)", lambda _: "")


def _repeat_element(random: random.Random, text: str) -> str:
    return _one(random, text, r"<(\w+)\b(?:[^<>]*/>|.*?</\1>)", lambda found: found[0] * 2)


def _flip(random: random.Random, text: str) -> str:
    index = random.randrange(len(text) or 1)
    return text[:index] + chr(random.choice((0, 9, 34, 38, 60, 62, 123, 127, 255, 0x202E))) + text[index + 1 :]


def _one(random: random.Random, text: str, pattern: str, change: Callable[[re.Match[str]], str]) -> str:
    found = list(re.finditer(pattern, text, re.DOTALL))
    if not found:
        return text
    match = random.choice(found)
    return text[: match.start()] + change(match) + text[match.end() :]


_TEXT_CHANGES = (
    *(_drop_line, _repeat_line, _swap_lines, _cut, _other_number, _other_number, _other_word, _borrowed_word),
    *(_borrowed_word, _drop_element, _repeat_element, _flip),
)


def spoil_bytes(random: random.Random, data: bytes, least: int = 0) -> bytes:
    """Returns bytes with up to six changes behind the first ones."""
    spoilt = bytearray(data)
    for _ in range(random.randint(1, 6)):
        index = random.randrange(least, len(spoilt) or 1)
        what = random.randrange(5)
        if what == 0:
            spoilt[index] = random.randrange(256)
        elif what == 1:
            number = random.choice((0, 1, 2**31 - 1, 2**32 - 1, 0x7FC00000, len(spoilt)))
            spoilt[index : index + 4] = struct.pack("<I", number)
        elif what == 2:
            del spoilt[index : index + random.choice((1, 4, 50, len(spoilt) // 3))]
        elif what == 3:
            spoilt[index:index] = spoilt[index : index + random.choice((1, 4, 50, 500))]
        elif len(spoilt) > least + 1 and not random.randrange(3):
            del spoilt[index:]
        if len(spoilt) <= least:
            break
    return bytes(spoilt)


# --- Files of each kind


def _urdf(random: random.Random, folder: Path) -> tuple[Path, dict[str, Callable[[], object]]]:
    source = DATA / random.choice(URDFS)
    text = re.sub(r'filename="(?!package)', f'filename="{source.parent}/', source.read_text())
    path = folder / "robot.urdf"
    path.write_text(spoil_text(random, text), errors="replace")
    return path, _readers(_world_with(folder, urdfs={"name": "it", "loadURDF": {"fileName": str(path)}}))


def _mesh(random: random.Random, folder: Path) -> tuple[Path, dict[str, Callable[[], object]]]:
    source = DATA / random.choice(MESHES)
    path = folder / f"mesh{source.suffix}"
    data = source.read_bytes()
    is_text = source.suffix != ".stl" and random.randrange(2)
    path.write_bytes(spoil_text(random, data.decode()).encode() if is_text else spoil_bytes(random, data))
    if random.randrange(10) == 0:
        path.write_bytes(random.choice((b"", b"<COLLADA/>", b"f 1 2 3\n", b"v 0 0 0\nf 1 1 1\n", b"\0" * 84)))
    if source.name == "cloth_z_up.obj":
        soft = {"name": "it", "loadSoftBody": {"fileName": str(path), "useMassSpring": True}}
        world = write_world(folder, soft=(soft,), resetSimulation={"flags": "RESET_USE_DEFORMABLE_WORLD"})
        return path, _readers(world)
    shape = {"shapeType": "GEOM_MESH", "fileName": str(path)}
    if random.randrange(2):
        return path, _readers(_world_with(folder, dynamic={**ball("it"), **_shapes(shape)}))
    urdf = folder / "robot.urdf"
    geometry = f'<geometry><mesh filename="{path}"/></geometry>'
    parts = f"<visual>{geometry}</visual><collision>{geometry}</collision>"
    urdf.write_text(f'<robot name="r"><link name="l">{parts}</link></robot>')
    return path, _readers(_world_with(folder, urdfs={"name": "it", "loadURDF": {"fileName": str(urdf)}}))


def _shapes(shape: dict[str, str]) -> dict[str, object]:
    return {"createVisualShape": shape, "createCollisionShape": shape}


def _yaml(random: random.Random, folder: Path) -> tuple[Path, dict[str, Callable[[], object]]]:
    camera = {"name": "eye", "object_tf": {"tf_id": "eye"}}
    arm = iiwa(enabled_joint_force_torque_sensors=["lbr_iiwa_joint_7"], joint_trajectory_controller={}, contacts={})
    world = Path(
        write_world(
            folder, collision=(FLOOR,), dynamic=(ball(basePosition=[1, 0, 1]),), robots=(arm,), rgbd_sensor=camera
        )
    )
    path = random.choice([*folder.glob("*.yaml")])
    text = spoil_text(random, path.read_text())
    if random.randrange(12) == 0:
        text += "\n" + random.choice(BOMBS)
    path.write_text(text, errors="replace")
    return path, _readers(str(world))


_LADDER = "\n".join(f"k{turn}: &a{turn} {{<<: [*a{turn - 1}, *a{turn - 1}], x{turn}: 1}}" for turn in range(1, 30))
_LISTS = "\n".join(f"k{turn}: &a{turn} [{', '.join([f'*a{turn - 1}'] * 9)}]" for turn in range(1, 12))
BOMBS = (
    f"k0: &a0 {{y: 1}}\n{_LADDER}",
    f"k0: &a0 [y]\n{_LISTS}",
    "a: &a [*a]",
    "a: " + "[" * 5000,
    "a: !!python/object/apply:os.system [touch canary]",
    "objects: [this.yaml]\ntype: 'this:x'",
    "sensors: [{type: 'this.other:x', name: a, hz: 1}]",
    f"timeStep: {'9' * 5000}",
    "resetSimulation: {flags: 1180591620717411303424}",
)
"""YAML that expands far beyond its length, or names classes that must not be loaded."""


def _bag(random: random.Random, folder: Path) -> tuple[Path, dict[str, Callable[[], object]]]:
    path, canary = folder / "session.bag", folder / "canary"
    what = random.randrange(5)
    if what == 0:
        write_session(path, folder, definition_code=str(canary))
    elif what == 1:
        write_session(path, folder, change=lambda text: spoil_text(random, text))
    elif what == 2:
        old, new = random.choice(REPLACED)
        write_session(path, folder, change=lambda text: text.replace(old, new), last_tick=random.choice((0, 0, 2**63)))
    else:
        write_session(path, folder)
        path.write_bytes(spoil_bytes(random, path.read_bytes(), least=13))
    return path, {"tools": lambda: _read_bag(path)}


REPLACED = (
    ("rpbi.bodies.dynamic:DynamicObjectConfig", "this:x"),
    ("rpbi.config.world:WorldConfig", "unittest.__main__:x"),
    ("rpbi.config.world:WorldConfig", "rpbi.geometry:Pose"),
    ('"dynamic"', '"this:x"'),
    ('"files": {', '"files": {"/proc/kmsg": "0", "/dev/zero": "0", "/etc/shadow": "0"'),
    ('"files": {}', '"files": {"/proc/kmsg": "0", "/dev/zero": "0", "/etc/shadow": "0"}'),
    ('"config"', '"conf"'),
)
"""Hostile replacements in the description of a recorded world."""


def write_session(
    path: Path, folder: Path, definition_code: str = "", change: Callable[[str], str] = str, last_tick: int = 0
) -> None:
    """Writes a recorded session of a ball that falls, by a world in this process.

    Args:
        definition_code: A file that code in the definition of one message makes, if it is run.
        change: Returns the changed description of the world.
        last_tick: The tick that the last state is said to be of, if it is not 0.
    """
    world = World(
        load_world(write_world(folder, dynamic=(ball(basePosition=[0, 0, 1]),))), connection_mode=pybullet.DIRECT
    )
    with rosbag.Bag(str(path), "w") as bag:

        def state(tick: int = 0) -> None:
            stamp = genpy.Time(1, world.clock.tick * 1_000_000)
            message = SimulationState(
                tick=tick or world.clock.tick, state_hash=world.state_hash(), commands=world.commands.count
            )
            bag.write("/rpbi/state", message, stamp)

        bag.write("/rpbi/world_description", String(change(world.describe())), genpy.Time(1))
        state()
        for _ in range(5):
            world.step()
        world.pause("for a test")
        rows = [WorldCommand(one.tick, one.name, one.what, to_text(one.value)) for one in world.commands.since(0)[1]]
        bag.write("/rpbi/commands", WorldCommands(commands=rows), genpy.Time(1, 5))
        for _ in range(5):
            world.step()
        state(last_tick)
        kind = JointState
        if definition_code:
            kind = type("JointState", (JointState,), {"_full_text": _injected(definition_code)})
        bag.write("/joint_states", kind(name=["a"], position=[1.0]), genpy.Time(1, 9))
    world.close()


def _injected(canary: str) -> str:
    code = f'string x:str;__import__("os").mknod("{canary}");y=1'
    return JointState._full_text.replace("string[] name", f"{code}\nstring[] name", 1)


def _read_bag(path: Path) -> None:
    refusals = []
    for read in (topic_report, bag_to_dataframes):
        try:
            read(str(path))
        except InterfaceError as error:
            refusals.append(error)
    if command_of("rpbi_data.console.replay").run([str(path), "--quiet"]):
        refusals.append(InterfaceError("replay refuses it"))
    if refusals:
        raise refusals[0]


def _world_with(folder: Path, **objects: dict[str, object]) -> str:
    return write_world(folder, **{section: (config,) for section, config in objects.items()})


def _readers(world: str) -> dict[str, Callable[[], object]]:
    return {"check": lambda: _check(world), "node": lambda: _run_node(world)}


def _check(world: str) -> None:
    if check(world):
        sys.exit(1)


class _ShortRun(SimulatorNode):
    """The simulator node for a few ticks."""

    def run(self) -> None:
        self._simulation.stop()
        for _ in range(TICKS):
            self._simulation.step()
        rospy.signal_shutdown("all ticks are done")
        super().run()


def _run_node(world: str) -> None:
    name = f"node_{os.getpid()}"
    sys.argv = [name, f"_config_file:={world}"]
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    run_node(name, _ShortRun, _ShortRun.run, ros_time=False, loggers=["rpbi"])


_MAKERS = {"urdf": _urdf, "mesh": _mesh, "yaml": _yaml, "bag": _bag}
KINDS = tuple(_MAKERS)


def object_of(hostile: Hostile) -> dict[str, object]:
    """Returns the YAML of the object that a hostile URDF or mesh is for."""
    return yaml.safe_load((hostile.path.parent / "it.yaml").read_text())
