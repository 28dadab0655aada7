"""What fails while a world runs, is reset or changes leaves the node and all of the rest there."""

from __future__ import annotations

import threading

import pytest
from camera_world import CAMERA, box_world
from cob_srvs.srv import SetString
from mobile_base import mobile_base
from node_world import Rosout, add, main_config, objects, registrations, remove
from ros_system import support_on_path, wait_until
from sensor_msgs.msg import Image, JointState
from std_srvs.srv import Trigger
from worlds import box, iiwa

from ros_pybullet_interface.msg import PybulletObject, SimulationState
from ros_pybullet_interface.srv import RobotInfo


def test_body_that_cannot_report_its_state_stops_only_the_simulation(ros, tmp_path):
    rosout = Rosout(ros)
    config = main_config(tmp_path, state_hash_hz=10)
    config["objects"] = [ros.write_yaml("thing.yaml", {"name": "thing", "type": "faulty_lab:Thing"})]
    ros.listen("/rpbi/state", SimulationState)  # so that somebody wants the hash
    process = ros.simulator(config, use_sim_time=True, **support_on_path())
    lost = {"name": "lost", "type": "faulty_lab:Thing", "fails": "motion_state"}
    assert add(ros, PybulletObject.DYNAMIC, lost).success
    wait_until(lambda: rosout.logs("simulation stopped: lost"), "it stands still and says why")
    assert set(objects(ros)) == {"thing", "lost"}
    assert remove(ros, "lost").success
    assert ros.call("/rpbi/start", Trigger).success
    assert ros.call("/rpbi/stop", Trigger).success, "it went on"
    assert process.poll() is None
    assert len(rosout.logs("simulation stopped: lost")) == 1, "told once, not at every pass"


def test_reused_name_in_a_paused_world_shows_the_new_object(ros, placed):
    rosout = Rosout(ros)
    config = box_world(ros, rgbd_sensor=CAMERA, setAdditionalSearchPath="pybullet_data_path")
    ros.simulator(config, use_sim_time=True)
    first = ros.listen("/rpbi/camera/colour/image", Image)
    assert add(ros, PybulletObject.ROBOT, iiwa("thing")).success
    seen = len(first.messages)
    first.wait_for(seen + 3)  # the arm is in the last picture
    assert ros.call("/rpbi/stop", Trigger).success
    assert remove(ros, "thing").success
    assert add(ros, PybulletObject.DYNAMIC, box("thing", basePosition=[0.4, 0.0, 0.1])).success
    second = ros.listen("/rpbi/camera/segmentation", Image)
    second.wait_for(1)
    assert not rosout.logs("the renderer ended")


def test_robot_services_never_report_it_unknown_because_of_a_reset(ros, tmp_path):
    ros.simulator(main_config(tmp_path, robots=(iiwa(),)), use_sim_time=True)
    over = threading.Event()
    answers = []

    def ask():
        while not over.is_set():
            answers.append(ros.call("/rpbi/iiwa/set_control_mode", SetString, "POSITION_CONTROL").message)

    asking = threading.Thread(target=ask)
    asking.start()
    try:
        for _ in range(20):
            assert ros.call("/rpbi/reset", Trigger).success
        wait_until(lambda: ros.call("/rpbi/reset", Trigger).success and len(answers) > 20, "it was asked often")
    finally:
        over.set()
    asking.join(60.0)
    assert not [answer for answer in answers if "unknown" in answer]


@pytest.mark.quick
def test_object_that_a_reset_cannot_load_can_be_added_again(ros, tmp_path):
    config = mobile_base(tmp_path)
    name, urdf = config["name"], tmp_path / "mobile_base.urdf"
    ros.simulator(main_config(tmp_path, robots=(config, iiwa())), use_sim_time=True)
    before = registrations()
    text = urdf.read_text()
    urdf.unlink()
    answer = ros.call("/rpbi/reset", Trigger)
    assert not answer.success and "mobile_base.urdf" in answer.message
    assert set(objects(ros)) == {"iiwa"}
    assert not [each for _, each in registrations() if f"/rpbi/{name}/" in each]
    urdf.write_text(text)
    assert ros.call("/rpbi/start", Trigger).success
    answer = add(ros, PybulletObject.ROBOT, config)
    assert answer.success, answer.message
    assert ros.call(f"/rpbi/{name}/robot_info", RobotInfo).robot_name == name
    ros.listen(f"/rpbi/{name}/joint_states", JointState).wait_for(5)
    assert ros.call("/rpbi/reset", Trigger).success
    wait_until(lambda: registrations() == before, "all is as it was")
