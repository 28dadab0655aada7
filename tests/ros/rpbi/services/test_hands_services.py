"""Attachments and external wrenches by services and topics."""

from __future__ import annotations

import gc
import math
import os

import pytest
import rospy
from cob_srvs.srv import SetString
from geometry_msgs.msg import Point, Pose, Vector3, Wrench, WrenchStamped
from node_world import Rosout, count, main_config, publishing, remove
from ros_system import wait_until
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage
from worlds import FLOOR, box, iiwa

from custom_ros_tools.ros.rospy_internals import close_poller_with
from ros_pybullet_interface.msg import Attachment, Attachments, WorldCommands
from ros_pybullet_interface.srv import ApplyWrench, Attach, StepN

HAND = "iiwa/lbr_iiwa_link_7"
STILL = {"linearDamping": 0.0, "angularDamping": 0.0}


@pytest.fixture(scope="module")
def simulator(module_ros):
    small = {"half_extents_m": (0.03, 0.03, 0.03), "changeDynamics": STILL, "broadcast_hz": 1000}
    config = main_config(
        module_ros.folder,
        collision=(FLOOR,),
        dynamic=(box(basePosition=[1.0, 0.0, 1.0], **small),),
        robots=(iiwa(),),
        setAdditionalSearchPath="pybullet_data_path",
        setGravity={},
        start_pybullet_after_initialization=False,
    )
    return module_ros.simulator(config, use_sim_time=True)


@pytest.fixture
def node(ros, simulator):
    assert ros.call("/rpbi/reset", Trigger).success
    return ros


def attach(ros, **fields):
    asked = {"name": "tool", "parent": HAND, "child": "box", **fields}
    return ros.call("/rpbi/attach", Attach, Attachment(**asked))


def step(ros, ticks):
    """Returns the stamp of the last tick."""
    answer = ros.call("/rpbi/step_n", StepN, ticks)
    assert answer.success, answer.message
    return answer.stamp


def noted(commands):
    """Returns what has entered the world."""
    return {command.what for message in list(commands.messages) for command in message.commands}


def positions(ros):
    """Returns a function that tells where the box was last; at a stamp, once that has come."""
    listener = ros.listen("/tf", TFMessage)

    def newest():
        found = [one for m in list(listener.messages) for one in m.transforms if one.child_frame_id == "rpbi/box"]
        return found[-1]

    def last(stamp=None):
        if stamp is not None:
            wait_until(lambda: newest().header.stamp >= stamp, "the last tick has come")
        place = newest().transform.translation
        return place.x, place.y, place.z

    return last


@pytest.mark.quick
def test_attach_push_break_and_detach(node):
    ros = node
    rosout, state = Rosout(ros), ros.listen("/rpbi/attachments", Attachments)
    assert attach(ros, max_force=20.0).success
    (one,) = wait_until(lambda: state.messages[-1].attachments, "it is held")
    assert (one.name, one.parent, one.child, one.kind, one.max_force) == ("tool", HAND, "box", "fixed", 20.0)
    assert "already" in attach(ros, name="again").message
    step(ros, 50)
    push = ros.call("/rpbi/apply_wrench", ApplyWrench, "box", Wrench(force=Vector3(0.0, 0.0, 50.0)), Point(), "", 0.0)
    assert push.success, push.message
    step(ros, 50)
    broke = "'tool' of 'box' to 'iiwa/lbr_iiwa_link_7' broke at tick"
    wait_until(lambda: broke in state.messages[-1].last_change, "it has broken")
    assert not state.messages[-1].attachments
    rosout.wait_for([broke])
    assert attach(ros, kind="ball").success
    assert ros.call("/rpbi/detach", SetString, "tool").success
    gone = ros.call("/rpbi/detach", SetString, "tool")
    assert not gone.success and gone.message == "unknown attachment 'tool': there is none"


def test_removing_a_body_ends_its_attachments_and_a_reset_too(node):
    ros = node
    rosout, state = Rosout(ros), ros.listen("/rpbi/attachments", Attachments)
    assert attach(ros).success
    wait_until(lambda: state.messages[-1].attachments, "it is held")
    assert ros.call("/rpbi/reset", Trigger).success
    wait_until(lambda: state.messages[-1].last_change == "the world was reset", "a reset ends it")
    assert attach(ros).success
    wait_until(lambda: state.messages[-1].attachments, "it is held again")
    assert remove(ros, "box").success
    wait_until(lambda: not state.messages[-1].attachments, "the attachment has ended")
    rosout.wait_for(["'tool' of 'box' to 'iiwa/lbr_iiwa_link_7' ended, since 'box' was removed"])


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"child": "bx"}, "unknown object 'bx'"),
        ({"parent": "iiwa/hand"}, "unknown link of iiwa 'hand'"),
        ({"max_force": -1.0}, "attachment: max_force: must be > 0 [N], got -1.0"),
        ({"max_force": math.nan}, "attachment: max_force"),
        ({"kind": "glue"}, "attachment: kind"),
        ({"name": ""}, "attachment: name"),
        ({"parent_pose": Pose(position=Point(math.inf, 0.0, 0.0))}, "attachment: parent_pose.position"),
    ],
)
def test_attachments_that_make_no_sense_are_refused(node, fields, message):
    answer = attach(node, **fields)
    assert not answer.success and message in answer.message


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        (("floor", Wrench(force=Vector3(1, 0, 0)), Point(), "world", 1.0), "'floor/link0' is static"),
        (("box", Wrench(force=Vector3(math.nan, 0, 0)), Point(), "world", 1.0), "force must be finite"),
        (("box", Wrench(), Point(math.inf, 0, 0), "link", 1.0), "point must be finite"),
        (("box", Wrench(), Point(), "moon", 1.0), "frame: expected world or link, got 'moon'"),
        (("box", Wrench(), Point(), "", math.nan), "duration: must be a number [s], got nan"),
        (("ball", Wrench(), Point(), "", 1.0), "unknown object 'ball'"),
        (("iiwa/hand", Wrench(), Point(), "", 1.0), "unknown link of iiwa 'hand'"),
    ],
)
def test_wrenches_that_make_no_sense_are_refused(node, asked, message):
    answer = node.call("/rpbi/apply_wrench", ApplyWrench, *asked)
    assert not answer.success and message in answer.message


def test_wrench_by_topic_acts_in_its_frame_for_a_time(node):
    ros, place = node, positions(node)
    message = WrenchStamped(wrench=Wrench(force=Vector3(1.0, 0.0, 0.0)))
    message.header.frame_id = "rpbi/box"
    commands = ros.listen("/rpbi/commands", WorldCommands)
    with publishing("/rpbi/box/external_wrench", WrenchStamped) as publisher:
        publisher.publish(message)
        wait_until(lambda: step(ros, 1) and "input" in noted(commands), "the wrench has come")
    stamp = step(ros, 1000)
    # v = 0.5 m/s after 0.5 s, then coasting: 0.125 m and as far as it coasted, at least 0.2 m
    first = place(stamp)[0]
    assert first > 1.0 + 0.125 + 0.2
    assert place(step(ros, 100))[0] == pytest.approx(first + 0.05, abs=1e-4), "it coasts at 0.5 m/s"


def test_invalid_wrench_by_topic_is_named_in_the_log(node):
    rosout = Rosout(node)
    message = WrenchStamped(wrench=Wrench(force=Vector3(math.nan, 0.0, 0.0)))
    with publishing("/rpbi/box/external_wrench", WrenchStamped) as publisher:
        publisher.publish(message)
        rosout.wait_for(["/rpbi/box/external_wrench: message refused: force must be finite"])


def test_pollers_of_topics_go_with_them(ros):
    """Each of them is an open file."""
    gc.disable()
    try:
        before = count(os.getpid(), "fd")
        for turn in range(20):
            subscriber = rospy.Subscriber(f"/poller_{turn}", WrenchStamped, lambda _: None)
            close_poller_with(subscriber)
            subscriber.unregister()
        # Other threads of this process may have a connection to the master just then
        wait_until(lambda: count(os.getpid(), "fd") < before + 5, "the pollers are closed", 20.0)
    finally:
        gc.enable()
