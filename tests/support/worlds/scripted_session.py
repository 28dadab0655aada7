"""A contact-rich session by a seed: everything that can be done to a world, at random ticks.

As a program it replays a recording from its standard input, as JSON, and prints how that went.
"""

from __future__ import annotations

import json
import math
import random
import sys
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import pybullet
from mobile_base import mobile_base
from worlds import FLOOR, ball, box, iiwa, write_world

from custom_ros_tools.errors import InterfaceError
from rpbi.config.pybullet_args import IMPEDANCE_CONTROL
from rpbi.config.pybullet_models import ChangeDynamics
from rpbi.config.pybullet_world_models import SetGravity, SetPhysicsEngineParameter
from rpbi.config.world import AttachmentConfig
from rpbi.control.controllers.manager import ControllerSwitch, ControllerUpdate
from rpbi.control.external_wrenches import ExternalWrench
from rpbi.control.joint_command import JointCommand
from rpbi.control.motors import MotorGains
from rpbi.control.trajectories.request import TrajectoryPoint as Point
from rpbi.control.trajectories.request import TrajectoryRequest
from rpbi.geometry import Pose, Twist
from rpbi.replay.session import Checkpoint, Recording, Replay
from rpbi.world import World
from rpbi.world.actions import RecordedTrajectory, TimedGoal
from rpbi.world.loading import load_object
from rpbi.world.saved.command_log import RecordedCommand
from rpbi.world.saved.description import WorldDescription

JOINTS = [f"lbr_iiwa_joint_{number}" for number in range(1, 8)]
MODES = (pybullet.POSITION_CONTROL, pybullet.VELOCITY_CONTROL, pybullet.TORQUE_CONTROL, IMPEDANCE_CONTROL)


class Layout(NamedTuple):
    """Places of what is in the world of a session.

    Attributes:
        joints_deg: Joints of the arm at the start [deg].
        heap: Five places of boxes and balls [m].
        base: Place of the base that drives [m].
        more: More dynamic objects.
        main: Keys of the main file.
    """

    joints_deg: Mapping[str, float] = {"lbr_iiwa_joint_2": 40.0, "lbr_iiwa_joint_4": -60.0}
    heap: Sequence[tuple[float, ...]] = tuple((0.45, 0.02 * turn, 0.1 + 0.21 * turn) for turn in range(5))
    base: tuple[float, ...] = (-0.8, 0.0, 0.0)
    more: tuple[dict[str, Any], ...] = ()
    main: Mapping[str, Any] = {}


HEAP = Layout()


def build(folder: Path | None = None, layout: Layout = HEAP) -> World:
    """Builds boxes and balls about an arm with a force-torque sensor, and a base that drives into them."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = folder or Path(temporary)
        arm = iiwa(
            initial_joint_position=dict(layout.joints_deg),
            joint_state_publisher_hz=500,
            broadcast_link_states=True,
            enabled_joint_force_torque_sensors=[
                {"joint": "lbr_iiwa_joint_7", "noise_force_n": 0.5, "low_pass_hz": 20.0, "hz": 100}
            ],
            joint_trajectory_controller={},
            gravity_compensation=True,
            controllers={
                "springs": {"type": "joint_impedance", "active": False},
                "press": {"type": "force", "link": "lbr_iiwa_link_7", "active": False},
            },
            setJointMotorControlArray={"controlMode": "POSITION_CONTROL", "positionGains": [0.05]},
        )
        things = tuple(
            (box if turn % 2 else ball)(f"body{turn}", basePosition=list(place), broadcast_hz=100)
            for turn, place in enumerate(layout.heap)
        )
        follower = {**box("follower"), "object_tf": {"tf_id": "hand", "hz": 30}}
        del follower["baseMass"]
        path = write_world(
            folder,
            collision=(FLOOR, follower),
            dynamic=(*things, *layout.more),
            robots=(arm, mobile_base(folder, loadURDF={"basePosition": list(layout.base)})),
            **layout.main,
        )
        return World.from_file(path)


class Script:
    """Does something at random ticks; the same for the same seed.

    Args:
        seed: The seed.
    """

    def __init__(self, seed: int) -> None:
        self._random = random.Random(seed)
        self._stream_random = random.Random(seed)
        self._visitors: list[str] = []
        self._count = 0

    def act(self, world: World) -> None:
        """Does what the script has for a tick."""
        draw = self._random
        if draw.random() < 0.02:
            x, y, yaw = (draw.uniform(-1.0, 1.0) for _ in range(3))
            world.put("mobile/cmd_vel", Twist((x, y, 0.0), (0.0, 0.0, yaw)))
        if draw.random() < 0.01:
            place = (draw.uniform(0.3, 0.6), draw.uniform(-0.3, 0.3), draw.uniform(0.0, 0.3))
            world.put("follower/pose", Pose(place, (0.0, 0.0, draw.uniform(-1, 1), 1.0)))
        if draw.random() < 0.05:
            self._target(world)
        if world.clock.tick % 10 == self._stream_random.randrange(4):
            self._stream(world)
        if draw.random() < 0.01:
            self._something(world)
        if draw.random() < 0.012:
            self._physics(world)

    def _physics(self, world: World) -> None:
        draw = self._random
        kind = draw.randrange(4)
        if kind == 0:
            world.change_physics(SetGravity(gravX=draw.uniform(-1, 1), gravZ=draw.uniform(-10, -5)))
        elif kind == 1:
            world.change_physics(SetPhysicsEngineParameter(numSolverIterations=draw.randint(20, 80), contactERP=0.3))
        elif kind == 2:
            gains = [draw.uniform(0.02, 0.2) for _ in JOINTS]
            world.act("iiwa", "set_gains", MotorGains(JOINTS, gains, [10.0 * gain for gain in gains]))
        else:
            world.set_sensor_rate("iiwa", 1, draw.choice((0.0, 50.0, 1000.0)))

    def _target(self, world: World) -> None:
        draw = self._random
        joints = draw.sample(JOINTS, draw.randint(1, 7))
        values = [draw.uniform(-1.0, 1.0) for _ in joints]
        with suppress(ValueError):  # a motion or a controller may drive them
            world.put("iiwa/target", JointCommand(joints, values, values, [20.0 * value for value in values]))
        with suppress(ValueError):
            world.put("iiwa/springs/target", JointCommand(tuple(joints), tuple(values), (), (), world.clock.stamp_ns))

    def _stream(self, world: World) -> None:
        """Sends a target of a swing; some are lost, some come twice, and stamps jitter."""
        time_s = world.clock.tick * 0.002
        stamp_ns = world.clock.stamp_ns - self._stream_random.randrange(4_000_000)
        with suppress(ValueError):
            swing = [0.3 * math.sin(time_s)], [0.3 * math.cos(time_s)]
            world.put("iiwa/target", JointCommand(JOINTS[:1], *swing, stamp_ns=stamp_ns))

    def _something(self, world: World) -> None:
        draw = self._random
        robot: Any = world.bodies["iiwa"]
        kind = draw.randrange(13)
        if kind == 0:
            self._count += 1
            name = f"visitor{self._count}"
            start = {"linearVelocity": [-3.0, draw.uniform(-1, 1), 0.0]}
            config = ball(name, 0.06, basePosition=[1.2, 0.0, draw.uniform(0.1, 0.8)], resetBaseVelocity=start)
            world.add("dynamic", load_object("dynamic", config, "visitor.yaml"))
            self._visitors.append(name)
        elif kind == 1 and self._visitors:
            world.remove(self._visitors.pop(draw.randrange(len(self._visitors))))
        elif kind == 2 and "body1" in world.bodies and draw.random() < 0.1:
            world.remove("body1")
        elif kind == 3:
            mass = draw.uniform(0.5, 2.0)
            world.change_dynamics("body0", ChangeDynamics(mass=mass, lateralFriction=draw.uniform(0.1, 1.0)))
        elif kind == 4:
            world.act("iiwa", "switch_mode", draw.choice(MODES))
        elif kind == 5:
            place = (draw.uniform(0.3, 0.6), draw.uniform(-0.3, 0.3), draw.uniform(0.2, 1.0))
            with suppress(ValueError):  # it may be attached
                world.act(f"body{draw.choice((0, 2, 3, 4))}", "teleport", Pose(place))
        elif kind == 6:
            with suppress(ValueError):
                world.act("iiwa", "set_joint_state", JointCommand(JOINTS[:2], [draw.uniform(-0.5, 0.5), 0.5]))
        elif kind == 9:
            force = (draw.uniform(-20, 20), draw.uniform(-20, 20), draw.uniform(0, 20))
            link, name = draw.choice((("lbr_iiwa_link_7", "iiwa"), ("", "body0"), ("", "body2")))
            wrench = ExternalWrench(force, (0.1, 0.0, 0.2), link, (0.0, 0.05, 0.0), draw.random() < 0.5, draw.random())
            if draw.random() < 0.5:
                world.act(name, "push", wrench)
            else:
                world.put(f"{name}/external_wrench", wrench._replace(duration_s=None))
        elif kind == 10:
            self._attach(world)
        elif kind == 11:
            names = ["springs", "press"]
            draw.shuffle(names)
            world.act("iiwa", "switch_controllers", ControllerSwitch(names[: draw.randint(0, 1)], names[1:]))
        elif kind == 12:
            config = robot.controllers.config("springs")
            keys = {**config.model_dump(exclude_unset=True), "stiffness": draw.uniform(10.0, 1000.0)}
            world.act("iiwa", "set_controller_gains", ControllerUpdate("springs", type(config).parse(keys, "script")))
        elif robot.motors.mode == pybullet.TORQUE_CONTROL:
            world.pause("the simulation was stopped")
        elif kind == 7:
            goal = {robot.model[name].index: draw.uniform(-0.5, 0.5) for name in JOINTS[:3]}
            with suppress(ValueError):
                world.act("iiwa", "move", TimedGoal(goal, draw.uniform(0.1, 1.0)))
        else:
            points = tuple(Point(time_s, tuple(draw.uniform(-0.5, 0.5) for _ in JOINTS)) for time_s in (0.5, 1.0))
            stamp_ns = world.clock.stamp_ns + draw.choice((0, 100_000_000))
            request = TrajectoryRequest(tuple(JOINTS), points, stamp_ns)
            with suppress(InterfaceError):  # a controller may drive its joints
                world.act("iiwa", "follow", RecordedTrajectory.of(request, None, world.clock))

    def _attach(self, world: World) -> None:
        """Attaches a body to another, perhaps with a limit; or detaches it, unless it has gone or broken."""
        draw = self._random
        name = f"body{draw.choice((0, 2, 3, 4))}"
        if name in [each.name for each in world.attachments.configs]:
            world.detach(name)
            return
        parent = draw.choice(("iiwa/lbr_iiwa_link_7", "mobile", "follower", "floor"))
        keys = {"name": name, "parent": parent, "child": name, "kind": draw.choice(("fixed", "ball"))}
        if draw.random() < 0.5:
            keys["max_force"] = draw.uniform(20.0, 200.0)
        world.attach(AttachmentConfig.parse(keys, "script"))


def run(world: World, seed: int, ticks: int, every: int = 500, script: type[Script] = Script) -> list[Checkpoint]:
    """Runs a script and returns the states at every so many ticks."""
    acting = script(seed)
    states = []
    for _ in range(ticks):
        acting.act(world)
        world.step()
        if world.clock.tick % every == 0:
            states.append(Checkpoint(world.resets, world.clock.tick, world.commands.count, world.state_hash()))
    return states


def recorded(world: World) -> dict[int, RecordedCommand]:
    """Returns the commands of a world as a recording has them."""
    return dict(enumerate(world.commands.records()))


def record(seed: int, ticks: int, folder: Path | None = None) -> dict[str, Any]:
    """Runs a session in a world of its own and returns it as what JSON can hold."""
    world = build(folder)
    description = world.describe()
    checkpoints = run(world, seed, ticks)
    commands = recorded(world)
    world.close()
    return {"description": description, "commands": list(commands.items()), "checkpoints": checkpoints}


def read(session: dict[str, Any]) -> Recording:
    """Returns the recording of what `record` returned."""
    commands = {index: RecordedCommand(*command) for index, command in session["commands"]}
    checkpoints = {Checkpoint(*checkpoint) for checkpoint in session["checkpoints"]}
    return Recording(WorldDescription(session["description"]), {0: commands}, checkpoints)


if __name__ == "__main__":
    result = Replay(read(json.load(sys.stdin))).run()
    print("result:", json.dumps([result.agreed, result.difference, result.left_out]))
