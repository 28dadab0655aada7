"""A simulated robot that ROS 2 reads, commands and asks. All tests share the simulator and the bridge."""

from __future__ import annotations

import math
import subprocess

import pytest
from node_world import main_config
from ros2_system import COMPANION, Ros2, built
from ros_system import SUPPORT, RosSystem, wait_until
from std_srvs.srv import Trigger
from trajectory_world import CONTROLLER, HOME, JOINTS, START
from worlds import iiwa

STATE = "sensor_msgs/msg/JointState"
TRIGGER = "std_srvs/srv/Trigger"
BOX = "type: dynamic\nname: box\ncreateVisualShape: {shapeType: GEOM_BOX, halfExtents: [0.1, 0.1, 0.1]}\n"
BOX += "createCollisionShape: {shapeType: GEOM_BOX, halfExtents: [0.1, 0.1, 0.1]}\nbaseMass: 1.0\n"
BOX += "basePosition: [0.8, 0.8, 1.0]\nbroadcast_hz: 50\n"


@pytest.fixture(scope="module")
def world(module_ros: RosSystem, bridge: subprocess.Popen[bytes]) -> RosSystem:
    """A world with an iiwa, on simulated time, and the bridge."""
    robot = iiwa(joint_trajectory_controller={}, joint_state_publisher_hz=100, **HOME)
    module_ros.simulator(main_config(module_ros.folder, robots=(robot,)), use_sim_time=True)
    return module_ros


@pytest.fixture
def arm(world: RosSystem) -> None:
    """The arm of the world, at its start."""
    world.call("/rpbi/reset", Trigger)
    world.call("/rpbi/start", Trigger)


@pytest.mark.quick
def test_target_moves_the_arm_and_clock_drives_time(arm, peer):
    peer.use_sim_time(True)
    peer.listen("/rpbi/iiwa/joint_states", STATE)
    target = "/rpbi/iiwa/joint_states/target"
    peer.write(target, STATE)
    wait_until(lambda: peer.readers(target) and peer.count("/rpbi/iiwa/joint_states"), "both directions are open")
    peer.publish(target, {"name": JOINTS[:1], "position": [0.3]})

    def is_there() -> bool:
        state = peer.last("/rpbi/iiwa/joint_states")
        return abs(dict(zip(state["name"], state["position"]))[JOINTS[0]] - 0.3) < 0.01

    wait_until(is_there, "the arm is at the target")
    state = peer.last("/rpbi/iiwa/joint_states")["header"]["stamp"]
    now_s = peer.now()
    assert abs(now_s - state["sec"] - state["nanosec"] * 1e-9) < 60.0, "the world's time, not that of the computer"
    peer.use_sim_time(False)


def test_companion_offers_services_by_names_of_the_simulator(arm, ros, ros2, peer):
    companion = ros2.start(str(COMPANION))
    parameters = "rcl_interfaces/srv/SetParameters"

    def trigger(name: str) -> tuple[bool, str]:
        answer = peer.call(f"/rpbi/{name}", TRIGGER, {})
        return answer["success"], answer["message"]

    def set_text(name: str, text: str) -> None:
        values = {"parameters": [{"name": name, "value": {"type": 4, "string_value": text}}]}
        assert peer.call("/rpbi_companion/set_parameters", parameters, values)["results"][0]["successful"]

    assert trigger("stop") == (True, "stopped")
    assert trigger("stop")[0] is False
    assert trigger("step") == (True, "1 ticks done")
    set_text("entity", BOX)
    set_text("name", "box")
    set_text("file", "pushed.world")
    for name in ("spawn", "move", "save", "remove", "restore", "remove", "reset"):
        is_done, message = trigger(name)
        assert is_done, message
    is_done, message = trigger("remove")
    assert not is_done and "box" in message
    assert trigger("start")[0]
    assert "simulation_interfaces is not installed" in ros.output(companion)


@pytest.mark.thorough
def test_trajectory_by_the_action_ends_at_its_goal(arm, ros, domain):
    ros2 = Ros2(ros, domain, built(SUPPORT / "ros2/control_msgs"))
    ros2.start(str(COMPANION))
    peer = ros2.peer()
    goal = [0.4, 0.2, -0.3, -0.9, 0.3, -0.4, 0.5]
    half = [(start + end) / 2 for start, end in zip(START, goal)]
    speeds = [(end - start) / 2 for start, end in zip(START, goal)]
    points = [
        {"positions": half, "velocities": speeds, "time_from_start": {"sec": 1}},
        {"positions": goal, "velocities": [0.0] * 7, "time_from_start": {"sec": 2}},
    ]
    action, kind = f"{CONTROLLER}/follow_joint_trajectory", "control_msgs/action/FollowJointTrajectory"
    peer.listen("/rpbi/iiwa/joint_states", STATE)
    status, result, feedbacks = peer.act(action, kind, {"trajectory": {"joint_names": JOINTS, "points": points}})
    assert (status, result["error_code"]) == (4, 0), result
    assert feedbacks and feedbacks[-1]["joint_names"] == JOINTS
    state = peer.last("/rpbi/iiwa/joint_states")
    at = dict(zip(state["name"], state["position"]))
    assert [at[name] for name in JOINTS] == pytest.approx(goal, abs=1e-2)
    far = [{"positions": [math.pi / 2, *goal[1:]], "time_from_start": {"sec": 20}}]
    status, result, _ = peer.act(action, kind, {"trajectory": {"joint_names": JOINTS, "points": far}}, cancel_after=3)
    assert status == 5, "cancelled"
    wrong = {"trajectory": {"joint_names": ["elbow"], "points": [{"positions": [0.0], "time_from_start": {"sec": 1}}]}}
    status, result, _ = peer.act(action, kind, wrong)
    assert status == 6 and "elbow" in result["error_string"]


@pytest.mark.thorough
def test_companion_offers_the_standard_services_of_simulators(arm, ros, domain):
    ros2 = Ros2(ros, domain, built(SUPPORT / "ros2/simulation_interfaces"))
    ros2.start(str(COMPANION))
    peer = ros2.peer()

    def call(name: str, /, **values) -> dict:
        kind = "".join(word.title() for word in name.split("_"))
        return peer.call(f"/rpbi/{name}", f"simulation_interfaces/srv/{kind}", values)

    def is_done(name: str, /, **values) -> bool:
        return call(name, **values)["result"]["result"] == 1

    pose = {"position": {"x": 0.8, "y": 0.8, "z": 1.0}}
    assert 0 in call("get_simulator_features")["features"]["features"]
    state = call("get_simulation_state")
    assert state["state"]["state"] == 1, state
    assert is_done("set_simulation_state", state={"state": 2}) and is_done("set_simulation_state", state={"state": 2})
    assert call("get_simulation_state")["state"]["state"] == 2
    assert is_done("step_simulation", steps=10)
    spawned = call("spawn_entity", name="crate", resource_string=BOX, initial_pose={"pose": pose})
    assert spawned["entity_name"] == "crate", spawned
    assert call("get_entities", filters={"filter": "cra.*"})["entities"] == ["crate"]
    assert is_done("set_entity_state", entity="crate", state={"pose": pose})
    assert is_done("delete_entity", entity="crate") and not is_done("delete_entity", entity="crate")
    assert is_done("reset_simulation") and is_done("set_simulation_state", state={"state": 1})
    assert not is_done("set_simulation_state", state={"state": 3})
