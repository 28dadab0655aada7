"""Arguments that docs promise of every example."""

from __future__ import annotations

from pathlib import Path

import pytest
from roslaunch import RLException
from roslaunch.config import load_config_default

LAUNCH_FILES = sorted((Path(__file__).parents[3] / "src/rpbi_examples/launch").glob("*.launch"))
SCENES = [path for path in LAUNCH_FILES if "include/scene.launch" in path.read_text()]
SWINGING = [path for path in LAUNCH_FILES if "include/swinging_robot.launch" in path.read_text()]
WITHOUT_WORLD = ("mvn", "foxglove")
GIVEN = ["start:=false", "real_time_factor:=0.5", "gui:=true", "headless:=true"]


def load(path, *given):
    return load_config_default([(str(path), list(given))], None, assign_machines=False)


@pytest.mark.parametrize("path", LAUNCH_FILES, ids=lambda path: path.stem)
def test_every_example_hands_them_to_its_simulators(path):
    if path.stem in WITHOUT_WORLD:
        assert "simulator.launch" not in path.read_text()
        return
    given = [*GIVEN, "config:=world.yaml"] if path.stem == "world" else GIVEN
    loaded = load(path, *given)
    simulators = [node for node in loaded.nodes if node.package == "ros_pybullet_interface"]
    assert len(simulators) == (2 if path.stem == "tracking_example" else 1)
    for node in simulators:
        config = f"{node.namespace}{node.name}/config/"
        assert {
            name.removeprefix(config): each.value for name, each in loaded.params.items() if name.startswith(config)
        } == {
            "start_pybullet_after_initialization": False,
            "real_time_factor": 0.5,
            "connect/connection_mode": "GUI",
            **({"tf_prefix": node.namespace.strip("/")} if node.namespace != "/" else {}),
        }


def test_a_scene_of_ones_own_has_a_world_anywhere():
    path = LAUNCH_FILES[0].parent / "include/scene.launch"
    given = ["scene:=my_lab.lift:Lift", "config:={my_lab}/lift.yaml", "rviz_config:=lift.rviz", "rviz:=true"]
    loaded = load(path, *given)
    values = {name: each.value for name, each in loaded.params.items()}
    assert values["/ros_pybullet_interface/config_file"] == "{my_lab}/lift.yaml"
    assert values["/scene/scene"] == "my_lab.lift:Lift"
    assert any("lift.rviz" in node.args for node in loaded.nodes if node.package == "rviz")


def test_own_real_robot_needs_only_a_folder_and_a_urdf(tmp_path):
    real_robot = LAUNCH_FILES[0].parent / "include/real_robot.launch"
    for file in (real_robot.parents[2] / "configs/real_robot/kuka_lwr").iterdir():
        (tmp_path / file.name).write_text(file.read_text().replace("period_s: 0.009", "period_s: 0.0031"))
    given = ["robot:=my_arm", "stand_in:=true", f"config_folder:={tmp_path}"]
    loaded = load(real_robot, *given, "description:={rpbi_examples}/robots/ur5e.urdf")
    values = {name: each.value for name, each in loaded.params.items()}
    assert '<robot name="ur5e">' in values["/real_robot/guard/robot_description"]
    assert values["/real_robot/guard/period_s"] == 0.0031
    assert values["/stand_in/ros_pybullet_interface/config_file"] == f"{tmp_path}/world.yaml"
    (remapped,) = (dict(node.remap_args) for node in loaded.nodes if node.name == "guard")
    assert "/rpbi/my_arm/joint_states" in remapped.values()
    with pytest.raises(RLException, match="description:=URDF is missing"):
        load(real_robot, *given)


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_scene_and_world_end_together(path):
    required = {node.name for node in load(path, "headless:=true").nodes if node.required}
    assert required >= {"scene", "ros_pybullet_interface"}


@pytest.mark.parametrize("path", SWINGING, ids=lambda path: path.stem)
@pytest.mark.parametrize(
    ("given", "swings"), [((), True), (("controls:=true",), False), (("controls:=true", "move:=true"), True)]
)
def test_robot_with_sliders_swings_only_on_request(path, given, swings):
    names = {node.name for node in load(path, "headless:=false", *given).nodes}
    assert ("basic_robot_example" in names, "rpbi_controls_node" in names) == (swings, bool(given))


def test_scenes_and_robots_that_swing_are_found():
    assert (len(SCENES), len(SWINGING)) == (7, 4)
