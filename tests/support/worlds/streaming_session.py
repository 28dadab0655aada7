"""A random session of arms under streams of targets, with controllers, attachments, noise, filters and cameras.

Some steps have sub-steps; joints turn about three axes, or are coupled; bodies come, go and come again.
"""

from __future__ import annotations

import math
import random
from contextlib import suppress
from pathlib import Path
from typing import Any

from gripper import gripper
from worlds import FLOOR, ball, box, iiwa, write_world

from custom_ros_tools.errors import InterfaceError
from rpbi.config.pybullet_models import ChangeDynamics
from rpbi.config.pybullet_world_models import SetGravity
from rpbi.config.world import AttachmentConfig
from rpbi.control.controllers.cartesian_impedance import PoseTarget
from rpbi.control.controllers.manager import ControllerSwitch
from rpbi.control.external_wrenches import ExternalWrench
from rpbi.control.joint_command import JointCommand
from rpbi.geometry import Pose
from rpbi.world import World
from rpbi.world.actions import TimedGoal
from rpbi.world.loading import load_object

JOINTS = tuple(f"lbr_iiwa_joint_{number}" for number in range(1, 8))
LOOKS_DOWN = (1.0, 0.0, 0.0, 0.0)
THINGS = ("box0", "ball1", "box2", "ball3")
EYE = {
    "name": "eye",
    "hz": 30,
    "intrinsics": {"width": 160, "height": 120, "fov": 60.0, "range": [0.1, 10.0]},
    "object_tf": {"tf_id": "rpbi/eye"},
}
_PENDULUM = """<robot name="pendulum">
<link name="base"/>
<link name="rod"><inertial><origin xyz="0 0 -0.3"/><mass value="0.5"/>
<inertia ixx="0.01" iyy="0.012" izz="0.003" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><origin xyz="0 0 -0.3"/><geometry><box size="0.05 0.08 0.4"/></geometry></collision></link>
<joint name="ball" type="spherical"><parent link="base"/><child link="rod"/></joint></robot>"""


def build(folder: Path, seed: int) -> World:
    """Builds the world of a seed."""
    draw = random.Random(seed)
    (folder / "pendulum.urdf").write_text(_PENDULUM)
    sensor = {"joint": JOINTS[-1], "noise_force_n": 0.5, "low_pass_hz": 20.0, "hz": 200}
    starts = [{name: draw.uniform(-60.0, 60.0) for name in JOINTS} for _ in range(2)]
    arms = (
        iiwa(
            "springy",
            initial_joint_position=starts[0],
            enabled_joint_force_torque_sensors=[sensor],
            controllers={
                "springs": {"type": "joint_impedance"},
                "hold": {"type": "cartesian_impedance", "link": "lbr_iiwa_link_7", "active": False},
            },
        ),
        iiwa(
            "stiff",
            loadURDF={"fileName": "kuka_iiwa/model.urdf", "useFixedBase": True, "basePosition": [1.0, 0.0, 0.0]},
            initial_joint_position=starts[1],
            enabled_joint_force_torque_sensors=[sensor],
            target_interpolation=draw.choice(("smooth", "linear")),
        ),
        gripper(folder),
    )
    tracked = {"tracked_tf": {"tf_id": "seen", "hz": 30, "timeout_s": 0.2}}
    path = write_world(
        folder,
        collision=(FLOOR,),
        dynamic=(*(_thing(draw, name) for name in THINGS), box("seen", basePosition=[0.5, -0.6, 0.1], **tracked)),
        robots=arms,
        urdfs=({"name": "pendulum", "loadURDF": _hung(draw)},),
        rgbd_sensor=EYE,
        timeStep=draw.choice((0.001, 0.002)),
        setPhysicsEngineParameter={"numSubSteps": draw.choice((0, 2, 3))},
    )
    return World.from_file(path)


def _hung(draw: random.Random) -> dict[str, Any]:
    place = [0.5, 0.7, draw.uniform(0.6, 0.9)]
    return {"fileName": "pendulum.urdf", "basePosition": place, "useFixedBase": True}


def _thing(draw: random.Random, name: str) -> dict[str, Any]:
    """Returns a body that sensors see; the last one is in maximal coordinates."""
    place = [draw.uniform(0.3, 0.7), draw.uniform(-0.3, 0.3), 0.1 + 0.21 * THINGS.index(name)]
    made = (box if name.startswith("box") else ball)(name, basePosition=place, broadcast_hz=100)
    if name == THINGS[-1]:
        return {**made, "useMaximalCoordinates": True}
    seen = {"noise_m": [0.001] * 3, "latency_s": 0.03, "occlusion": {"share": 0.2, "length_s": 0.05}, "hz": 100}
    tags = {"type": "april_tags", "name": "tags", "camera": "eye", "tags": [{"id": 1, "size": 0.1}], "hz": 30}
    sensors = [{"type": "vicon", "name": "vicon", **seen}, {**tags, "topic": f"tags_{name}", "latency_s": 0.05}]
    return {**made, "contacts": {"hz": 50, "average": True}, "sensors": sensors}


class Script:
    """Sends streams, and does something else at random ticks; the same for the same seed.

    Args:
        seed: The seed.
        first_visitor: Number of the first body that comes.
    """

    def __init__(self, seed: int, first_visitor: int = 0) -> None:
        self._random = random.Random(seed)
        self._count = first_visitor
        self._rate = self._random.choice((5, 8, 13))

    def act(self, world: World) -> None:
        """Does what the script has for a tick."""
        draw, tick = self._random, world.clock.tick
        if tick % self._rate == draw.randrange(2):
            self._stream(world)
        if draw.random() < 0.03:
            self._poses(world)
        if draw.random() < 0.02:
            with suppress(ValueError, InterfaceError):  # it may be attached, driven by something else, or gone
                self._something(world)

    def _stream(self, world: World) -> None:
        draw, time_s = self._random, world.clock.time_s
        stamp_ns = world.clock.stamp_ns - draw.randrange(3_000_000)
        swing = tuple(0.4 * math.sin(2.0 * time_s + turn) for turn in range(3))
        with suppress(ValueError):
            world.put("stiff/target", JointCommand(JOINTS[:3], swing, stamp_ns=stamp_ns))
        with suppress(ValueError):
            world.put("springy/springs/target", JointCommand(JOINTS[:3], swing, (), (), stamp_ns))
        with suppress(ValueError):
            world.put("gripper/target", {"left": 0.03 + 0.02 * math.sin(time_s)})

    def _poses(self, world: World) -> None:
        draw = self._random
        turn = (0.0, 0.0, draw.uniform(-0.5, 0.5), 1.0)
        world.put("eye/pose", Pose((draw.uniform(0.3, 0.7), 0.0, 2.0), LOOKS_DOWN))
        world.put("seen/pose", Pose((0.5 + draw.uniform(-0.02, 0.02), -0.6, draw.uniform(0.1, 0.14)), turn))
        place = draw.uniform(0.3, 0.6), draw.uniform(-0.3, 0.3), draw.uniform(0.3, 0.8)
        with suppress(ValueError):
            world.put("springy/hold/target", PoseTarget(Pose(place), world.clock.stamp_ns))

    def _something(self, world: World) -> None:
        draw, kind = self._random, self._random.randrange(11)
        name = draw.choice(THINGS)
        if kind == 0:
            self._count += 1
            visitor = ball(f"visitor{self._count}", 0.06, basePosition=[0.5, draw.uniform(-0.4, 0.4), 1.2])
            world.add("dynamic", load_object("dynamic", visitor, "visitor.yaml"))
        elif kind == 1 and (visitors := [each for each in world.bodies if each.startswith("visitor")]):
            world.remove(draw.choice(visitors))
        elif kind == 2:
            again = _thing(draw, name)
            if name in world.bodies:
                world.remove(name)
            else:
                world.add("dynamic", load_object("dynamic", again, "again.yaml"))
        elif kind in (3, 4):
            self._attach(world, name)
        elif kind == 5:
            change = ChangeDynamics(mass=draw.uniform(0.5, 2.0), lateralFriction=draw.uniform(0.2, 1.0))
            world.change_dynamics(name, change)
        elif kind == 6:
            world.change_physics(SetGravity(gravX=draw.uniform(-0.5, 0.5), gravZ=draw.uniform(-10.0, -8.0)))
        elif kind == 7:
            names = draw.sample(("springs", "hold"), 2)
            world.act("springy", "switch_controllers", ControllerSwitch(names[:1], names[1:]))
        elif kind == 8:
            force = tuple(draw.uniform(-10.0, 10.0) for _ in range(3))
            world.act(name, "push", ExternalWrench((force[0], force[1], force[2]), duration_s=draw.uniform(0.02, 0.3)))
        elif kind == 9:
            world.act("stiff", "move", TimedGoal({JOINTS[4]: draw.uniform(-0.5, 0.5)}, draw.uniform(0.1, 0.6)))
        else:
            world.set_sensor_rate("springy", 0, draw.choice((50.0, 200.0, 1000.0)))

    def _attach(self, world: World, name: str) -> None:
        if name in [each.name for each in world.attachments.configs]:
            world.detach(name)
            return
        parent = self._random.choice(("springy/lbr_iiwa_link_7", "stiff/lbr_iiwa_link_6", "floor"))
        keys = {"name": name, "parent": parent, "child": name, "kind": self._random.choice(("fixed", "ball"))}
        if self._random.random() < 0.3:
            keys["max_force"] = self._random.uniform(20.0, 200.0)
        world.attach(AttachmentConfig.parse(keys, "script"))


def run(world: World, seed: int, ticks: int) -> list[Any]:
    """Runs the script of a seed, and returns all samples."""
    script, samples = Script(seed), []
    for _ in range(ticks):
        script.act(world)
        samples += world.step()
    return samples
