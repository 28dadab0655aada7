"""Folders of episodes, written without a simulator: an arm with three joints, a force-torque sensor, a box, cameras."""

from __future__ import annotations

import math

import genpy
import numpy as np
import rosbag
from geometry_msgs.msg import TransformStamped, Vector3, WrenchStamped
from sensor_msgs.msg import Image, JointState
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

from ros_pybullet_interface.msg import Contacts, SimulationState
from rpbi_data.episodes.bags import measure_topics
from rpbi_data.episodes.folder import BAG, EpisodeFolder

JOINTS = ("shoulder", "elbow", "wrist")
STATES, TARGETS = "/rpbi/arm/joint_states", "/rpbi/arm/joint_states/target"
WRENCH, CONTACTS, CAMERA = "/rpbi/arm/wrist/ft_sensor", "/rpbi/box/contacts", "/rpbi/camera/colour/image"
HEIGHT, WIDTH = 48, 64


def write_episode(
    folder: EpisodeFolder,
    label: str = "success",
    *,
    seconds: float = 2.0,
    phase: float = 0.0,
    cameras: tuple[str, ...] = (CAMERA,),
    has_targets: bool = True,
    set_back_s: float = 0.0,
    of_record: bool = True,
    reset_s: float = math.inf,
) -> int:
    """Writes an episode and returns its number.

    Args:
        folder: The folder.
        label: Its label.
        seconds: Length in simulated time [s].
        phase: Phase of its motion [rad], so that episodes differ.
        cameras: Topics of images, at 25 Hz.
        has_targets: Whether there are targets.
        set_back_s: Time by which the clock is set back in the middle [s].
        of_record: Whether the clock of the recorder is set back, too.
        reset_s: Time at which the world is reset [s].
    """
    episode, part = folder.begin(seeds="7")
    with rosbag.Bag(str(part / BAG), "w", compression="lz4") as bag:
        bag.write("/rpbi/world_description", String("{}"), genpy.Time(1))
        for tick in range(round(seconds * 500)):
            time_s = (tick + 1) * 0.002
            stamp = recorded = genpy.Time.from_sec(1.0 + set_back_s + time_s)
            if time_s > seconds / 2:
                stamp = genpy.Time.from_sec(1.0 + time_s)
                recorded = stamp if of_record else recorded
            if tick % 5 == 0:
                _write_arm(bag, stamp, recorded, time_s, phase)
            if has_targets and tick % 10 == 0 and tick >= 100:
                target = JointState(name=list(JOINTS[:2]), position=_angles(time_s + 0.05, phase)[:2])
                target.header.stamp = stamp
                bag.write(TARGETS, target, recorded)
            if tick % 20 == 0:
                for number, topic in enumerate(cameras):
                    bag.write(topic, _image(stamp, time_s + phase, number), recorded)
            if tick % 50 == 0:
                state = SimulationState(
                    resets=int(time_s > reset_s),
                    tick=tick + 1,
                    commands=tick // 10,
                    state_hash=f"{hash((tick, phase)):x}",
                )
                state.header.stamp = stamp
                bag.write("/rpbi/state", state, recorded)
    episode.state, episode.label, episode.seconds = "complete", label, seconds
    episode.topics = measure_topics(part / BAG)
    folder.complete(part, episode)
    return episode.number


def _write_arm(bag: rosbag.Bag, stamp: genpy.Time, recorded: genpy.Time, time_s: float, phase: float) -> None:
    state = JointState(name=list(JOINTS), position=_angles(time_s, phase), velocity=[0.1, 0.2, math.cos(time_s)])
    state.effort = [math.sin(9.0 * time_s + joint) for joint in range(len(JOINTS))]
    wrench = WrenchStamped()
    wrench.wrench.force = Vector3(math.sin(5.0 * time_s), phase, -9.81)
    wrench.wrench.torque = Vector3(0.1 * time_s, 0.2, math.cos(7.0 * time_s))
    contacts = Contacts(force=Vector3(0.0, 0.0, max(0.0, math.sin(3.0 * time_s + phase))))
    for topic, message in ((STATES, state), (WRENCH, wrench), (CONTACTS, contacts)):
        message.header.stamp = stamp
        bag.write(topic, message, recorded)
    box = TransformStamped(child_frame_id="rpbi/box")
    box.header.frame_id, box.header.stamp = "rpbi/world", stamp
    box.transform.translation = Vector3(0.1 * time_s, 0.2, 0.05)
    angle = 4.0 * time_s + phase  # half of it passes 180 degrees, where the sign of the quaternion is free
    box.transform.rotation.z, box.transform.rotation.w = math.sin(angle / 2), math.cos(angle / 2)
    bag.write("/tf", TFMessage([box]), recorded)


def _angles(time_s: float, phase: float) -> list[float]:
    return [math.sin(2.0 * time_s + phase), 0.5 * math.cos(3.0 * time_s + phase), 0.2 * time_s + phase]


def _image(stamp: genpy.Time, time_s: float, number: int) -> Image:
    pixels = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    pixels[..., 0] = np.arange(WIDTH) * 3
    pixels[..., 2] = 60 * (number + 1)
    left = int(20 * time_s) % (WIDTH - 16)
    pixels[12:36, left : left + 16] = (220, 200, 60)
    image = Image(height=HEIGHT, width=WIDTH, encoding="rgb8", step=3 * WIDTH, data=pixels.tobytes())
    image.header.stamp = stamp
    return image
