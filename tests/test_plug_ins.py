"""The files that are written by hand to add a plug-in or a command; look-up, schemas, pages and completion follow.

One of each is added to a copy of the packages. This file stands for the test that each has too.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = (
    *("custom_ros_tools", "ros_pybullet_interface", "operator_node", "ik_ros"),
    *("rpbi_data", "rpbi_utils", "rpbi_examples"),
)
BODY_FILE = '''
"""A ball."""

from __future__ import annotations

from pydantic import Field

from custom_ros_tools.schema import Kilograms, PositiveMetres
from rpbi.engine.client import Client

from .body import Body
from .body_config import BodyConfig


class MarbleConfig(BodyConfig):
    """A marble: a ball that begins a metre above the ground."""

    radius: PositiveMetres = Field(description="Radius of the marble.")
    mass: Kilograms = Field(0.01, description="Its mass.")


class Marble(Body):
    """A ball."""

    Config = MarbleConfig
    section = "marbles"
    example = {"radius": 0.02, "sensors": [{"type": "height", "name": "height", "hz": 10.0}]}

    def __init__(self, pb: Client, config: MarbleConfig) -> None:
        shape = pb.createCollisionShape(pb.GEOM_SPHERE, radius=config.radius)
        super().__init__(pb, config.name, pb.createMultiBody(config.mass, shape, basePosition=(0.0, 0.0, 1.0)))
'''
SENSOR_FILE = '''
"""Height of bodies."""

from __future__ import annotations

from typing import NamedTuple

from .sensor import BodySensor


class HeightSample(NamedTuple):
    """Height of the base [m] above the ground of the sensor `name`."""

    name: str
    height: float


class HeightSensor(BodySensor):
    """Height of a body."""

    sample_type = HeightSample
    ros_topic = "rpbi.ros.publishers.height:TOPIC"

    def read(self, tick: int) -> HeightSample:
        """Reads the height."""
        return HeightSample(self.name, self.body.base_pose().position[2])
'''
TOPIC_FILE = '''
"""The topic of heights."""

from __future__ import annotations

from std_msgs.msg import Float64

from rpbi.ros.endpoints import Topic

TOPIC = Topic("rpbi/{name}", Float64, lambda sample, _: Float64(sample.height), "Height of the base [m].")
'''
DEVICE_FILE = '''
"""A pedal."""

from pydantic import Field

from custom_ros_tools.schema import ConfigModel, Fraction
from operator_node.device import Device, Reading


class PedalConfig(ConfigModel):
    """Options of a pedal."""

    dead_travel: Fraction = Field(0.1, description="Share of the way that does not count.")


class Pedal(Device):
    """A pedal that is pressed."""

    Config = PedalConfig
    axes = ("down",)
    buttons = ()

    def __init__(self, config: PedalConfig) -> None:
        self.config = config

    def open(self) -> None:
        """There is nothing to open."""

    def read(self, timeout_s: float) -> Reading | None:
        return self.at_rest()

    def close(self) -> None:
        """There is nothing to close."""
'''
FORMAT_FILE = '''
"""Data sets that count episodes."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pydantic import Field

from custom_ros_tools.schema import ConfigModel, Count
from rpbi_data.datasets.format import DatasetFormat, ExportedEpisode, Schema

FILE = "tally.txt"


class TallyConfig(ConfigModel):
    """Options of a tally."""

    first: Count = Field(0, description="Number to which episodes are added.")


class Tally(DatasetFormat):
    """The number of episodes in a file."""

    Config = TallyConfig
    has_rows = False
    content = f"{FILE} (tally)"

    def open(self, folder: Path, schema: Schema | None) -> None:
        self._folder, self._count = folder, self.config.first

    def add(self, index: int, episode: ExportedEpisode) -> dict[str, Any]:
        self._count += 1
        return {}

    def close(self) -> None:
        (self._folder / FILE).write_text(str(self._count))

    @classmethod
    def recognises(cls, folder: Path) -> bool:
        return (folder / FILE).exists()

    @classmethod
    def faults(cls, folder: Path) -> Iterator[str]:
        if not (folder / FILE).read_text().isdecimal():
            yield f"{FILE}: expected a number"

    @classmethod
    def summary(cls, folder: Path) -> str:
        return f"tally: {(folder / FILE).read_text()} episodes"
'''
GYM_TASK_FILE = '''
"""The task `rest`."""

from collections.abc import Sequence

from pydantic import Field

from custom_ros_tools.schema import Name
from rpbi.gym.actions import ActionPart
from rpbi.gym.task import WorldTask, WorldTaskConfig


class RestConfig(WorldTaskConfig):
    """Options of the task `rest`."""

    object: Name = Field(description="The body that has to be at rest.")


class RestTask(WorldTask):
    """Waits until a body is at rest."""

    Config = RestConfig

    def actions(self) -> Sequence[ActionPart]:
        return []

    def reward(self) -> float:
        return 0.0

    def has_succeeded(self) -> bool:
        return max(map(abs, self.world.bodies[self.config.object].base_velocity().linear)) < 1e-3
'''
SCENE_FILE = '''
"""A robot that does nothing."""

from collections.abc import Iterator

from .scene import Scene, Watched


class Siesta(Scene):
    """A robot rests, which always succeeds."""

    world = "{rpbi_examples}/configs/siesta/config.yaml"
    watch = Watched(robots=("kuka",))

    def act(self) -> Iterator[None]:
        yield

    def has_succeeded(self) -> bool:
        return True
'''
SOLVER_FILE = '''
"""The solver that stays where it is."""

from custom_ros_tools.schema import ConfigModel
from ik_ros.problem import IKProblem, IKSolution
from ik_ros.solver import Solver


class LazyConfig(ConfigModel):
    """Options of the solver `lazy`."""


class LazySolver(Solver):
    """Returns the start of the search."""

    Config = LazyConfig
    deterministic = True

    def __init__(self, config: LazyConfig) -> None:
        self.joint_names = ()

    def solve(self, problem: IKProblem) -> IKSolution:
        return IKSolution(True, "at the start", tuple(problem.start), tuple(problem.start.values()))
'''
COMMAND_FILE = '''
"""The command `wave`."""

from typing import Annotated

from custom_ros_tools.console.argument import Argument, number


def wave(
    name: Annotated[str, Argument("NAME", offers="objects")],
    *,
    hand: Annotated[str, Argument("HAND", choices=lambda: ("left", "right"))] = "left",
    angle: Annotated[float, Argument("RAD", parse=number)] = 0.5,
) -> str:
    """Waves at a person.

        ./rpbi wave Ada --hand right

    Args:
        NAME: the greeted person
        hand: {choices}; left without it
        angle: how far [rad], or as 30deg
    """
    return f"{hand} hand waves at {name} by {angle:.3f} rad"
'''
RPBI, OPERATOR = "src/ros_pybullet_interface/src/rpbi", "src/operator_node/src/operator_node"
FORMATS, TASKS = "src/rpbi_data/src/rpbi_data/datasets/formats", f"{RPBI}/gym/tasks"
SCENES, SOLVERS = "src/rpbi_examples/src/rpbi_examples/scenes", "src/ik_ros/src/ik_ros/solvers"
FILES = {
    "body": {
        f"{RPBI}/bodies/marble.py": BODY_FILE,
        "marble.yaml": "{name: marble, radius: 0.05, sensors: [{type: height, name: height, hz: 50}]}",
    },
    "sensor": {f"{RPBI}/sensors/height.py": SENSOR_FILE, f"{RPBI}/ros/publishers/height.py": TOPIC_FILE},
    "device": {f"{OPERATOR}/devices/pedal.py": DEVICE_FILE, "docs/devices.md": "| `pedal` | its axis `down` |"},
    "format": {f"{FORMATS}/tally.py": FORMAT_FILE, "docs/datasets.md": "| `tally` | a number |"},
    "gym task": {f"{TASKS}/rest.py": GYM_TASK_FILE, "docs/gym.md": "| `rest` | waits |"},
    "scene": {f"{SCENES}/siesta.py": SCENE_FILE, "docs/examples.md": "| `siesta` | a robot rests |"},
    "solver": {f"{SOLVERS}/lazy.py": SOLVER_FILE, "docs/ik.md": "| `lazy` | stays at the start |"},
    "command": {"src/rpbi_utils/src/rpbi_utils/console/wave.py": COMMAND_FILE},
}
"""Files written by hand: a class each, and the example of the body, the topic of the sensor, the page of all others.

The world, launch file and view of a scene, and the options of a gym task or a solver, are found by its name.
"""
LINES = {
    "body": (f"{RPBI}/bodies/__init__.py", '        "dynamic": ', '        "marble": "rpbi.bodies.marble:Marble",\n'),
    "sensor": (
        f"{RPBI}/sensors/__init__.py",
        '        "base_state": ',
        '        "height": "rpbi.sensors.height:HeightSensor",\n',
    ),
    "device": (
        f"{OPERATOR}/devices/__init__.py",
        '        "spacenav": ',
        '        "pedal": "operator_node.devices.pedal:Pedal",\n',
    ),
    "format": (
        f"{FORMATS}/__init__.py",
        '        "mcap": ',
        '        "tally": "rpbi_data.datasets.formats.tally:Tally",\n',
    ),
    "gym task": (f"{TASKS}/__init__.py", '        "peg": ', '        "rest": "rpbi.gym.tasks.rest:RestTask",\n'),
    "scene": (
        f"{SCENES}/__init__.py",
        '        "wiping": ',
        '        "siesta": "rpbi_examples.scenes.siesta:Siesta",\n',
    ),
    "solver": (f"{SOLVERS}/__init__.py", '        "kdl": ', '        "lazy": "ik_ros.solvers.lazy:LazySolver",\n'),
}
"""A line of a table, and the line before which it goes."""
BY_HAND = {"body": 4, "sensor": 4, "device": 4, "format": 4, "gym task": 4, "scene": 4, "solver": 4, "command": 2}
"""Files that are written by hand, with the test."""
PROGRAM = """
import json, pathlib, sys
import ik_ros, operator_node, rpbi, rpbi_data, rpbi_examples, rpbi_utils
root = pathlib.Path.cwd()
for package in (ik_ros, operator_node, rpbi, rpbi_data, rpbi_examples, rpbi_utils):
    assert pathlib.Path(package.__file__).is_relative_to(root), package.__file__
from custom_ros_tools.console.docs import console_files
from ik_ros.node_configs import schemas as solver_schemas
from ik_ros.solvers import SOLVERS
from operator_node.devices import DEVICES
from rpbi.gym.schemas import schemas as task_schemas
from rpbi.world.schemas import file_schemas, schemas
from rpbi.reference.config_page import config_pages
from rpbi.ros.publishers.sample_topics import sample_topic
from rpbi.ros.interface_page import interface_page
from rpbi.reference.reference_world import reference_world
from rpbi.world import World
from rpbi_examples.gym import ENVIRONMENTS, SCENE_ENVIRONMENTS
from rpbi_examples.plugins_page import plugins_page
from rpbi_utils.console.spawn import kind_in, kinds

world = World.from_file("world.yaml")
samples = [sample for _ in range(50) for sample in world.step() if type(sample).__name__ == "HeightSample"]
(sensor,) = world.sensors_of("marble")
topic = sample_topic(sensor)
for path, text in console_files(root).items():
    path.write_text(text)
print(json.dumps({
    "heights": [sample.height for sample in samples],
    "topic": topic.name.format(name=sensor.name),
    "message": topic.handler(samples[0], 1).data,
    "entries": schemas()["world"]["properties"]["marbles"]["items"],
    "schema": schemas()["marble"],
    "config_pages": config_pages(file_schemas(), {}, {}),
    "interface_page": interface_page(reference_world(), {}),
    "plugins_page": plugins_page(),
    "spawned": [kind_in({"name": "a", "radius": 1.0}), *kinds()],
    "dead_travel": DEVICES.make("pedal", {"dead_travel": 0.2}).config.dead_travel,
    "environments": [ENVIRONMENTS.get("rpbi/Rest-v0"), SCENE_ENVIRONMENTS.get("rpbi/Siesta-v0")],
    "task_schema": task_schemas()["gym_rest"],
    "solver_schema": solver_schemas()["lazy"],
    "solver": SOLVERS.make("lazy", {}).deterministic,
    "device_schema": DEVICES.schemas()["pedal"]["properties"],
}))
"""


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a copy of the packages that has one plug-in of each kind and a command more."""
    folder = tmp_path_factory.mktemp("workspace")
    for package in PACKAGES:
        others = shutil.ignore_patterns("__pycache__")  # whose files come and go while other tests run
        shutil.copytree(ROOT / "src" / package / "src", folder / "src" / package / "src", ignore=others)
    for name in ("dev/tools", "docs"):
        (folder / name).mkdir(parents=True)
    for name in ("rpbi", "dev/tools/completion.bash"):
        shutil.copy(ROOT / name, folder / name)
    for files in FILES.values():
        for name, text in files.items():
            (folder / name).write_text(text.lstrip("\n"))
    for name, before, line in LINES.values():
        text = (folder / name).read_text()
        assert text.count(before) == 1
        (folder / name).write_text(text.replace(before, line + before))
    write_world(folder, "marbles")
    return folder


def write_world(folder: Path, section: str) -> None:
    """Writes the main file."""
    main: dict[str, Any] = {"connect": {"connection_mode": "DIRECT"}, "timeStep": 0.01, "setGravity": {"gravZ": -9.81}}
    main[section] = ["marble.yaml"]
    (folder / "world.yaml").write_text(json.dumps(main))


def run(workspace: Path, *command: str) -> subprocess.CompletedProcess[str]:
    """Runs a command with the copy."""
    copies = [str(workspace / "src" / package / "src") for package in PACKAGES]
    environment = {**os.environ, "PYTHONPATH": ":".join([*copies, os.environ["PYTHONPATH"]])}
    return subprocess.run(command, cwd=workspace, env=environment, capture_output=True, text=True)


@pytest.fixture(scope="module")
def found(workspace: Path) -> dict[str, Any]:
    """Values from a world with the new types, from look-up, schemas and pages."""
    done = run(workspace, sys.executable, "-c", PROGRAM)
    assert done.returncode == 0, done.stderr
    return dict(json.loads(done.stdout.splitlines()[-1]))


@pytest.mark.parametrize("kind", BY_HAND)
def test_no_more_files_are_written_by_hand(kind: str) -> None:
    assert len(FILES[kind]) + (kind in LINES) + 1 == BY_HAND[kind]


def test_world_moves_the_new_body_and_reads_the_new_sensor(found: dict[str, Any]) -> None:
    heights = found["heights"]
    assert len(heights) == 25
    assert heights[0] == pytest.approx(1.0, abs=0.01)
    assert all(later < earlier for earlier, later in zip(heights, heights[1:]))


def test_sample_has_its_topic(found: dict[str, Any]) -> None:
    assert found["topic"] == "rpbi/marble/height"
    assert found["message"] == found["heights"][0]


def test_schemas_and_pages_have_the_new_types(found: dict[str, Any]) -> None:
    assert found["entries"]["anyOf"][1] == {"$ref": "marble.schema.json#/$defs/entry"}
    assert found["schema"]["properties"]["radius"]["unit"] == "m"
    assert found["schema"]["required"] == ["name", "radius"]
    assert (
        "| `marbles` | list of files, each [marble](config_objects.md#marble) |"
        in found["config_pages"]["config_world.md"]
    )
    assert (
        "| `radius` | number > 0 [m] | required | Radius of the marble. |" in found["config_pages"]["config_objects.md"]
    )
    assert "| `rpbi/NAME/height` | std_msgs/Float64 | Height of the base [m]. | marble |" in found["interface_page"]
    assert "| `marble` | A ball. |" in found["plugins_page"]
    assert "| `height` | Height of a body. |" in found["plugins_page"]


def test_console_knows_the_new_body(found: dict[str, Any], workspace: Path) -> None:
    kind, *kinds = found["spawned"]
    assert kind == "marble" and "marble" in kinds
    assert "marble" in completed(workspace, "spawn", "--type")


def test_device_is_looked_up_made_and_explained(found: dict[str, Any]) -> None:
    assert found["dead_travel"] == 0.2
    assert found["device_schema"]["dead_travel"]["default"] == 0.1
    assert "| `pedal` | A pedal that is pressed. |" in found["plugins_page"]


def test_format_is_listed_and_checks_data_sets(found: dict[str, Any], workspace: Path) -> None:
    assert "| `tally` | The number of episodes in a file. |" in found["plugins_page"]
    assert "robomimic, tally or mcap, or module:Class" in run(workspace, "./rpbi", "export", "--help").stdout
    assert "tally" in completed(workspace, "export", "--to")
    folder = workspace / "set"
    folder.mkdir()
    console = [sys.executable, str(ROOT / "devel/lib/custom_ros_tools/console"), "check_dataset", "set"]
    assert "tally.txt (tally)" in run(workspace, *console).stderr
    (folder / "tally.txt").write_text("3")
    assert run(workspace, *console).stdout.startswith("tally: 3 episodes: no fault")


def test_gym_task_is_an_environment_with_a_schema(found: dict[str, Any]) -> None:
    assert "| `rest` | Waits until a body is at rest. |" in found["plugins_page"]
    assert found["environments"][0] == "rest"
    assert found["task_schema"]["properties"]["type"]["enum"] == ["rest"]
    assert "object" in found["task_schema"]["required"]


def test_scene_is_an_environment_that_score_offers(found: dict[str, Any], workspace: Path) -> None:
    assert "| `siesta` | A robot rests, which always succeeds. |" in found["plugins_page"]
    assert found["environments"][1] == "siesta"
    assert "cup, siesta, wiping" in run(workspace, "./rpbi", "score", "--help").stdout
    assert "siesta" in completed(workspace, "score")


def test_solver_is_made_by_its_name_and_has_a_schema(found: dict[str, Any]) -> None:
    assert "| `lazy` | Returns the start of the search. |" in found["plugins_page"]
    assert found["solver"] is True
    assert found["solver_schema"]["title"] == "lazy"


@pytest.mark.usefixtures("found")
def test_command_has_help_and_a_section_and_runs(workspace: Path) -> None:
    section = """\
    ./rpbi wave NAME [--hand HAND] [--angle RAD]

Waves at a person.

    NAME             the greeted person
    --hand HAND      left or right; left without it
    --angle RAD      how far [rad], or as 30deg

    ./rpbi wave Ada --hand right
"""
    assert f"\n## wave\n\n{section}\n## " in (workspace / "docs/commands.md").read_text()
    assert run(workspace, "./rpbi", "wave", "--help").stdout == section
    assert re.search(r"^  wave +Waves at a person\.$", run(workspace, "./rpbi").stdout, re.MULTILINE)
    console = [sys.executable, str(ROOT / "devel/lib/custom_ros_tools/console"), "wave"]
    assert run(workspace, *console, "--help").stdout == section
    done = run(workspace, *console, "Ada", "--hand", "right", "--angle", "-30deg")
    assert (done.returncode, done.stdout, done.stderr) == (0, "right hand waves at Ada by -0.524 rad\n", "")
    done = run(workspace, *console, "Ada", "--hand", "middle")
    assert done.returncode == 2
    assert done.stderr.endswith("--hand: invalid choice: 'middle' (choose from 'left', 'right')\n")


@pytest.mark.usefixtures("found")
def test_command_is_completed(workspace: Path) -> None:
    assert "wave" in completed(workspace)
    assert completed(workspace, "wave", "--hand") == {"left", "right"}
    assert completed(workspace, "wave", word="--") == {"--help", "--hand", "--angle"}


def completed(workspace: Path, *words: str, word: str = "") -> set[str]:
    """Returns the words that bash offers after others."""
    script = 'source dev/tools/completion.bash; _rpbi_words "$PWD" "$@"'
    done = run(workspace, "bash", "-c", script, "bash", word, "rpbi", *words)
    return set(done.stdout.split())


def test_mistakes_in_the_new_section_are_reported_like_all(workspace: Path) -> None:
    write_world(workspace, "marble")
    done = run(workspace, sys.executable, "-c", "from rpbi.world import World; World.from_file('world.yaml')")
    assert "world.yaml: marble: unknown key 'marble'; did you mean 'marbles'?" in done.stderr
