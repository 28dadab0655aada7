"""A world that cannot be built: all that is wrong is told at once, and nothing stays behind."""

from __future__ import annotations

import os

import pytest
import rospy
from node_world import Rosout, main_config, registrations
from worlds import ball, box, iiwa, write_world

NODE = "/ros_pybullet_interface"


@pytest.fixture
def fails(ros):
    """Starts the node, waits until it has given up, and returns the lines that it says about the problems."""

    def start(config):
        rosout = Rosout(ros)
        process = ros.simulator(config, wait=False)
        assert process.wait(60.0) == 1, ros.output(process)
        printed = ros.output(process)
        assert "Traceback" not in printed
        assert _of_group(process.pid) == [], "a process is left"
        assert registrations() == []
        lines = [line.split("]: ", 1)[1] for line in printed.splitlines() if line.startswith("[FATAL]")]
        assert lines, printed
        rosout.wait_for(lines)
        return lines

    return start


def _of_group(group):
    found = []
    for process_id in filter(str.isdigit, os.listdir("/proc")):
        try:
            if os.getpgid(int(process_id)) == group:
                found.append(int(process_id))
        except ProcessLookupError:
            pass
    return found


def _broken(tmp_path, text, name="broken.yaml"):
    (tmp_path / name).write_text(text)
    return str(tmp_path / name)


@pytest.mark.quick
def test_every_fault_of_every_file_is_reported_with_its_key(fails, tmp_path):
    config = main_config(
        tmp_path,
        dynamic=(
            ball("a", radius=0.1, baseMass=-1.0),  # unknown key, out of range
            {**box("b"), "createCollisionShape": {"shapeType": "GEOM_BOXX", "halfExtent": [1, 1, 1]}},
            {"name": "c", "createVisualShape": {"shapeType": "GEOM_MESH", "fileName": "none.obj"}},
        ),
        robots=(
            iiwa("d", joint_state_publisher_hz=-1, initial_joint_position={"lbr_iiwa_joint_1": "1e-3"}),
            {"name": "e", "loadURDF": {"fileName": "{no_such_package}/e.urdf"}},
        ),
        timeStep="0.001",
        setGravity={"gravZ": -9.81, "gravW": 0.0},
        real_time_facto=1.0,
    )
    config["dynamic_objects"] += [
        _broken(tmp_path, "name: f\n  baseMass: 1\n", "f.yaml"),
        _broken(tmp_path, "name: a\nbaseMass: .nan\nbasePosition: [.inf, 0, 0]\n", "g.yaml"),
        str(tmp_path / "none.yaml"),
    ]
    lines = fails(config)
    folder = str(tmp_path)
    for expected in (
        ("~config: timeStep: expected a number [s], got text '0.001'",),
        ("~config: setGravity.gravW: unknown key", "gravZ"),
        ("~config: real_time_facto: unknown key", "did you mean 'real_time_factor'"),
        ("~config: dynamic_objects[5]: no such file", "none.yaml"),
        (f"{folder}/a.yaml: radius: unknown key",),
        (f"{folder}/a.yaml: baseMass: must be > 0", "got -1"),
        (f"{folder}/b.yaml: createCollisionShape.shapeType: unknown shape type 'GEOM_BOXX'", "GEOM_BOX"),
        (f"{folder}/b.yaml: createCollisionShape.halfExtent: unknown key", "halfExtents"),
        (f"{folder}/c.yaml: createVisualShape.fileName: no such file: none.obj",),
        (f"{folder}/c.yaml: createCollisionShape: missing",),
        (f"{folder}/c.yaml: baseMass: missing",),
        (f"{folder}/d.yaml: joint_state_publisher_hz: must be >= 0 [Hz], got -1",),
        (f"{folder}/d.yaml: initial_joint_position.lbr_iiwa_joint_1: expected a number", "1.0e-3"),
        (f"{folder}/e.yaml: loadURDF.fileName: unknown ROS package 'no_such_package'",),
        (f"{folder}/e.yaml: setJointMotorControlArray: missing",),
        (f"{folder}/f.yaml: line 2, column 11:",),
        (f"{folder}/g.yaml: baseMass: ", "nan"),
        (f"{folder}/g.yaml: basePosition[0]: ", "inf"),
        (f"{folder}/g.yaml: name: 'a' is taken by {folder}/a.yaml",),
    ):
        matching = [line for line in lines if line.startswith(expected[0]) and all(part in line for part in expected)]
        assert len(matching) == 1, f"{expected} not among:\n" + "\n".join(lines)


def test_faults_found_only_by_pybullet_are_reported_for_all_objects(fails, tmp_path):
    (tmp_path / "half.stl").write_bytes(b"solid")
    (tmp_path / "broken.urdf").write_text("<robot name='r'><link name='a'>")
    mesh = "<visual><geometry><mesh filename='none.stl'/></geometry></visual>"
    (tmp_path / "bare.urdf").write_text(f"<robot name='r'><link name='a'>{mesh}</link></robot>")
    broken = {"loadURDF": {"fileName": str(tmp_path / "broken.urdf")}}
    bare = {"loadURDF": {"fileName": str(tmp_path / "bare.urdf")}}
    stl = {"shapeType": "GEOM_MESH", "fileName": str(tmp_path / "half.stl")}
    gains = {"controlMode": "POSITION_CONTROL", "positionGains": [1.0, 2.0], "velocityGains": [1.0, 2.0, 3.0]}
    config = main_config(
        tmp_path,
        dynamic=(ball("a", createCollisionShape=stl),),
        robots=(
            iiwa("b", initial_joint_position={"lbr_iiwa_joint_8": 1.0, "elbow": 2.0}, setJointMotorControlArray=gains),
            iiwa("c", **broken),
            iiwa("d", **bare),
            iiwa("e", loadURDF={"fileName": "robot_description"}),
        ),
    )
    lines = fails(config)
    folder = str(tmp_path)
    for expected in (
        (f"{folder}/a.yaml: createCollisionShape.fileName: expected a whole binary STL",),
        (f"{folder}/b.yaml: initial_joint_position.lbr_iiwa_joint_8: unknown joint", "did you mean"),
        (f"{folder}/b.yaml: initial_joint_position.elbow: unknown joint 'elbow'",),
        (f"{folder}/b.yaml: setJointMotorControlArray.positionGains: expected 1 number or 7", "got 2"),
        (f"{folder}/b.yaml: setJointMotorControlArray.velocityGains: expected 1 number or 7", "got 3"),
        (f"{folder}/c.yaml: loadURDF.fileName: {folder}/broken.urdf is not XML", "line 1"),
        (f"{folder}/d.yaml: loadURDF.fileName: {folder}/bare.urdf: no such mesh: none.stl",),
        (f"{folder}/e.yaml: loadURDF.fileName: there is no parameter 'robot_description'",),
    ):
        matching = [line for line in lines if line.startswith(expected[0]) and all(part in line for part in expected)]
        assert len(matching) == 1, f"{expected} not among:\n" + "\n".join(lines)
    assert len(lines) == 8


@pytest.mark.parametrize(
    ("config", "expected"),
    [
        ("a text", "~config: expected a mapping of keys to values, got str"),
        ({"connect": {"connection_mode": "DIRECTLY"}}, "unknown connection mode 'DIRECTLY'; did you mean 'DIRECT'?"),
        ({"connect": {"connection_mode": "SHARED_MEMORY", "key": 4711}}, "PyBullet did not connect"),
        ({"robots": "kuka.yaml"}, "~config: robots: expected a list"),
        ({"50% [\n": 1}, "~config: 50% [ : unknown key"),
    ],
    ids=["text", "mode", "no server", "no list", "odd characters"],
)
def test_a_main_configuration_that_is_none_is_refused(fails, config, expected):
    lines = fails(config)
    assert len(lines) == 1 and expected in lines[0], lines


def test_without_a_configuration_it_says_how_to_load_one(ros):
    if rospy.has_param(f"{NODE}/config"):
        rospy.delete_param(f"{NODE}/config")
    process = ros.start(["rosrun", "ros_pybullet_interface", "ros_pybullet_interface_node.py"])
    assert process.wait(60.0) == 1
    assert "~config: missing" in ros.output(process) and "rosparam" in ros.output(process)


def test_relative_files_in_a_parameter_ignore_the_current_folder(fails, tmp_path):
    write_world(tmp_path, dynamic=(ball(),))
    [line] = fails({"connect": {"connection_mode": "DIRECT"}, "dynamic_objects": ["ball.yaml"]})
    assert line.startswith("~config: dynamic_objects[0]: no such file: ball.yaml (looked in ")


@pytest.mark.parametrize(
    ("parameters", "expected"),
    [
        ({"config_file": 3}, "~config_file: expected a file name, got 3"),
        ({"config_file": "world.yaml", "config": [1]}, "~config: expected a mapping of keys to values, got list"),
        ({"config_file": "none.yaml"}, "none.yaml: no such file or directory"),
        ({"config_file": "world.yaml", "config": {"timeStep": -1.0}}, "world.yaml: timeStep: must be > 0"),
    ],
)
def test_invalid_or_misspelt_file_in_a_parameter_is_refused(ros, tmp_path, parameters, expected):
    write_world(tmp_path, dynamic=(ball(),))
    for name, value in {"working_directory": f"{tmp_path}\n", **parameters}.items():
        rospy.set_param(f"{NODE}/{name}", value)
    process = ros.start(["rosrun", "ros_pybullet_interface", "ros_pybullet_interface_node.py"])
    assert process.wait(60.0) == 1
    assert expected in ros.output(process)
    assert "Traceback" not in ros.output(process)


def test_names_that_would_clash_are_refused_as_check_does(fails, tmp_path):
    springs = {"joint_trajectory_controller": {"type": "joint_impedance", "active": False}}
    robot = iiwa("b", joint_trajectory_controller={}, controllers=springs)
    [line] = fails(main_config(tmp_path, robots=(robot,)))
    assert line.startswith("~config: the node publishes rpbi/b/joint_trajectory_controller/state as ")
