"""Where TF and K say that the links of the moving example arm are in the image, there the camera sees them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from robot_shape import link_triangles, moved, pose_matrix
from ros_system import stop_group, wait_until
from sensor_msgs.msg import CameraInfo, Image, JointState
from tf2_msgs.msg import TFMessage

from ros_pybullet_interface.srv import RobotInfo

EXAMPLES = Path(__file__).resolve().parents[4] / "src/rpbi_examples"
ARM = link_triangles(EXAMPLES / "robots/kuka_lwr.urdf", EXAMPLES)
TOPICS = {
    "colour/image": Image,
    "depth/image": Image,
    "segmentation": Image,
    "colour/camera_info": CameraInfo,
    "depth/camera_info": CameraInfo,
}
ROOT_FRAME = "rpbi/kuka_lwr/base"
DT_NS = 1_000_000
CAMERA_HZ = 15
FRAMES = 6
MOVES = 0.05
"""A joint that goes so far from one of the frames to the next moves [rad]."""
SURFACE_POINTS = 1500
"""Points of each link."""
FACING = 0.5
"""Least cosine between the way to the camera and the normal of a surface that counts as seen."""
AGREES_M = 0.01
"""Most difference of two depths that are the same: a pixel is 4 mm wide at the arm, and surfaces slant."""


class Frame:
    """What came with one stamp."""

    def __init__(self, messages, poses):
        self.messages, self.poses = messages, poses
        info = messages["depth/camera_info"]
        self.K = np.reshape(info.K, (3, 3))
        self.depth_m = self._pixels("depth/image", np.float32)
        self.body_ids = self._pixels("segmentation", np.uint16)
        self._optical_from_world = np.linalg.inv(poses["rpbi/camera"])

    def _pixels(self, topic, kind):
        message = self.messages[topic]
        return np.frombuffer(message.data, kind).reshape(message.height, message.width)

    def to_camera(self, link, points):
        """Returns points of a link in the optical frame."""
        return moved(moved(points, self.poses[f"rpbi/kuka_lwr/{link}"]), self._optical_from_world)

    def to_pixels(self, points):
        """Returns columns and rows of points in the optical frame that are inside the image, and which are."""
        projected = points @ self.K.T
        u, v = np.rint(projected[:, :2] / projected[:, 2:]).astype(int).T
        height, width = self.depth_m.shape
        inside = (u >= 0) & (u < width) & (v >= 0) & (v < height)
        return u[inside], v[inside], inside


@pytest.fixture(scope="module")
def listeners(module_ros):
    """Listeners to the topics of the example, which is launched later."""
    listeners = {topic: module_ros.listen(f"/rpbi/camera/{topic}", kind) for topic, kind in TOPICS.items()}
    listeners["tf"], listeners["tf_static"] = (module_ros.listen(f"/{name}", TFMessage) for name in ("tf", "tf_static"))
    listeners["joints"] = module_ros.listen("/rpbi/kuka_lwr/joint_states", JointState)
    return listeners


@pytest.fixture(scope="module")
def seen(module_ros, listeners):
    """Frames for which TF has the links at the very stamp, the arm moving from each to the next; and the arm's id."""
    arguments = ["headless:=true", "swing:=true"]  # a hand that pushes the box would be behind it
    example = module_ros.start(["roslaunch", "rpbi_examples", "basic_example_kuka_lwr.launch", *arguments])

    def with_links():
        """Returns the messages about the links by stamp [ns]; others tell of other bodies."""
        messages = list(listeners["tf"].messages)
        links = {}
        for message in messages:
            if any(one.child_frame_id == ROOT_FRAME for one in message.transforms):
                links[message.transforms[0].header.stamp.to_nsec()] = message
        return links

    def chosen():
        joints = dict(zip(listeners["joints"].stamps_ns, listeners["joints"].messages))
        common = set(joints).intersection(with_links(), *(listeners[topic].stamps_ns for topic in TOPICS))
        stamps = []
        for stamp in sorted(common):
            if not stamps or np.ptp([joints[stamp].position, joints[stamps[-1]].position], axis=0).max() > MOVES:
                stamps.append(stamp)
        return stamps if len(stamps) >= FRAMES else None

    def still():
        return [one for message in list(listeners["tf_static"].messages) for one in message.transforms]

    wait_until(lambda: any(one.child_frame_id == "rpbi/camera" for one in still()), "TF has the camera")
    stamps = wait_until(chosen, "there are enough frames")
    by_stamp = {topic: dict(zip(listeners[topic].stamps_ns, listeners[topic].messages)) for topic in TOPICS}
    links = with_links()
    frames = [
        Frame(
            {topic: messages[stamp] for topic, messages in by_stamp.items()},
            {one.child_frame_id: pose_matrix(one.transform) for one in [*still(), *links[stamp].transforms]},
        )
        for stamp in stamps[:FRAMES]
    ]
    arm_id = module_ros.call("/rpbi/kuka_lwr/robot_info", RobotInfo).bodyUniqueId
    stop_group(example)  # which would draw on for its listeners
    return frames, arm_id


@pytest.fixture(scope="module")
def frames(seen):
    return seen[0]


@pytest.fixture(scope="module")
def arm_id(seen):
    """The arm's id in PyBullet."""
    return seen[1]


def surface(triangles, count, generator):
    """Returns points spread evenly over triangles, and the normals there."""
    edges = triangles[:, 1:] - triangles[:, :1]
    normals = np.cross(edges[:, 0], edges[:, 1])
    area = np.linalg.norm(normals, axis=1)
    chosen = generator.choice(len(area), count, p=area / area.sum())
    shares = generator.random((count, 2))
    beyond = shares.sum(axis=1) > 1.0
    shares[beyond] = 1.0 - shares[beyond]
    points = triangles[chosen, 0] + np.einsum("ni,nij->nj", shares, edges[chosen])
    return points, normals[chosen] / area[chosen, None]


def nearest_depth(frame, generator):
    """Returns the depth of the arm's nearest surface at each pixel by TF and K alone [m]; inf where there is none."""
    depth_m = np.full(frame.depth_m.shape, np.inf)
    for link, triangles in ARM.items():
        points = frame.to_camera(link, surface(triangles, 40 * SURFACE_POINTS, generator)[0])
        u, v, inside = frame.to_pixels(points)
        np.minimum.at(depth_m, (v, u), points[inside, 2])
    return depth_m


def seen_points(frame, generator):
    """Yields link, columns, rows and depths of points that face the camera and have nothing of the arm before them."""
    nearest_m = nearest_depth(frame, generator)
    for link, triangles in ARM.items():
        points, normals = surface(triangles, SURFACE_POINTS, generator)
        in_camera = frame.to_camera(link, points)
        tips = frame.to_camera(link, points + normals)
        facing = np.einsum("ni,ni->n", tips - in_camera, -in_camera) > FACING * np.linalg.norm(in_camera, axis=1)
        in_camera = in_camera[facing]
        u, v, inside = frame.to_pixels(in_camera)
        depth_m = in_camera[inside, 2]
        free = depth_m < nearest_m[v, u] + AGREES_M
        yield link, u[free], v[free], depth_m[free]


@pytest.mark.thorough
def test_images_of_a_frame_share_a_due_ticks_stamp(frames, listeners):
    stamps = [set(listeners[topic].stamps_ns) for topic in TOPICS]
    # A slow listener misses images, the queues being short
    assert len(set.intersection(*stamps)) >= FRAMES
    for stamp in set.union(*stamps):
        assert stamp % DT_NS == 0
        time_ns = stamp - DT_NS  # the first tick, time 0, has the stamp dt
        assert time_ns * CAMERA_HZ // 10**9 > (time_ns - DT_NS) * CAMERA_HZ // 10**9
    assert {frame.messages[topic].header.frame_id for frame in frames for topic in TOPICS} == {"rpbi/camera"}


def test_links_of_the_moving_arm_appear_where_k_projects_tf(frames, arm_id):
    generator = np.random.default_rng(1)
    on_body: dict[str, list] = {link: [] for link in ARM}
    right_depth: dict[str, list] = {link: [] for link in ARM}
    for frame in frames:
        for link, u, v, depth_m in seen_points(frame, generator):
            on_body[link].extend(frame.body_ids[v, u] == arm_id)
            right_depth[link].extend(np.abs(frame.depth_m[v, u] - depth_m) < AGREES_M)
    for link in ARM:
        assert len(on_body[link]) > 200, f"{link} is hardly ever seen"
        assert np.mean(on_body[link]) > 0.95, f"{link} is somewhere else"
        assert np.mean(right_depth[link]) > 0.95, f"{link} is nearer or farther"


def test_segmentation_has_the_arm_nowhere_else(frames, arm_id):
    generator = np.random.default_rng(1)
    for frame in frames:
        near = np.isfinite(nearest_depth(frame, generator))
        for axis in (0, 1):
            near = near | np.roll(near, 1, axis) | np.roll(near, -1, axis)
        of_arm = frame.body_ids == arm_id
        assert of_arm.sum() > 1000
        assert (of_arm & ~near).sum() < 0.01 * of_arm.sum()
