"""The template of a user's own package, copied, renamed and built in another workspace over this one."""

from __future__ import annotations

import math
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest
import rospy
import yaml
from camera_world import CAMERA
from clean_shell import in_clean_shell
from cob_srvs.srv import SetString
from node_world import Rosout, add, main_config, objects, publishing, remove
from ros_system import SUPPORT, support_on_path, wait_until
from sensor_msgs.msg import Image, Range
from std_msgs.msg import Float64
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray

from ros_pybullet_interface.msg import PybulletObject, SimulationState

ROOT = Path(__file__).resolve().parents[4]
NAME = "their_lab"
CONVEYOR, RANGE_FINDER = f"{NAME}.conveyor:Conveyor", f"{NAME}.range_finder:RangeFinder"


def _in_workspace(folder: Path, line: str) -> list[str]:
    return in_clean_shell(f"cd {folder}; {line}", folder / "devel" / "setup.bash")


def _do(folder: Path, line: str, code: int = 0) -> str:
    done = subprocess.run(_in_workspace(folder, line), capture_output=True, text=True, stdin=subprocess.DEVNULL)
    assert done.returncode == code, done.stdout + done.stderr
    return done.stdout + done.stderr


@pytest.fixture(scope="module")
def workspace(tmp_path_factory):
    """The template, copied, renamed and built by the first commands of docs/extending.md."""
    folder = tmp_path_factory.mktemp("lab") / "workspace"
    text = (ROOT / "docs" / "extending.md").read_text()
    commands, start = text.split("```")[1].removeprefix("shell").strip().rsplit("\n", 1)
    assert start == f"roslaunch {NAME} lab.launch"
    lines = "set -e\n" + commands.replace("~/rpbi", str(ROOT)).replace("~/lab_ws", str(folder))
    environment = {"PATH": "/usr/local/bin:/usr/bin:/bin", "HOME": os.environ["HOME"]}
    done = subprocess.run(["bash", "-c", lines], capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


@pytest.fixture(scope="module")
def launched(module_ros, workspace):
    """The launch file of the package, up and running, for the tests of what it has."""
    rospy.set_param("/use_sim_time", True)
    process = module_ros.start(_in_workspace(workspace, f"exec roslaunch {NAME} lab.launch"))
    wait_until(lambda: objects(module_ros), "the simulator is up")
    return process


@pytest.fixture
def lab(ros, launched):
    """The same, as it was at its start, and running."""
    rospy.set_param("/use_sim_time", True)
    _stand_at_the_start(ros)
    assert ros.call("/rpbi/start", Trigger).success
    return launched


def _stand_at_the_start(ros):
    """Has the world as it was at its start, until somebody starts it: on a busy machine the parcel has gone far."""
    for name in ("stop", "reset"):
        assert ros.call(f"/rpbi/{name}", Trigger).success


def _heights(transforms, frame="rpbi/parcel"):
    """Returns stamps [s] and positions [m] of a frame."""
    return [
        (one.header.stamp.to_sec(), one.transform.translation)
        for message in list(transforms.messages)
        for one in message.transforms
        if one.child_frame_id == frame
    ]


@pytest.mark.thorough
def test_launch_file_carries_a_parcel_past_the_sensor_and_off(ros, lab):
    rospy.wait_for_service("/next_parcel", 60.0)  # the pusher is up
    _stand_at_the_start(ros)
    ranges = ros.listen("/rpbi/belt/end/range", Range)
    transforms = ros.listen("/tf", TFMessage)
    ranges.wait_for(1)
    wait_until(lambda: transforms.is_connected, "transforms come")  # another listener may have had the last ones
    assert ros.call("/rpbi/start", Trigger).success
    wait_until(lambda: any(place.z < 0.1 for _, place in _heights(transforms)), "the parcel lies on the floor")
    places = _heights(transforms)
    on_belt = [(stamp, place.x) for stamp, place in places if place.z > 0.54 and -0.6 < place.x < 0.3]
    (first_s, first_m), (last_s, last_m) = on_belt[0], on_belt[-1]
    assert (last_m - first_m) / (last_s - first_s) == pytest.approx(0.4, rel=0.02)
    assert places[-1][1].y > 0.2
    answer = ros.call("/next_parcel", Trigger)
    assert answer.success, answer.message
    wait_until(lambda: _heights(transforms)[-1][1].z > 0.5, "the parcel is on the belt again")

    stamps = ranges.stamps_ns
    assert set(np.diff(stamps)) == {20_000_000}  # 50 Hz
    seen = [message.range for message in ranges.messages if math.isfinite(message.range)]
    assert math.isinf(ranges.messages[0].range) and seen[0] == pytest.approx(0.15, abs=0.005)
    assert ranges.messages[0].max_range == pytest.approx(0.4)
    assert ranges.messages[0].header.frame_id == "rpbi/belt/end"
    complaints = [line for line in ros.output(lab).splitlines() if "Traceback" in line or "[WARN]" in line]
    assert [line for line in complaints if "too slow" not in line] == []


@pytest.mark.thorough
def test_own_objects_can_be_added_and_reset_restores_the_first(ros, lab, workspace):
    assert objects(ros) == {"floor": "collision", "parcel": "dynamic", "pusher": "robot", "belt": CONVEYOR}
    text = {"name": "second", "type": CONVEYOR, "size": [1.0, 1.0, 0.1], "position": [0.0, 2.0, 1.0]}
    eye = {"name": "eye", "type": RANGE_FINDER, "hz": 100.0, "position": [0, 0, -0.06], "direction": [0, 0, -1]}
    answer = add(ros, PybulletObject.DYNAMIC, {**text, "sensors": [{**eye, "max_range": 2.0}]})
    assert answer.success, answer.message
    ranges = ros.listen("/rpbi/second/eye/range", Range)
    assert ranges.wait_for(3)[0].range == pytest.approx(0.94, abs=1e-3)
    assert remove(ros, "second").success
    assert not [name for name, _ in rospy.get_published_topics() if "/second/" in name]

    assert remove(ros, "belt").success
    again = add(ros, filename=f"{{{NAME}}}/configs/belt.yaml")
    assert again.success, again.message
    belt = ros.listen("/rpbi/belt/end/range", Range)
    belt.wait_for(1)

    hashes = ros.listen("/rpbi/state", SimulationState)
    add(ros, PybulletObject.DYNAMIC, {**text, "name": "third"})
    assert ros.call("/rpbi/reset", Trigger).success
    assert list(objects(ros)) == ["floor", "parcel", "pusher", "belt"]
    count = len(belt.messages)
    belt.wait_for(count + 3)
    assert belt.stamps_ns == sorted(set(belt.stamps_ns))
    hashes.wait_for(2)


@pytest.mark.thorough
def test_a_wrong_object_is_refused_with_all_reasons(ros, lab):
    wrong = {"name": "second", "type": CONVEYOR, "size": 1, "position": [0, 0, 1], "sensors": [{"type": "nowhere:X"}]}
    answer = add(ros, PybulletObject.DYNAMIC, wrong)
    assert not answer.success
    assert "config: size: expected" in answer.message
    assert "config: sensors[0].type: 'nowhere:X' is not trusted" in answer.message
    assert "second" not in objects(ros)


@pytest.mark.thorough
def test_its_own_topic_moves_its_object_and_refuses_nonsense(ros, lab):
    rosout = Rosout(ros)
    _stand_at_the_start(ros)
    transforms = ros.listen("/tf", TFMessage)
    wait_until(lambda: transforms.is_connected, "transforms come")  # another listener may have had the last ones
    publisher = rospy.Publisher("/rpbi/belt/speed", Float64, queue_size=1)
    wait_until(publisher.get_num_connections, "the belt listens")
    refused = "/rpbi/belt/speed: message refused: speed must be within +-5 m/s, got nan"
    wait_until(lambda: publisher.publish(math.nan) or rosout.logs(refused), "nonsense is refused")
    publisher.publish(-1.0)
    assert ros.call("/rpbi/start", Trigger).success

    def goes_backwards():
        places_m = [place.x for _, place in _heights(transforms)]
        return any(later < earlier - 0.01 for earlier, later in zip(places_m, places_m[1:]))

    wait_until(goes_backwards, "the belt runs backwards")
    publisher.unregister()


@pytest.mark.thorough
def test_it_is_seen_by_cameras_and_in_rviz(ros, lab, placed):
    answer = ros.call("/rpbi/add_rgbd_sensor", SetString, yaml.safe_dump(CAMERA))
    assert answer.success, answer.message
    image = ros.listen("/rpbi/camera/colour/image", Image).wait_for(1)[0]
    pixels = np.frombuffer(image.data, np.uint8).reshape(image.height, image.width, 3)
    column = int(0.95 * image.width)  # past where the parcel leaves the belt
    belt, floor = pixels[image.height // 2, column], pixels[3, column]
    assert belt.max() < 90 < floor.max(), "the belt is dark, the floor beside it bright"
    markers = ros.listen("/rpbi/markers", MarkerArray).wait_for(1)[0].markers
    (belt,) = [marker for marker in markers if marker.ns == "belt"]
    assert (belt.scale.x, belt.scale.y, belt.scale.z) == pytest.approx((2.0, 0.4, 0.1))


@pytest.mark.thorough
def test_it_is_checked_and_tested_without_a_master(workspace):
    check = "rosrun ros_pybullet_interface check_world.py"
    told = _do(workspace, f"{check} '{{{NAME}}}/configs/lab.yaml'")
    assert f"{CONVEYOR} belt" in told
    assert "rpbi/belt/end/range" in told and "sensor_msgs/Range" in told and "rpbi/belt/speed" in told
    _do(workspace, f"/usr/bin/python3 -m pytest -q src/{NAME}/tests")
    config = workspace / "wrong.yaml"
    config.write_text("objects: [belt.yaml]")
    belt = (workspace / "src" / NAME / "configs" / "belt.yaml").read_text().replace("Conveyor", "Conveyer")
    (workspace / "belt.yaml").write_text(belt)
    told = _do(workspace, f"{check} wrong.yaml", code=1)
    assert f"belt.yaml: type: '{NAME}.conveyor' has no 'Conveyer'; did you mean 'Conveyor'?" in told


@pytest.mark.thorough
def test_missing_package_is_named_by_the_node(ros, workspace):
    belt = workspace / "src" / NAME / "configs" / "belt.yaml"
    process = ros.simulator({"objects": [str(belt)]}, wait=False)
    assert process.wait(60.0) == 1
    printed = ros.output(process)
    missing = f"no module '{NAME}': is its package built, and its workspace sourced?"
    assert f"{belt}: type: {missing}" in printed and f"{belt}: sensors[0].type: {missing}" not in printed
    assert "Traceback" not in printed


def _faulty(ros, tmp_path, **keys):
    """Starts a world with a thing that fails."""
    config = main_config(tmp_path)
    thing = {"name": "thing", "type": "faulty_lab:Thing", **keys}
    config["objects"] = [ros.write_yaml("thing.yaml", thing)]
    return ros.simulator(config, use_sim_time=True, wait=False, **support_on_path())


@pytest.mark.parametrize(
    ("keys", "line"),
    [
        ({"sensors": [{"name": "gauge", "type": "faulty_lab:Gauge", "hz": 10.0}]},
         "faulty_lab:Gauge: ros_topic: missing, expected 'module:NAME' of the Topic for its Number"),
        ({"sensors": [{"name": "gauge", "type": "faulty_lab:LostGauge", "hz": 10.0}]},
         "faulty_lab:LostGauge: ros_topic: 'faulty_lab' has no 'LOST_TOPIC'"),
        ({"sensors": [{"name": "gauge", "type": "faulty_lab:OddTopicGauge", "hz": 10.0}]},
         "faulty_lab:OddTopicGauge: ros_topic: expected a rpbi.ros.endpoints:Topic in "
         "'faulty_lab:NOT_A_CLASS'"),
        ({"takes": "push"}, "faulty_lab:Thing._push: ros_topic: missing, expected 'module:NAME' of the Topic"),
        ({"fails": "init"}, "thing.yaml: faulty_lab:Thing failed in making 'thing': KeyError: 'no such key' ("),
    ],
)  # fmt: skip
def test_package_without_its_dependencies_ends_the_node_with_one_line(ros, tmp_path, keys, line):
    process = _faulty(ros, tmp_path, **keys)
    assert process.wait(60.0) == 1
    printed = ros.output(process)
    assert line in printed and "Traceback" not in printed


def test_class_failing_in_a_tick_stops_simulation_with_one_line(ros, tmp_path):
    rosout = Rosout(ros)
    process = _faulty(ros, tmp_path, fails="before_step")
    failure = "faulty_lab:Thing failed in before_step of 'thing' at tick 5: ZeroDivisionError: division by zero"
    rosout.wait_for([f"simulation stopped: {failure} ({SUPPORT}/plugins/faulty_lab.py, line"])
    assert "Traceback" not in ros.output(process)
    answer = ros.call("/rpbi/step", Trigger)
    assert not answer.success and failure in answer.message
    assert objects(ros) == {"thing": "faulty_lab:Thing"}
    assert remove(ros, "thing").success
    assert ros.call("/rpbi/start", Trigger).success


@pytest.mark.parametrize(
    ("keys", "cause"),
    [
        ({"topic": "faulty_topics:PUSH_X"}, f"AttributeError: 'float' object has no attribute 'x' ({SUPPORT}/plugins/"),
        ({"topic": "faulty_topics:PUSH", "fails": "check"}, f"KeyError: 'no such unit' ({SUPPORT}/plugins/"),
    ],
)
def test_message_that_raises_in_its_class_is_refused_with_location(ros, tmp_path, keys, cause):
    process = _faulty(ros, tmp_path, takes="push", **keys)
    refused = f"/rpbi/thing/push: message refused: faulty_lab:Thing._push failed in applying 'thing/push': {cause}"
    with publishing("/rpbi/thing/push", Float64) as push:
        push.publish(1.0)
        wait_until(lambda: refused in ros.output(process), "it says so")
    printed = ros.output(process)
    assert "Traceback" not in printed and "bad callback" not in printed
    assert "simulation stopped" not in printed
