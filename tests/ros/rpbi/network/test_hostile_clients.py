"""What anybody in the graph may send: every caller is answered, and the node neither dies, hangs nor tells secrets."""

from __future__ import annotations

import json
import math
import os
import random
import resource
import socket
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from urllib.parse import urlsplit

import pytest
import rosgraph
import roslib.message
import rospy
import rosservice
import yaml
from geometry_msgs.msg import TransformStamped
from node_world import add, main_config, objects, publishing, remove
from ros_system import support_on_path, wait_until
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage
from worlds import FLOOR, ball, iiwa

from custom_ros_tools.ros.lifecycle.run_node import MAX_FILES
from custom_ros_tools.ros.tf_interface import END_OF_TIME_S
from ros_pybullet_interface.msg import PybulletObject
from ros_pybullet_interface.srv import SetRealTimeFactor, StepN

ROOT = Path(__file__).resolve().parents[4]
NODE = "/ros_pybullet_interface"
CALLS, MESSAGES = 400, 100
FILES_EACH = 4
LONGEST_ANSWER_S = 120.0
FLOATS = (math.nan, math.inf, -math.inf, -1.0, 0.0, 0.5, 1e300, -1e300, 1e-300)
BOMB = "k0: &a0 {y: 1}\n" + "\n".join(f"k{n}: &a{n} {{<<: [*a{n - 1}, *a{n - 1}]}}" for n in range(1, 30))
TEXTS = (
    *(
        "",
        "iiwa",
        "ball",
        "ball/link0",
        "iiwa/lbr_iiwa_joint_3",
        "nothing",
        "a" * 5000,
        "%s%n{}",
        "ä\u202e",
        "[1, 2",
        BOMB,
    ),
    *("/etc/shadow", "/proc/kmsg", "/dev/zero", "{file: /etc/shadow}", "{file: secret.yaml}", "../" * 300, "null"),
    *("mass: .nan", "mass: 1.0e+300", "numSolverIterations: 99999999999", "erp: [1]", "lateralFriction: {a: 1}"),
    *("{name: a, type: 'this:x'}", "{name: a, type: 'unittest.__main__:x'}", "!!python/object/apply:os.getcwd []"),
    yaml.safe_dump({**ball("garbage"), "baseMass": 1e300}),
    yaml.safe_dump({**ball("garbage"), "basePosition": [1e300, 0, 0]}),
    yaml.safe_dump(iiwa("garbage", controllers={"a": {"type": "this:x"}})),
    yaml.safe_dump(iiwa("garbage", loadURDF={"fileName": "/proc/kmsg"})),
)


@pytest.fixture(scope="module")
def node(module_ros):
    arm = iiwa(joint_trajectory_controller={}, controllers={"springs": {"type": "joint_impedance", "active": False}})
    config = main_config(
        module_ros.folder,
        collision=(FLOOR, {**FLOOR, "name": "follower", "object_tf": {"tf_id": "marker", "hz": 100}}),
        dynamic=(ball(broadcast_hz=50, basePosition=[1.5, 0.0, 5.0]),),
        robots=(arm,),
        setAdditionalSearchPath="pybullet_data_path",
    )
    return module_ros.simulator(config, use_sim_time=True)


def _garbage(random, type_name, field=""):
    """Returns a value of a field's type that can be sent and makes little sense."""
    if type_name.endswith("]"):
        base, _, length = type_name[:-1].partition("[")
        return [_garbage(random, base) for _ in range(int(length or random.choice((0, 1, 2, 8))))]
    if type_name == "string":
        return random.choice(TEXTS)
    if type_name == "bool":
        return bool(random.randrange(2))
    if type_name in ("time", "duration"):
        limit = 2**32 - 1 if type_name == "time" else 2**31 - 1
        return (rospy.Time if type_name == "time" else rospy.Duration)(
            random.choice((0, 1, limit)), random.choice((0, 1))
        )
    if type_name.startswith("float"):
        return random.choice(FLOATS if type_name == "float64" else FLOATS[:6])
    if type_name.startswith(("int", "uint", "byte", "char")):
        bits = int(type_name.lstrip("uint") or 8) if type_name[0] in "iu" else 8
        highest = 2 ** (bits - (type_name[0] == "i")) - 1
        return 3 if field == "steps" else random.choice((0, 1, 2, highest))
    return _fill(random, roslib.message.get_message_class(type_name)())


def _fill(random, message):
    for field, type_name in zip(message.__slots__, message._slot_types):
        setattr(message, field, _garbage(random, type_name, field))
    return message


def _of_node(kind):
    """Returns the names of what the node subscribes to (1) or serves (2)."""
    state = rosgraph.Master("/tests").getSystemState()[kind]
    return sorted(name for name, nodes in state if NODE in nodes and not name.startswith(NODE) and "rosout" not in name)


def _answer(name, request):
    """Returns what the node answers; an error is an answer too."""
    try:
        return str(rospy.ServiceProxy(name, rosservice.get_service_class_by_name(name))(request))
    except rospy.ServiceException as error:
        return str(error)


def _is_well(ros, node):
    assert node.poll() is None, ros.output(node)[-3000:]
    assert {"floor", "iiwa"} <= objects(ros).keys()
    said = ros.output(node)
    assert "Traceback" not in said and "not foreseen" not in said, said[-6000:]


@pytest.mark.quick
def test_garbage_in_services_is_answered(ros, node):
    chance = random.Random(1)
    services = [name for name in _of_node(2) if "remove" not in name]
    assert len(services) > 25
    with ThreadPoolExecutor(6) as callers:
        asked = []
        for turn in range(CALLS):
            name = services[turn % len(services)]
            asked.append((name, _fill(chance, rosservice.get_service_class_by_name(name)._request_class())))
        waiting = [(name, request, callers.submit(_answer, name, request)) for name, request in asked]
        answers = []
        for name, request, future in waiting:
            try:
                answers.append(future.result(LONGEST_ANSWER_S))
            except TimeoutError:
                pytest.fail(f"{name} does not answer {request}")
    assert len(answers) == CALLS
    assert not any("$6$" in answer or "root:" in answer for answer in answers)
    ros.call("/rpbi/reset", Trigger)
    assert ros.call("/rpbi/set_real_time_factor", SetRealTimeFactor, 1.0).success  # it may run free since then
    _is_well(ros, node)


def test_long_texts_are_not_repeated_and_endless_requests_are_refused(ros, node):
    long = "a" * 20_000
    for name in _of_node(2):
        request = rosservice.get_service_class_by_name(name)._request_class()
        for field, type_name in zip(request.__slots__, request._slot_types):
            if type_name.startswith("string"):
                setattr(request, field, long if type_name == "string" else [long])
        if hasattr(request, "pybullet_object"):
            request.pybullet_object.config = f"{long}: {long}"
        assert len(_answer(name, request)) < 6_000, name
    ros.call("/rpbi/stop", Trigger)
    answer = ros.call("/rpbi/step_n", StepN, 2**32 - 1)
    assert not answer.success and answer.message.startswith("steps: expected at most 1000000, got 4294967295")
    ros.call("/rpbi/reset", Trigger)
    _is_well(ros, node)


def test_garbage_on_topics_changes_nothing(ros, node):
    ros.call("/rpbi/start", Trigger)
    chance = random.Random(2)
    types = dict(rosgraph.Master("/tests").getTopicTypes())
    topics = [name for name in _of_node(1) if name in types]
    assert "/tf" in topics and "/rpbi/iiwa/joint_states/target" in topics
    for topic in topics:
        message_type = roslib.message.get_message_class(types[topic])
        with publishing(topic, message_type) as publisher:
            for _ in range(math.ceil(MESSAGES / len(topics))):
                publisher.publish(_fill(chance, message_type()))
            # What is no message at all: bytes that do not fit the type
            publisher.impl.publish(_Raw(chance.randbytes(50)), connection_override=None)
    _is_well(ros, node)


class _Raw(rospy.AnyMsg):
    """Bytes that are sent as they are."""

    def __init__(self, data):
        super().__init__()
        self._buff = data


def test_tf_beyond_the_largest_time_does_not_end_the_node(ros, node):
    transform = TransformStamped(child_frame_id="marker")
    transform.header.frame_id = "rpbi/world"
    transform.transform.rotation.w = 1.0
    with publishing("/tf", TFMessage) as tf:  # one: rospy may miss a publisher that ends and comes back at once
        for seconds in (END_OF_TIME_S, 2_200_000_000, 2**32 - 1):
            transform.header.stamp = rospy.Time(seconds)
            for _ in range(10):
                tf.publish(TFMessage([transform]))
                time.sleep(0.02)  # so that it is looked up in between
            _is_well(ros, node)


@pytest.mark.parametrize(
    "kind", ["urdf", *(pytest.param(kind, marks=pytest.mark.thorough) for kind in ("mesh", "yaml"))]
)
def test_check_and_node_agree_on_hostile_files(ros, node, tmp_path, kind):
    program = str(ROOT / "dev/robustness/hostile_files/verdicts.py")
    command = [sys.executable, program, "node", str(tmp_path), "2000", str(FILES_EACH), kind]
    done = subprocess.run(command, capture_output=True, text=True, env={**os.environ, **support_on_path()}, check=True)
    verdicts = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("[")]
    assert len(verdicts) == 2 * FILES_EACH
    for (_, seed, by, verdict, text), (*_, at_start, said) in zip(verdicts[::2], verdicts[1::2]):
        assert (by, verdict) == ("check", at_start) and verdict in ("taken", "refused"), (seed, text, at_start, said)
        problems = [line.removeprefix("error: ") for line in text.splitlines() if line.startswith("error: ")]
        assert all(problem in said for problem in problems), (seed, text, said)
        if kind != "yaml":
            _add(ros, yaml.safe_load((tmp_path / f"{kind}{seed}" / "it.yaml").read_text()), verdict, problems)
    _is_well(ros, node)


def _add(ros, config, verdict, problems):
    """Adds to the running world what is in a hostile file, unless that is for a world of its own kind."""
    if "loadSoftBody" in config:
        return
    answer = add(ros, PybulletObject.URDF if "loadURDF" in config else PybulletObject.DYNAMIC, config)
    assert answer.success == (verdict == "taken"), (config, verdict, problems, answer.message)
    if answer.success:
        assert remove(ros, "it").success
    else:
        assert answer.message.replace("config: ", "") == "\n".join(problems).replace("it.yaml: ", "")


def test_silent_or_invalid_connections_block_no_other_client(ros, node):
    address = urlsplit(rosgraph.Master("/tests").lookupService("/rpbi/list_objects"))
    with ThreadPoolExecutor(1) as callers, ExitStack() as stack:
        for said in (b"", b"\x10", b"POST /RPC2 HTTP/1.1\r\n\r\n"):
            connection = stack.enter_context(socket.create_connection((address.hostname, address.port)))
            connection.sendall(said)
            assert "iiwa" in callers.submit(objects, ros).result(LONGEST_ANSWER_S)
        states = ros.listen("/rpbi/iiwa/joint_states", JointState)
        wait_until(lambda: states.is_connected, "the node sends to who subscribes")
    _is_well(ros, node)


def test_a_node_that_was_out_of_file_handles_hears_again(ros, node):
    soft, hard = resource.prlimit(node.pid, resource.RLIMIT_NOFILE)
    assert soft >= min(hard, MAX_FILES), "it may have many from its start"
    with ThreadPoolExecutor(1) as callers:
        try:
            resource.prlimit(node.pid, resource.RLIMIT_NOFILE, (3, hard))  # the standard streams, which it has
            asked = callers.submit(objects, ros)
            with pytest.raises(TimeoutError):
                asked.result(2.0)
        finally:
            resource.prlimit(node.pid, resource.RLIMIT_NOFILE, (soft, hard))
    assert "iiwa" in wait_until(lambda: objects(ros), "it answers again")
    _is_well(ros, node)
