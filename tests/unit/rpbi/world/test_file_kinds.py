"""A file that is named in a place for another kind is reported with the place where it belongs."""

from __future__ import annotations

import pytest
from worlds import BOX_FLOOR, box, iiwa, write_world

from custom_ros_tools.errors import ConfigError
from rpbi.world.loading import load_world

VISUAL = {"name": "mark", "createVisualShape": {"shapeType": "GEOM_SPHERE", "radius": 0.1}}
THING = {"name": "thing", "loadURDF": {"fileName": "cube.urdf"}}
LISTED = {
    ("dynamic", "robot"): (iiwa("robot"), "is a robot, not a dynamic object: list it under robots"),
    ("urdfs", "robot"): (iiwa("robot"), "is a robot, not a URDF object: list it under robots"),
    ("dynamic", "thing"): (THING, "is a URDF object, not a dynamic object: list it under urdfs"),
    ("robots", "box"): (box(), "is a dynamic object, not a robot: list it under dynamic_objects"),
    ("collision", "box"): (box(), "is a dynamic object, not a collision object: list it under dynamic_objects"),
    ("dynamic", "main"): ({"timeStep": 0.01, "robots": []}, "is a world, not a dynamic object"),
}
MAIN = {
    "box.yaml": "is an object file (dynamic object), not a world: list it under dynamic_objects of a world, see "
    "docs/worlds.md",
    "arm.urdf": "is a URDF, not a world: name it in an object file, as loadURDF: {fileName: FILE}, and list that under "
    "robots or urdfs",
    "arm.launch": "is a launch file, not a world",
}


def problems(path: str) -> list[str]:
    with pytest.raises(ConfigError) as caught:
        load_world(path)
    return [problem.message for problem in caught.value.problems]


@pytest.mark.parametrize(("section", "name"), LISTED)
def test_an_object_in_the_wrong_list_is_one_problem(tmp_path, section, name):
    content, message = LISTED[section, name]
    assert problems(write_world(tmp_path, **{section: ({"name": name, **content},)})) == [
        message,
    ]


def test_files_that_are_no_worlds_are_named(tmp_path):
    write_world(tmp_path, dynamic=(box(),))
    (tmp_path / "arm.urdf").write_text("<?xml version='1.0'?>\n<!-- an arm -->\n<robot name='arm'>\n\t<link/></robot>")
    (tmp_path / "arm.launch").write_text("<launch><node name='robot'/></launch>")
    for name, message in MAIN.items():
        assert problems(str(tmp_path / name)) == [message]
    (tmp_path / "world.yaml").write_text("robots: [arm.urdf]")
    (told,) = problems(str(tmp_path / "world.yaml"))
    assert told == "is a URDF, not an object file: name it in an object file, as loadURDF: {fileName: FILE}"
    (tmp_path / "odd.yaml").write_text("<other/>")
    assert problems(str(tmp_path / "odd.yaml")) == ["expected a mapping of keys to values, got str"]


def test_wrong_key_in_the_right_list_is_reported(tmp_path):
    (told,) = problems(write_world(tmp_path, dynamic=({**box(), "radius": 1.0},)))
    assert told.startswith("unknown key 'radius'")
    assert load_world(write_world(tmp_path, visual=(VISUAL,), collision=(BOX_FLOOR,))).objects
