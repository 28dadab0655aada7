"""Topics and what is on them: types, rates by simulated time, frames, lengths."""

from __future__ import annotations

import math

import pytest
import rosgraph
from diagnostic_msgs.msg import DiagnosticArray
from node_world import add, diagnosed, main_config, objects, publishing, remove
from ros_system import wait_until
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Int64
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage
from worlds import FLOOR, ball, iiwa

from ros_pybullet_interface.msg import PybulletObject, WorldCommands
from ros_pybullet_interface.srv import RobotInfo

DOCUMENTED_TYPES = {
    "/clock": "rosgraph_msgs/Clock",
    "/diagnostics": "diagnostic_msgs/DiagnosticArray",
    "/tf": "tf2_msgs/TFMessage",
    "/rpbi/status": "std_msgs/Int64",
    "/rpbi/iiwa/joint_states": "sensor_msgs/JointState",
    "/rpbi/iiwa/joint_states/target": "sensor_msgs/JointState",
}
DOCUMENTED_SERVICES = {
    f"/rpbi/{name}"
    for name in ("start", "stop", "step", "add_pybullet_object", "remove_pybullet_object", "list_objects")
} | {"/rpbi/iiwa/robot_info"}
NODE = "/ros_pybullet_interface"


def _world(folder, **more):
    return main_config(
        folder,
        collision=(FLOOR,),
        dynamic=(ball(broadcast_hz=40, basePosition=[1.0, 0.0, 2.0]),),
        robots=(
            iiwa(
                joint_state_publisher_hz=125,
                broadcast_link_states=True,
                broadcast_link_states_hz=20,
                initial_joint_position={"lbr_iiwa_joint_2": 30.0},
            ),
        ),
        **more,
    )


@pytest.fixture(scope="module")
def node(module_ros):
    return module_ros.simulator(_world(module_ros.folder), use_sim_time=True)


@pytest.fixture
def simulator(ros, node):
    """The simulator, which runs; another test may have stopped it."""
    ros.call("/rpbi/start", Trigger)
    return node


@pytest.mark.quick
def test_topics_and_services_have_their_documented_names_and_types(ros, simulator):
    types = dict(rosgraph.Master("/tests").getTopicTypes())
    assert {topic: types.get(topic) for topic in DOCUMENTED_TYPES} == DOCUMENTED_TYPES
    served = {name for name, nodes in rosgraph.Master("/tests").getSystemState()[2] if NODE in nodes}
    assert served >= DOCUMENTED_SERVICES
    assert "/rpbi/ball/joint_states" not in types, "only robots have joints"


def test_rates_are_those_asked_for_in_simulated_time(ros, simulator):
    joint_states = ros.listen("/rpbi/iiwa/joint_states", JointState)
    tf = ros.listen("/tf", TFMessage)

    def stamps(frame):
        transforms = [each for message in list(tf.messages) for each in message.transforms]
        return [each.header.stamp.to_nsec() for each in transforms if each.child_frame_id == frame]

    joint_states.wait_for(250)  # two simulated seconds
    wait_until(lambda: len(stamps("rpbi/iiwa/lbr_iiwa_link_7")) > 20, "the slowest has been told for a second")
    assert _gaps(joint_states.stamps_ns) == {8_000_000}
    assert _gaps(stamps("rpbi/ball")) == {25_000_000}
    assert _gaps(stamps("rpbi/iiwa/lbr_iiwa_link_7")) == {50_000_000}


@pytest.mark.quick
def test_joint_states_contain_all_joints_with_values_of_equal_length(ros, simulator):
    message = ros.listen("/rpbi/iiwa/joint_states", JointState).wait_for(1)[0]
    assert message.header.frame_id == ""
    assert message.name == [f"lbr_iiwa_joint_{number}" for number in range(1, 8)]
    assert len(message.position) == len(message.velocity) == len(message.effort) == 7
    assert message.position[1] == pytest.approx(math.radians(30.0), abs=0.01)


@pytest.mark.quick
def test_tf_has_all_links_and_objects_in_the_world_frame(ros, simulator):
    tf = ros.listen("/tf", TFMessage)
    frames = {f"rpbi/iiwa/lbr_iiwa_link_{number}" for number in range(8)} | {"rpbi/ball"}

    def told():
        return {transform.child_frame_id for message in list(tf.messages) for transform in message.transforms}

    wait_until(lambda: told() >= frames, "all frames are on TF")
    assert told() == frames
    assert {t.header.frame_id for message in tf.messages for t in message.transforms} == {"rpbi/world"}
    together = [len(message.transforms) for message in tf.messages]
    assert max(together) == 9, "all frames of a tick are in one message"


def test_diagnostics_report_the_real_time_factor(ros, simulator):
    diagnostics = ros.listen("/diagnostics", DiagnosticArray)
    wait_until(lambda: float(diagnosed(diagnostics.messages[-1])["real_time_factor"]) > 0.0, "it keeps up with some")
    message = diagnostics.messages[-1]
    values = diagnosed(message)
    assert message.status[0].name == f"{NODE}: simulation"
    assert {"real_time_factor", "overruns_total", "tick", "time_s"} <= set(values)
    assert int(values["tick"]) > 0
    assert float(values["time_s"]) == pytest.approx(int(values["tick"]) * 0.001)


def test_status_is_published_repeatedly(ros, simulator):
    assert {message.data for message in ros.listen("/rpbi/status", Int64).wait_for(20)} == {1}


def test_robot_info_equals_the_values_of_pybullet(ros, simulator):
    info = ros.call("/rpbi/iiwa/robot_info", RobotInfo)
    assert (info.robot_name, info.root_link_name) == ("iiwa", "lbr_iiwa_link_0")
    assert (info.numJoints, info.numDof) == (7, 7)
    assert [joint.jointName for joint in info.joint_info] == info.current_joint_state.name
    second = info.joint_info[1]
    assert (second.jointTypeStr, second.is_revolute, second.is_fixed) == ("JOINT_REVOLUTE", True, False)
    assert second.jointMaxForce == 300.0
    assert (second.jointLowerLimit, second.jointUpperLimit) == pytest.approx((-2.0944, 2.0944), abs=1e-3)
    assert len(info.current_joint_state.position) == 7
    assert info.enabled_ft_sensors == []


def test_list_objects_has_everything_in_the_order_of_loading(ros, simulator):
    assert list(objects(ros).items()) == [("floor", "collision"), ("ball", "dynamic"), ("iiwa", "robot")]


def test_partial_targets_of_several_publishers_at_once_all_arrive(ros, simulator):
    goals = {1: 0.3, 3: -0.4}
    for number, goal in goals.items():
        message = f"{{name: [lbr_iiwa_joint_{number}], position: [{goal}]}}"
        topic = "/rpbi/iiwa/joint_states/target"
        ros.start(["rostopic", "pub", "-r", "200", topic, "sensor_msgs/JointState", message])
    joint_states = ros.listen("/rpbi/iiwa/joint_states", JointState)

    def position():
        return joint_states.messages[-1].position if joint_states.messages else [math.inf] * 7

    for number, goal in goals.items():
        wait_until(lambda n=number, g=goal: abs(position()[n - 1] - g) < 0.01, f"joint {number} is where it shall be")
    assert position()[1] == pytest.approx(math.radians(30.0), abs=0.01), "joints that nobody names stay"


def test_targets_that_wait_for_the_same_tick_are_merged(ros, simulator):
    ros.call("/rpbi/stop", Trigger)
    goals = {5: 0.5, 6: -0.6, 7: 0.7}
    entered = ros.listen("/rpbi/commands", WorldCommands)

    def taken():
        return "".join(each.data for message in list(entered.messages) for each in message.commands)

    with publishing("/rpbi/iiwa/joint_states/target", JointState) as target:
        for number, goal in goals.items():
            target.publish(JointState(name=[f"lbr_iiwa_joint_{number}"], position=[goal]))
        wait_until(lambda: all(f"[{number - 1},{goal}]" in taken() for number, goal in goals.items()), "all have come")
    joint_states = ros.listen("/rpbi/iiwa/joint_states", JointState)
    ros.call("/rpbi/start", Trigger)
    wait_until(
        lambda: (
            joint_states.messages
            and all(abs(joint_states.messages[-1].position[number - 1] - goal) < 0.01 for number, goal in goals.items())
        ),
        "all three joints arrive",
    )


def test_object_added_to_a_paused_world_is_published(ros, simulator):
    ros.call("/rpbi/stop", Trigger)
    tf = ros.listen("/tf", TFMessage)
    assert add(ros, PybulletObject.ROBOT, iiwa("second", broadcast_link_states=True)).success
    joint_states = ros.listen("/rpbi/second/joint_states", JointState)
    joint_states.wait_for(1)
    wait_until(
        lambda: any(
            transform.child_frame_id.startswith("rpbi/second/")
            for message in list(tf.messages)
            for transform in message.transforms
        ),
        "its links are on TF",
    )
    assert remove(ros, "second").success


def test_two_simulators_live_on_one_master_by_namespace(ros, tmp_path):
    for name in ("a", "b"):
        folder = tmp_path / name
        folder.mkdir()
        config = main_config(folder, dynamic=(ball(broadcast_hz=20),), robots=(iiwa(f"arm_{name}"),))
        ros.simulator(config, namespace=f"/{name}/")
    assert objects(ros, ns="/a/") == {"ball": "dynamic", "arm_a": "robot"}
    assert objects(ros, ns="/b/") == {"ball": "dynamic", "arm_b": "robot"}
    for name in ("a", "b"):
        states = ros.listen(f"/{name}/rpbi/arm_{name}/joint_states", JointState)
        states.wait_for(5)
    assert ros.call("/a/rpbi/stop", Trigger).success
    status = ros.listen("/b/rpbi/status", Int64)
    assert {message.data for message in status.wait_for(5)} == {1}, "stopping one stops the other"


def test_the_clock_is_the_only_one_and_counts_whole_ticks(ros, simulator):
    stamps = [message.clock.to_nsec() for message in ros.listen("/clock", Clock).wait_for(300)]
    assert all(stamp % 1_000_000 == 0 for stamp in stamps)
    publishers = dict(rosgraph.Master("/tests").getSystemState()[0])["/clock"]
    assert publishers == [NODE]


def _gaps(stamps):
    assert len(stamps) > 10
    return {after - before for before, after in zip(stamps, stamps[1:], strict=False)}
