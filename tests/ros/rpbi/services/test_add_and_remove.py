"""Objects come and go by service: completely, or not at all and with the reason."""

from __future__ import annotations

import threading
import time

import pytest
import rospy
import yaml
from node_world import (
    add,
    count,
    main_config,
    objects,
    publishing,
    registrations,
    remove,
    resident_mb,
)
from ros_system import wait_until
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage
from worlds import FLOOR, ball, box, iiwa

from ros_pybullet_interface.msg import PybulletObject
from ros_pybullet_interface.srv import RobotInfo

VISUAL, COLLISION, DYNAMIC, ROBOT = (
    PybulletObject.VISUAL,
    PybulletObject.COLLISION,
    PybulletObject.DYNAMIC,
    PybulletObject.ROBOT,
)
FOLLOWER = {**FLOOR, "name": "follower", "object_tf": {"tf_id": "nowhere"}}
AT_START = {"floor": "collision", "follower": "collision", "ball": "dynamic", "iiwa": "robot"}


@pytest.fixture(scope="module")
def node(module_ros):
    folder = module_ros.folder
    (folder / "assets").mkdir()
    (folder / "assets" / "cube.obj").write_text(CUBE)
    config = main_config(
        folder,
        collision=(FLOOR, FOLLOWER),
        dynamic=(ball(broadcast_hz=50, basePosition=[1.5, 0.0, 0.1]),),
        robots=(iiwa(),),
        setAdditionalSearchPath=[str(folder / "assets")],
        timeStep=0.004,
    )
    return module_ros.simulator(config)


@pytest.fixture
def world(ros, node):
    """The simulator; it must be the same before and after the test."""
    before = _everything(ros, node)
    yield node
    assert _everything(ros, node) == before


def _everything(ros, node):
    assert node.poll() is None, ros.output(node)
    listed = objects(ros)
    ids = {name: _info(ros, name).bodyUniqueId for name, kind in listed.items() if kind == "robot"}
    return listed, ids, _frames(ros), registrations()


def _info(ros, name):
    return ros.call(f"/rpbi/{name}/robot_info", RobotInfo)


def _frames(ros):
    tf = ros.listen("/tf", TFMessage)
    messages = list(tf.wait_for(3))
    tf.close()  # else the next one would have this one's connection, with what is on its way there
    return sorted({transform.child_frame_id for message in messages for transform in message.transforms})


def _mesh(**shape):
    return box("meshed", createCollisionShape={"shapeType": "GEOM_MESH", **shape})


CUBE = """
v 0 0 0
v 1 0 0
v 0 1 0
v 0 0 1
f 1 3 2
f 1 2 4
f 1 4 3
f 2 3 4
"""


@pytest.mark.quick
@pytest.mark.parametrize(
    ("kind", "config", "type_name"),
    [
        (VISUAL, {key: FLOOR[key] for key in ("createVisualShape",)}, "visual"),
        (COLLISION, {key: FLOOR[key] for key in ("createVisualShape", "createCollisionShape")}, "collision"),
        (DYNAMIC, box(), "dynamic"),
        (ROBOT, iiwa(), "robot"),
    ],
    ids=["visual", "collision", "dynamic", "robot"],
)
def test_an_object_of_each_type_comes_and_goes(ros, world, kind, config, type_name):
    answer = add(ros, kind, {**config, "name": "new"})
    assert (answer.success, answer.message) == (True, "added 'new'")
    assert objects(ros) == {**AT_START, "new": type_name}
    answer = remove(ros, "new")
    assert (answer.success, answer.message) == (True, "removed 'new'")


def test_an_added_robot_lives_like_one_of_the_start(ros, world):
    load = {"fileName": "kuka_iiwa/model.urdf", "useFixedBase": True, "basePosition": [0.0, 3.0, 0.0]}
    assert add(ros, ROBOT, iiwa("new", loadURDF=load)).success
    states = ros.listen("/rpbi/new/joint_states", JointState)
    states.wait_for(5)
    assert _info(ros, "new").numJoints == 7
    with publishing("/rpbi/new/joint_states/target", JointState) as target:
        target.publish(JointState(name=["lbr_iiwa_joint_4"], position=[0.4]))
        wait_until(lambda: abs(states.messages[-1].position[3] - 0.4) < 0.02, "it obeys")
    assert remove(ros, "new").success
    assert not [entry for entry in registrations() if "/new/" in entry[1]]


def test_a_file_wins_over_a_text(ros, world):
    path = ros.write_yaml("from_file.yaml", box("from_file"))
    assert add(ros, DYNAMIC, box("from_text"), filename=path).message == "added 'from_file'"
    assert remove(ros, "from_file").success


def test_a_file_may_be_named_by_package(ros, world):
    answer = add(ros, COLLISION, filename="{rpbi_examples}/configs/floor.yaml")
    assert not answer.success and "'floor' is taken" in answer.message, answer.message


def test_files_named_in_a_text_are_found_in_search_paths(ros, world):
    assert add(ros, DYNAMIC, _mesh(fileName="cube.obj")).success
    assert remove(ros, "meshed").success


def test_files_named_in_a_file_are_found_next_to_it(ros, world):
    (ros.folder / "tetrahedron.obj").write_text(CUBE)
    path = ros.write_yaml("meshed.yaml", _mesh(fileName="tetrahedron.obj"))
    assert add(ros, DYNAMIC, filename=path).success
    assert remove(ros, "meshed").success


def _urdf(ros, body):
    path = ros.folder / "robot.urdf"
    path.write_text(body)
    return {"loadURDF": {"fileName": str(path)}}


REFUSED = {
    "neither file nor text": (DYNAMIC, "", "", ["expected a filename or a config; got neither"]),
    "unknown type": (77, box(), "", ["object_type: expected one of 0 (visual_objects)", "got 77"]),
    "soft body in a world of rigid ones": (
        PybulletObject.SOFT,
        {"name": "cloth", "loadSoftBody": {"fileName": "cloth_z_up.obj"}},
        "",
        ["soft bodies need resetSimulation: {flags: RESET_USE_DEFORMABLE_WORLD} in the main file"],
    ),
    "no such file": (DYNAMIC, "", "/none/box.yaml", ["no such file: /none/box.yaml"]),
    "file without a folder": (DYNAMIC, "", "none.yaml", ["no such file: none.yaml (looked in "]),
    "file in an unknown package": (DYNAMIC, "", "{rpbi_exampels}/box.yaml", ["did you mean 'rpbi_examples'"]),
    "no YAML by its name": (DYNAMIC, "", "/etc/shadow", ["filename: expected the name of a YAML file (.yaml, .yml)"]),
    "a file of the kernel": (DYNAMIC, "", "/proc/kmsg", ["filename: expected the name of a YAML file (.yaml, .yml)"]),
    "a mesh of the kernel": (
        DYNAMIC,
        box(createCollisionShape={"shapeType": "GEOM_MESH", "fileName": "/proc/kmsg"}),
        "",
        ["createCollisionShape.fileName: expected an ordinary file, got /proc/kmsg"],
    ),
    "aliases without end": (
        DYNAMIC,
        "k0: &a0 {y: 1}\n" + "\n".join(f"k{n}: &a{n} {{<<: [*a{n - 1}, *a{n - 1}]}}" for n in range(1, 30)),
        "",
        ["config: is not YAML: its aliases repeat more than 1000000 values"],
    ),
    "an alias of itself": (DYNAMIC, "a: &a [*a]", "", ["an alias refers to a value that contains it"]),
    "a path too long": (
        DYNAMIC,
        box(createCollisionShape={"shapeType": "GEOM_MESH", "fileName": "a" * 5000}),
        "",
        ["createCollisionShape.fileName: expected a path of at most 1000 bytes, got aaa"],
    ),
    "a name too long": (
        DYNAMIC,
        box(createCollisionShape={"shapeType": "GEOM_MESH", "fileName": "a" * 500}),
        "",
        ["createCollisionShape.fileName: aaa", "file name too long"],
    ),
    "a module that nobody named": (
        DYNAMIC,
        {**box("b"), "type": "this:x"},
        "",
        ["config: type: 'this:x' is not trusted"],
    ),
    "a module that ends the process": (
        DYNAMIC,
        {**box("b"), "type": "unittest.__main__:x"},
        "",
        ["config: type: 'unittest.__main__:x' is not trusted, so it is not imported: name its package in trusted_"],
    ),
    "a sensor that nobody named": (
        DYNAMIC,
        box("b", sensors=[{"type": "this:x", "name": "a", "hz": 1}]),
        "",
        ["sensors[0].type: 'this:x' is not trusted"],
    ),
    "a mass without end": (
        DYNAMIC,
        box("b", baseMass=1e300),
        "",
        ["baseMass: must be within +-1e+09 [kg], got 1e+300"],
    ),
    "a place without end": (
        DYNAMIC,
        box("b", basePosition=[1e300, 0, 0]),
        "",
        ["basePosition: must be within +-1e+06"],
    ),
    "flags beyond 32 bits": (
        ROBOT,
        iiwa("r", loadURDF={"fileName": "plane.urdf", "flags": 2**70}),
        "",
        ["loadURDF.flags"],
    ),
    "not YAML": (DYNAMIC, "name: box\n  baseMass: 1", "", ["config: line 2, column 11"]),
    "no mapping": (DYNAMIC, "- a\n- b", "", ["config: expected a mapping", "list"]),
    "Python in YAML": (DYNAMIC, "name: !!python/object/apply:os.getcwd []", "", ["config: line 1", "python"]),
    "several problems": (
        DYNAMIC,
        {**box(), "baseMas": 1.0, "basePosition": [0, 0], "createCollisionShape": {"shapeType": "GEOM_BALL"}},
        "",
        [
            "config: baseMas: unknown key 'baseMas'; did you mean 'baseMass'?",
            "config: basePosition: expected",
            "config: createCollisionShape.shapeType: unknown shape type 'GEOM_BALL'",
        ],
    ),
    "not finite": (DYNAMIC, {**box(), "baseMass": float("nan")}, "", ["config: baseMass", "nan"]),
    "name taken": (DYNAMIC, box("ball"), "", ["config: name: 'ball' is taken"]),
    "name of another type taken": (COLLISION, {**FLOOR, "name": "iiwa"}, "", ["config: name: 'iiwa' is taken"]),
    "name reserved": (DYNAMIC, box("world"), "", ["config: name: 'world' is reserved"]),
    "name that no topic can have": (DYNAMIC, box("a/b"), "", ["config: name: use letters"]),
    "mesh missing": (DYNAMIC, _mesh(fileName="no.obj"), "", ["createCollisionShape.fileName: no such file: no.obj"]),
    "mesh that crashes PyBullet": (
        DYNAMIC,
        _mesh(vertices=[[0, 0, 0], [1, 0, 0], [0, 1, 0]], indices=[0, 1, 99], flags="GEOM_FORCE_CONCAVE_TRIMESH"),
        "",
        ["config: createCollisionShape.indices: expected numbers of the 3 vertices, got 99"],
    ),
    "PyBullet refuses": (
        DYNAMIC,
        box(createCollisionShape={"shapeType": "GEOM_MESH", "fileName": "plane.urdf"}),
        "",
        ["createCollisionShape failed"],
    ),
    "URDF missing": (ROBOT, iiwa("r", loadURDF={"fileName": "none.urdf"}), "", ["loadURDF.fileName: no such file"]),
    "no robot description": (
        ROBOT,
        iiwa("r", loadURDF={"fileName": "robot_description"}),
        "",
        ["config: loadURDF.fileName: there is no parameter 'robot_description'"],
    ),
    "joints and gains": (
        ROBOT,
        iiwa(
            "r",
            initial_joint_position={"lbr_iiwa_joint_9": 1.0, "elbow": 1.0},
            setJointMotorControlArray={"controlMode": "POSITION_CONTROL", "positionGains": [1.0, 1.0]},
        ),
        "",
        [
            "config: initial_joint_position.lbr_iiwa_joint_9: unknown joint 'lbr_iiwa_joint_9'",
            "config: initial_joint_position.elbow: unknown joint 'elbow': known are lbr_iiwa_joint_1, ",
            "config: setJointMotorControlArray.positionGains: expected 1 number or 7",
        ],
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_bad_object_is_refused_with_all_reasons_without_any_change(ros, world, case):
    kind, config, filename, expected = REFUSED[case]
    answer = add(ros, kind, config, filename)
    assert not answer.success
    for part in expected:
        assert part in answer.message, answer.message
    assert "Traceback" not in ros.output(world)


WITH_MESH = "<robot name='r'><link name='a'><visual><geometry><mesh filename='{}'/></geometry></visual></link></robot>"


@pytest.mark.parametrize(
    ("urdf", "expected"),
    [
        ("<robot name='r'><link name='a'>", "is not XML"),
        ("<sdf/>", "is SDF, not URDF"),
        (WITH_MESH.format("m/none.stl"), "no such mesh: m/none.stl"),
        (WITH_MESH.format("package://none/a.stl"), "unknown ROS package 'none'"),
    ],
    ids=["not XML", "not a URDF", "mesh missing", "package missing"],
)
def test_robot_with_a_broken_urdf_is_refused_with_the_reason(ros, world, urdf, expected):
    answer = add(ros, ROBOT, iiwa("r", **_urdf(ros, urdf)))
    assert not answer.success
    assert answer.message.startswith("config: loadURDF.fileName: ") and expected in answer.message, answer.message


@pytest.mark.parametrize("name", ["none", "bal", ""])
def test_unknown_object_cannot_be_removed(ros, world, name):
    answer = remove(ros, name)
    assert not answer.success
    assert answer.message.startswith(f"unknown object '{name}': known are floor, follower, ball, iiwa")


def test_targets_for_a_removed_robot_do_not_reach_its_successor(ros, world):
    inertia = "<inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/>"
    link = f"<link name='{{}}'><inertial><mass value='1'/>{inertia}</inertial></link>"
    joint = (
        "<joint name='only' type='revolute'><parent link='a'/><child link='b'/><axis xyz='0 0 1'/>"
        "<limit lower='-1' upper='1' effort='10' velocity='1'/></joint>"
    )
    small = _urdf(ros, f"<robot name='r'>{link.format('a')}{link.format('b')}{joint}</robot>")
    assert ros.call("/rpbi/stop", Trigger).success
    assert add(ros, ROBOT, iiwa("new")).success
    with publishing("/rpbi/new/joint_states/target", JointState) as target:
        target.publish(JointState(name=["lbr_iiwa_joint_1", "lbr_iiwa_joint_7"], position=[0.5, 0.5]))
        rospy.rostime.wallsleep(0.3)
    assert remove(ros, "new").success
    assert add(ros, ROBOT, iiwa("new", **small)).success
    assert ros.call("/rpbi/start", Trigger).success
    states = ros.listen("/rpbi/new/joint_states", JointState)
    assert states.wait_for(20)[-1].position == pytest.approx([0.0], abs=1e-3)
    assert remove(ros, "new").success


CYCLE = (
    (DYNAMIC, box("good", broadcast_hz=20)),
    (DYNAMIC, "name: [good"),
    (ROBOT, iiwa("good", initial_joint_position={"elbow": 1.0})),
    (DYNAMIC, {**box("good"), "baseMass": -1.0}),
    (COLLISION, {**FLOOR, "name": "good", "object_tf": {"tf_id": "nowhere", "hz": 10}}),
    (DYNAMIC, _mesh(fileName="no.obj")),
    (VISUAL, {"name": "good", "createVisualShape": {"shapeType": "GEOM_SPHERE", "radius": 0.1}}),
    (DYNAMIC, box("good", createCollisionShape={"shapeType": "GEOM_HEIGHTFIELD", "heightfieldData": [0.0]})),
    (ROBOT, iiwa("good", broadcast_link_states=True)),
    (DYNAMIC, box("ball")),
)
"""Half of them are fine; the others fail in YAML, validation, files, PyBullet, and with the world as it is."""


def test_two_hundred_objects_leave_nothing_behind(ros, world):
    def cycle():
        for kind, config in CYCLE:
            if add(ros, kind, config).success:
                assert remove(ros, "good").success

    cycle()  # what is made once for all is there now
    threads, files, memory_mb = (count(world.pid, "task"), count(world.pid, "fd"), resident_mb(world.pid))
    for _ in range(20):
        cycle()
    wait_until(lambda: count(world.pid, "task") <= threads + 2, "the threads have ended")
    # What rospy held for a topic goes when Python's garbage collector comes by, which nothing hurries.
    wait_until(lambda: count(world.pid, "fd") <= files + 10, "the files and sockets are closed", 120.0)
    # PyBullet itself never gives back some 1.6 MB of each arm, 64 MB here.
    assert resident_mb(world.pid) < memory_mb + 100.0


def test_one_of_many_simultaneous_adds_of_a_name_succeeds(ros, world):
    answers = []
    threads = [threading.Thread(target=lambda: answers.append(add(ros, ROBOT, iiwa("same")).success)) for _ in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60.0)
    assert sorted(answers) == [False] * 5 + [True]
    assert remove(ros, "same").success


def test_requests_about_a_changing_robot_get_answers_or_plain_errors(ros, world):
    over = threading.Event()
    outcomes = []

    def ask():
        while not over.is_set():
            try:
                outcomes.append(rospy.ServiceProxy("/rpbi/new/robot_info", RobotInfo)().numJoints)
            except (rospy.ServiceException, OSError) as error:
                outcomes.append(str(error))
                time.sleep(0.002)

    threads = [threading.Thread(target=ask) for _ in range(3)]
    for thread in threads:
        thread.start()
    try:
        for _ in range(20):
            assert add(ros, ROBOT, iiwa("new")).success
            wait_until(lambda: 7 in outcomes, "somebody has got an answer")
            assert remove(ros, "new").success
    finally:
        over.set()
    for thread in threads:
        thread.join(60.0)
    assert {outcome for outcome in outcomes if isinstance(outcome, int)} == {7}
    assert "Traceback" not in ros.output(world)


ONE_LINK = "<robot name='r'><link name='a'/></robot>"
ODD_JOINTS = """<robot name='r'><link name='a'/>
<link name='b'><inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/></inertial></link>
<link name='c'><inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/></inertial></link>
<joint name='ball' type='spherical'><parent link='a'/><child link='b'/></joint>
<joint name='wheel' type='continuous'><parent link='b'/><child link='c'/><axis xyz='0 0 1'/></joint></robot>"""


@pytest.mark.parametrize(("urdf", "joints"), [(ONE_LINK, []), (ODD_JOINTS, ["ball", "wheel"])], ids=["none", "odd"])
def test_robots_with_no_joints_or_odd_ones_are_fine(ros, world, urdf, joints):
    load = {**_urdf(ros, urdf)["loadURDF"], "useFixedBase": True, "basePosition": [0.0, 0.0, 5.0]}
    assert add(ros, ROBOT, iiwa("new", loadURDF=load, broadcast_link_states=True)).success
    message = ros.listen("/rpbi/new/joint_states", JointState).wait_for(5)[-1]
    assert message.name == joints
    assert len(message.position) == len(message.velocity) == len(message.effort) == len(joints)
    assert _info(ros, "new").numJoints == len(joints)
    assert remove(ros, "new").success


def test_the_text_of_an_object_is_yaml_of_any_style(ros, world):
    text = yaml.safe_dump(box("new"), default_flow_style=True)
    assert add(ros, DYNAMIC, "# a comment\n" + text).success
    assert remove(ros, "new").success
