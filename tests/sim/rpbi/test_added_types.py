"""A new type of body takes four places: its file, a line in the table, an example, a test. So does a new sensor."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[3]
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
"""How high a body is."""

from __future__ import annotations

from typing import NamedTuple

from .sensor import BodySensor


class HeightSample(NamedTuple):
    """Height of the base [m] above the ground of the sensor `name`."""

    name: str
    height: float


class HeightSensor(BodySensor):
    """Tells how high a body is."""

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
NEW_FILES = {
    "rpbi/bodies/marble.py": BODY_FILE,
    "marble.yaml": "{name: marble, radius: 0.05, sensors: [{type: height, name: height, hz: 50}]}",
    "rpbi/sensors/height.py": SENSOR_FILE,
    "rpbi/ros/publishers/height.py": TOPIC_FILE,
}
"""For the body its file and an example, for the sensor its file and its topic."""
NEW_LINES = {
    "rpbi/bodies/__init__.py": ('        "dynamic": ', '        "marble": "rpbi.bodies.marble:Marble",\n'),
    "rpbi/sensors/__init__.py": ('        "base_state": ', '        "height": "rpbi.sensors.height:HeightSensor",\n'),
}
"""One line of a table each, and the line before which it goes. This test is the fourth place."""
PROGRAM = """
import json, pathlib, rpbi
assert pathlib.Path(rpbi.__file__).parent == pathlib.Path.cwd() / "rpbi"
from rpbi.config.schemas import file_schemas, schemas
from rpbi.reference.config_page import config_page
from rpbi.ros.publishers.sample_topics import sample_topic
from rpbi.ros.reference.interface_page import interface_page
from rpbi.ros.reference.reference_world import reference_world
from rpbi.world import World

world = World.from_file("world.yaml")
samples = [sample for _ in range(50) for sample in world.step() if type(sample).__name__ == "HeightSample"]
(sensor,) = world.sensors_of("marble")
topic = sample_topic(sensor)
print(json.dumps({
    "heights": [sample.height for sample in samples],
    "topic": topic.name.format(name=sensor.name),
    "message": topic.handler(samples[0], 1).data,
    "entries": schemas()["world"]["properties"]["marbles"]["items"],
    "schema": schemas()["marble"],
    "config_page": config_page(file_schemas(), {}, {}),
    "interface_page": interface_page(reference_world(), {}),
}))
"""


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a copy of the package that has one type of body and of sensor more."""
    folder = tmp_path_factory.mktemp("workspace")
    shutil.copytree(ROOT / "src/ros_pybullet_interface/src/rpbi", folder / "rpbi")
    for path, text in NEW_FILES.items():
        (folder / path).write_text(text.lstrip("\n"))
    for path, (before, line) in NEW_LINES.items():
        text = (folder / path).read_text()
        assert text.count(before) == 1
        (folder / path).write_text(text.replace(before, line + before))
    write_world(folder, "marbles")
    return folder


def write_world(folder: Path, section: str) -> None:
    """Writes the main file."""
    main: dict[str, Any] = {"connect": {"connection_mode": "DIRECT"}, "timeStep": 0.01, "setGravity": {"gravZ": -9.81}}
    main[section] = ["marble.yaml"]
    (folder / "world.yaml").write_text(json.dumps(main))


def run(workspace: Path, program: str) -> subprocess.CompletedProcess[str]:
    """Runs a program with the copy."""
    environment = {**os.environ, "PYTHONPATH": f"{workspace}:{os.environ['PYTHONPATH']}"}
    command = [sys.executable, "-c", program]
    return subprocess.run(command, cwd=workspace, env=environment, capture_output=True, text=True)


@pytest.fixture(scope="module")
def told(workspace: Path) -> dict[str, Any]:
    """What a world with the new types, schemas and pages say."""
    done = run(workspace, PROGRAM)
    assert done.returncode == 0, done.stderr
    return dict(json.loads(done.stdout.splitlines()[-1]))


def test_world_moves_the_new_body_and_reads_the_new_sensor(told: dict[str, Any]) -> None:
    heights = told["heights"]
    assert len(heights) == 25
    assert heights[0] == pytest.approx(1.0, abs=0.01)
    assert all(later < earlier for earlier, later in zip(heights, heights[1:]))


def test_sample_has_its_topic(told: dict[str, Any]) -> None:
    assert told["topic"] == "rpbi/marble/height"
    assert told["message"] == told["heights"][0]


def test_schemas_and_pages_have_the_new_types(told: dict[str, Any]) -> None:
    assert told["entries"]["anyOf"][1] == {"$ref": "marble.schema.json#/$defs/entry"}
    assert told["schema"]["properties"]["radius"]["unit"] == "m"
    assert told["schema"]["required"] == ["name", "radius"]
    assert "| `marbles` | list of files, each [marble](#marble) |" in told["config_page"]
    assert "| `radius` | number > 0 [m] | required | Radius of the marble. |" in told["config_page"]
    assert "| `rpbi/NAME/height` | std_msgs/Float64 | Height of the base [m]. | marble |" in told["interface_page"]


def test_mistakes_in_the_new_section_are_told_like_all(workspace: Path) -> None:
    write_world(workspace, "marble")
    done = run(workspace, "from rpbi.world import World; World.from_file('world.yaml')")
    assert "world.yaml: marble: unknown key 'marble'; did you mean 'marbles'?" in done.stderr
