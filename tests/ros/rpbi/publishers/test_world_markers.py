"""The world as markers for RViz: everything in it, in the right frames, and nothing that has gone."""

from __future__ import annotations

import time

import pytest
import rosgraph
from custom_srvs.srv import SetTransform
from geometry_msgs.msg import Transform
from node_world import add, main_config, remove
from ros_system import wait_until
from std_srvs.srv import Trigger
from visualization_msgs.msg import Marker, MarkerArray
from worlds import FLOOR, ball, box, iiwa, write_world

from ros_pybullet_interface.msg import PybulletObject
from ros_pybullet_interface.srv import StepN
from rpbi.ros.publishers import world_markers
from rpbi.world import World

TOPIC = "/rpbi/markers"
MARK = {
    "name": "mark",
    "createVisualShape": {
        "shapeType": "GEOM_BOX",
        "halfExtents": [0.1, 0.2, 0.3],
        "visualFramePosition": [0.5, 0.0, 0.1],
        "visualFrameOrientation": [0.0, 0.0, 0.6, 0.8],
        "rgbaColor": [0.125, 0.25, 0.5, 0.75],
    },
}


@pytest.fixture
def start(ros, tmp_path):
    """Starts a world and listens to its markers."""

    def start(**parts):
        ros.simulator(main_config(tmp_path, setAdditionalSearchPath="pybullet_data_path", **parts), use_sim_time=True)
        markers = ros.listen(TOPIC, MarkerArray)
        markers.wait_for()
        return markers

    return start


def shown(listener):
    """Returns what RViz would show after all messages so far: markers by namespace and id."""
    found = {}
    for message in list(listener.messages):
        for marker in message.markers:
            if marker.action == Marker.DELETE:
                found.pop((marker.ns, marker.id), None)
            else:
                found[marker.ns, marker.id] = marker
    return found


def place(pose):
    """Returns the numbers of a pose: x, y, z and quaternion x, y, z, w."""
    position, quat = pose.position, pose.orientation
    return position.x, position.y, position.z, quat.x, quat.y, quat.z, quat.w


@pytest.mark.quick
def test_every_body_has_markers_locked_to_its_link_frames(start):
    following = {**MARK, "name": "follower", "object_tf": {"tf_id": "somewhere"}}
    told = iiwa("told", broadcast_link_states=True)
    for_publisher = iiwa("for_publisher", broadcast_root_tf_hz=50)
    listener = start(
        visual=(MARK, following),
        collision=(FLOOR,),
        dynamic=(box("told_box", broadcast_hz=50), box("quiet_box", basePosition=[1.0, 0.0, 0.1])),
        robots=(told, for_publisher, iiwa("quiet")),
    )
    links = {f"lbr_iiwa_link_{number}" for number in range(8)}
    frames = {}
    for marker in shown(listener).values():
        frames.setdefault(marker.ns, set()).add(marker.header.frame_id)
        assert marker.frame_locked
        assert marker.header.stamp.to_nsec() == 0
        assert marker.lifetime.to_nsec() == 0
    assert frames == {
        "mark": {"rpbi/world"},
        "follower": {"somewhere"},
        "floor": {"rpbi/world"},
        "told_box": {"rpbi/told_box"},
        "quiet_box": {"rpbi/world"},
        "told": {f"rpbi/told/{link}" for link in links},
        "for_publisher": {f"rpbi/for_publisher/{link}" for link in links},
        "quiet": {"rpbi/world"},
    }
    assert {marker.mesh_resource.rsplit("/", 1)[1] for marker in shown(listener).values() if marker.ns == "quiet"} == {
        f"link_{number}.obj" for number in range(8)
    }


@pytest.mark.parametrize("object_tf", [None, {"tf_id": "somewhere"}], ids=["at the origin", "following TF"])
def test_marker_is_where_its_yaml_says_and_looks_like_it(start, object_tf):
    ((_, marker),) = shown(start(visual=({**MARK, "object_tf": object_tf},))).items()
    assert (marker.ns, marker.id, marker.type, marker.action) == ("mark", 0, Marker.CUBE, Marker.ADD)
    assert place(marker.pose) == pytest.approx((0.5, 0.0, 0.1, 0.0, 0.0, 0.6, 0.8), abs=1e-6)
    assert (marker.scale.x, marker.scale.y, marker.scale.z) == pytest.approx((0.2, 0.4, 0.6))
    assert (marker.color.r, marker.color.g, marker.color.b, marker.color.a) == (0.125, 0.25, 0.5, 0.75)


def test_tf_prefix_is_put_before_frames_of_ours_only(start):
    following = {**MARK, "object_tf": {"tf_id": "somewhere"}}
    listener = start(visual=(following,), collision=(FLOOR,), dynamic=(ball(broadcast_hz=50),), tf_prefix="twin")
    frames = {marker.ns: marker.header.frame_id for marker in shown(listener).values()}
    assert frames == {"mark": "somewhere", "floor": "twin/rpbi/world", "ball": "twin/rpbi/ball"}


def test_late_listener_gets_the_whole_world_in_one_message(ros, start):
    listener = start(collision=(FLOOR,))
    assert add(ros, PybulletObject.VISUAL, MARK).success
    wait_until(lambda: len(shown(listener)) == 2, "the new one is shown")
    late = ros.listen(TOPIC, MarkerArray)
    (message,) = late.wait_for()
    assert {marker.ns for marker in message.markers} == {"floor", "mark"}
    assert message._connection_header["latching"] == "1"


def test_marker_of_a_removed_body_is_deleted_and_others_stay(ros, start):
    listener = start(collision=(FLOOR,), robots=(iiwa(),))
    before = set(shown(listener))
    assert add(ros, PybulletObject.VISUAL, MARK).success
    wait_until(lambda: set(shown(listener)) == before | {("mark", 0)}, "the new one is shown")
    assert remove(ros, "iiwa").success
    wait_until(lambda: set(shown(listener)) == {("floor", 0), ("mark", 0)}, "the robot has gone")
    assert {marker.ns for marker in listener.messages[-1].markers if marker.action == Marker.ADD} == {"floor", "mark"}


def test_marker_of_an_object_without_tf_follows_until_rest(ros, start):
    falling = box(basePosition=[0.0, 0.0, 0.4])
    listener = start(collision=(FLOOR,), dynamic=(falling,), start_pybullet_after_initialization=False)

    def is_shown_at(height_m):
        return shown(listener)["box", 0].pose.position.z == pytest.approx(height_m, abs=5e-3)

    for fallen_s in (0.05, 0.1, 0.15, 0.2):
        assert ros.call("/rpbi/step_n", StepN, 50).success
        height_m = 0.4 - 9.81 / 2 * fallen_s**2
        wait_until(lambda height_m=height_m: is_shown_at(height_m), f"it is shown at {height_m:g} m")
    assert ros.call("/rpbi/step_n", StepN, 3000).success
    wait_until(lambda: is_shown_at(0.1), "it lies on the floor")
    assert add(ros, PybulletObject.VISUAL, MARK).success  # then all is told, as it is now
    wait_until(lambda: ("mark", 0) in shown(listener), "the new one is shown")
    count = len(listener.messages)
    assert ros.call("/rpbi/step_n", StepN, 500).success
    time.sleep(0.5)  # some looks at what lies still
    assert remove(ros, "mark").success
    wait_until(lambda: ("mark", 0) not in shown(listener), "it has gone")
    assert len(listener.messages) == count + 1


def test_robot_without_tf_is_shown_at_its_joint_positions(start):
    listener = start(robots=(iiwa(initial_joint_position={"lbr_iiwa_joint_2": 90.0}),))
    flange = shown(listener)["iiwa", 7].pose.position
    assert (flange.x, flange.y, flange.z) == pytest.approx((0.901, 0.0, 0.36), abs=0.01)


def test_object_moved_in_a_paused_world_is_shown_there(ros, start):
    listener = start(visual=(MARK,))
    ros.call("/rpbi/stop", Trigger)
    target = Transform()
    target.translation.y, target.rotation.w = 2.0, 1.0
    assert ros.call("/rpbi/mark/set_pose", SetTransform, target).success
    wait_until(lambda: shown(listener)["mark", 0].pose.position.y == pytest.approx(2.0), "it is shown there")


def test_rate_of_0_switches_markers_off(ros, tmp_path):
    ros.simulator(main_config(tmp_path, collision=(FLOOR,), markers_hz=0))
    published = rosgraph.Master("/tests").getSystemState()[0]
    assert TOPIC not in [topic for topic, _ in published]


def test_many_shapes_are_checked_in_several_polls(ros, tmp_path, monkeypatch):
    monkeypatch.setattr(world_markers, "LONGEST_CHECK_S", 0.0)
    world = World.from_file(write_world(tmp_path, robots=(iiwa(),)))
    markers = world_markers.WorldMarkers(world, 1000.0)
    listener = ros.listen(TOPIC, MarkerArray)
    polls = 0
    while not listener.messages:
        markers.poll()
        polls += markers._check is not None
    (message,) = listener.messages
    markers._publisher.unregister()
    world.close()
    assert polls == len(message.markers) == 8, "each poll had time for one"
