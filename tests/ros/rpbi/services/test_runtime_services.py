"""Services that change pace, physics, gains and rates while the simulator runs."""

from __future__ import annotations

import math
import re

import pytest
import rospy
from cob_srvs.srv import SetString
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Vector3, WrenchStamped
from node_world import add, main_config, remove
from ros_system import wait_until
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_srvs.srv import Empty, Trigger
from tf2_msgs.msg import TFMessage
from worlds import FLOOR, ball, iiwa

from ros_pybullet_interface.msg import SimulationState, WorldCommands
from ros_pybullet_interface.srv import SetGravity, SetMotorGains, SetRealTimeFactor, SetSensorRate, StepN

JOINT = "lbr_iiwa_joint_2"
SENSOR = "iiwa/lbr_iiwa_joint_7/ft_sensor"


@pytest.fixture(scope="module")
def node(module_ros):
    load = {"fileName": "kuka_iiwa/model.urdf", "useFixedBase": True, "basePosition": [0.0, -1.0, 0.0]}
    config = main_config(
        module_ros.folder,
        collision=(FLOOR,),
        dynamic=(ball(basePosition=[0.0, 1.0, 0.1], broadcast_hz=100),),
        robots=(
            iiwa(enabled_joint_force_torque_sensors=[{"joint": "lbr_iiwa_joint_7", "hz": 100}], contacts={}),
            iiwa("quiet", joint_state_publisher_hz=0, loadURDF=load),
        ),
        setAdditionalSearchPath="pybullet_data_path",
        state_hz=50,
    )
    return module_ros.simulator(config, use_sim_time=True)


@pytest.fixture
def simulator(ros, node):
    yield node
    ros.call("/rpbi/set_real_time_factor", SetRealTimeFactor, 1.0)
    ros.call("/rpbi/start", Trigger)
    ros.call("/rpbi/reset", Trigger)


def commands(listened):
    """Returns what entered the world since its last reset; who comes late gets all of it."""
    return [each.what for message in listened.messages for each in message.commands]


@pytest.mark.quick
def test_real_time_factor_can_be_changed_and_shortfall_warns_once(ros, simulator):
    states, diagnostics = ros.listen("/rpbi/state", SimulationState), ros.listen("/diagnostics", DiagnosticArray)
    answer = ros.call("/rpbi/set_real_time_factor", SetRealTimeFactor, 0.1)
    assert (answer.success, answer.message) == (True, "0.1, was 1")
    states.wait_for(1)
    wait_until(lambda: 0.05 < states.messages[-1].real_time_factor < 0.15, "it goes at a tenth of the pace")
    assert states.messages[-1].real_time_factor_asked == 0.1
    diagnostics.wait_for(1)
    wait_until(lambda: diagnostics.messages[-1].status[0].message == "running", "a tenth is what is asked for")
    ros.call("/rpbi/reset", Trigger)
    assert ros.call("/rpbi/set_real_time_factor", SetRealTimeFactor, 0.0).message == "0, was 0.1", "a reset leaves it"
    wait_until(
        lambda: any(each.real_time_factor_asked == 0.0 and each.real_time_factor > 1.5 for each in states.messages),
        "it goes as fast as it goes",
    )
    assert not states.messages[-1].commands, "pace is no matter of the world"

    def said():
        warning = r"too slow: real-time factor .* instead of .*: .*; (.*) \(docs/slow.md\)"
        return re.findall(warning, ros.output(simulator))

    ros.call("/rpbi/set_real_time_factor", SetRealTimeFactor, 1e4)
    wait_until(said, "why it is slower than asked for")
    diagnostics.messages.clear()
    diagnostics.wait_for(1)
    assert len(said()) == len({*said()}), "each advice once"


def test_gravity_is_a_command_and_a_reset_brings_it_back(ros, simulator):
    wrenches = ros.listen(f"/rpbi/{SENSOR}", WrenchStamped)
    entered = ros.listen("/rpbi/commands", WorldCommands)

    def weight(message=None):
        force = (message or wrenches.messages[-1]).wrench.force
        return math.hypot(force.x, force.y, force.z)

    def steady_weight():
        weights = [weight(message) for message in wrenches.messages[-20:]]
        return len(weights) == 20 and max(weights) < 1.001 * min(weights) and weights[-1]

    earth = wait_until(steady_weight, "the arm hangs still after its start")
    answer = ros.call("/rpbi/set_gravity", SetGravity, Vector3(0.0, 0.0, -1.62))
    assert (answer.success, answer.message) == (True, "gravity is 0, 0, -1.62 [m/s^2]")
    wait_until(lambda: weight() == pytest.approx(earth * 1.62 / 9.81, rel=0.01), "the sensor feels less weight")
    wait_until(lambda: "physics" in commands(entered), "the command is told")
    ros.call("/rpbi/reset", Trigger)
    wait_until(lambda: weight() == pytest.approx(earth, rel=0.01), "a reset brings gravity back")


def test_engines_parameters_are_changed_by_key(ros, simulator):
    entered = ros.listen("/rpbi/commands", WorldCommands)
    text = "{numSolverIterations: 100, constraintSolverType: CONSTRAINT_SOLVER_LCP_SI}"
    answer = ros.call("/rpbi/set_physics_engine_parameter", SetString, text)
    assert (answer.success, answer.message) == (True, "changed numSolverIterations, constraintSolverType")
    wait_until(lambda: "physics" in commands(entered), "the command is told")


def test_gains_are_changed_by_joint(ros, simulator):
    entered = ros.listen("/rpbi/commands", WorldCommands)
    answer = ros.call("/rpbi/iiwa/set_motor_gains", SetMotorGains, [JOINT], [0.05], [0.9])
    assert (answer.success, answer.message) == (True, f"changed gains of {JOINT}")
    wait_until(lambda: "set_gains" in commands(entered), "the command is told")


def test_sensor_rate_can_be_changed_or_set_to_zero(ros, simulator):
    states = ros.listen("/rpbi/iiwa/joint_states", JointState)
    states.wait_for(2)
    ros.call("/rpbi/stop", Trigger)
    stopped = ros.call("/rpbi/step_n", StepN, 0).stamp
    states.wait_for_stamp(stopped)  # all that was under way is here
    for name in ("iiwa/joint_states", "/rpbi/iiwa/joint_states"):
        assert ros.call("/rpbi/set_sensor_rate", SetSensorRate, name, 10.0).success
    answer = ros.call("/rpbi/set_sensor_rate", SetSensorRate, "iiwa/joint_states", 500.0)
    assert (answer.success, answer.message) == (True, "'iiwa/joint_states': 500 Hz, was 10")
    last = ros.call("/rpbi/step_n", StepN, 100)
    states.wait_for_stamp(last.stamp)
    stamps = [stamp for stamp in states.stamps_ns if stamp > stopped.to_nsec()][:50]
    assert len(stamps) == 50
    assert {after - earlier for earlier, after in zip(stamps, stamps[1:])} == {2_000_000}
    assert ros.call("/rpbi/set_sensor_rate", SetSensorRate, "iiwa/joint_states", 0.0).success
    before = len(states.messages)
    wrenches = ros.listen(f"/rpbi/{SENSOR}", WrenchStamped)
    last = ros.call("/rpbi/step_n", StepN, 100)
    wait_until(lambda: wrenches.messages and wrenches.messages[-1].header.stamp == last.stamp, "the last tick is told")
    assert len(states.messages) == before


def test_zeroing_a_sensor_that_is_off_is_refused(ros, simulator):
    ros.call("/rpbi/start", Trigger)
    assert ros.call("/rpbi/set_sensor_rate", SetSensorRate, SENSOR, 0.0).success
    with pytest.raises(Exception, match="the sensor is off"):
        ros.call(f"/rpbi/{SENSOR}", Empty)
    assert ros.call("/rpbi/set_sensor_rate", SetSensorRate, SENSOR, 1000.0).success
    ros.call(f"/rpbi/{SENSOR}", Empty)


def test_joint_states_that_are_off_have_no_topic(ros, simulator):
    topics = dict(rospy.get_published_topics())
    assert "/rpbi/iiwa/joint_states" in topics and "/rpbi/quiet/joint_states" not in topics
    answer = ros.call("/rpbi/set_sensor_rate", SetSensorRate, "quiet/joint_states", 10.0)
    assert not answer.success and "unknown sensor 'quiet/joint_states'" in answer.message


@pytest.mark.parametrize(
    ("service", "service_type", "asked", "message"),
    [
        (
            "set_real_time_factor",
            SetRealTimeFactor,
            [-1.0],
            "real_time_factor: must be 0 (as fast as possible) or >= 0.001, got -1",
        ),
        ("set_real_time_factor", SetRealTimeFactor, [1e-300], "or >= 0.001, got 1e-300"),
        ("set_real_time_factor", SetRealTimeFactor, [math.nan], "real_time_factor: must be 0"),
        ("set_gravity", SetGravity, [Vector3(0.0, math.inf, 0.0)], "gravity: gravY: "),
        ("set_physics_engine_parameter", SetString, ["{fixedTimeStep: 0.1}"], "fixedTimeStep: cannot change"),
        ("set_physics_engine_parameter", SetString, ["{erpp: 0.1}"], "unknown key 'erpp'; did you mean 'erp'?"),
        ("set_physics_engine_parameter", SetString, ["{erp: -0.1}"], "data: erp: must be >= 0"),
        ("set_physics_engine_parameter", SetString, ["{numSolverIterations: 0}"], "data: numSolverIterations: "),
        ("set_physics_engine_parameter", SetString, ["{}"], "expected keys of setPhysicsEngineParameter"),
        ("set_physics_engine_parameter", SetString, ["[1, 2"], "data: "),
        ("iiwa/set_motor_gains", SetMotorGains, [[JOINT], [-1.0], []], "positionGain of 'lbr_iiwa_joint_2' must be"),
        ("iiwa/set_motor_gains", SetMotorGains, [["elbow"], [1.0], []], "unknown joint 'elbow'"),
        ("set_sensor_rate", SetSensorRate, ["iiwa/joint_state", 5.0], "did you mean 'iiwa/joint_states'?"),
        ("set_sensor_rate", SetSensorRate, ["ball/tf", math.nan], "hz: must be finite and >= 0 [Hz], got nan"),
    ],
)
def test_bad_requests_are_refused_by_key_and_change_nothing(ros, simulator, service, service_type, asked, message):
    entered = ros.listen("/rpbi/commands", WorldCommands)
    answer = ros.call(f"/rpbi/{service}", service_type, *asked)
    assert not answer.success and message in answer.message, answer.message
    assert ros.call("/rpbi/set_sensor_rate", SetSensorRate, "ball/tf", 50.0).success
    wait_until(lambda: commands(entered)[-1:] == ["sensor_rate"], "a good request is told")
    assert set(commands(entered)) <= {"sensor_rate"}, "no other has entered the world"


def test_object_moved_in_a_stopped_world_gets_a_new_stamp(ros, simulator):
    def ball_at(x):
        found = [each for message in list(tf.messages) for each in message.transforms if "ball" in each.child_frame_id]
        return [each.header.stamp.to_nsec() for each in found], found and found[-1].transform.translation.x == x

    ros.call("/rpbi/stop", Trigger)
    tf, clock = ros.listen("/tf", TFMessage), ros.listen("/clock", Clock)
    for x in (2.0, 3.0, 4.0):
        assert remove(ros, "ball").success
        assert add(ros, config=ball(basePosition=[x, 1.0, 0.1], broadcast_hz=100)).success
        wait_until(lambda x=x: ball_at(x)[1], "TF has it where it is now")
    stamps_ns = ball_at(4.0)[0]
    assert len(stamps_ns) >= 3 and stamps_ns == sorted(set(stamps_ns))
    wait_until(lambda: clock.messages[-1].clock.to_nsec() >= stamps_ns[-1], "the clock has come to it")
