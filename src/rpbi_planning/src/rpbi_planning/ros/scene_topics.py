"""Keeps a planning scene equal to a running world: its bodies from the simulator, their poses from TF."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from functools import partial

import numpy as np
import pybullet
import rospy
import tf2_ros
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.joint_states import values_in
from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning
from custom_ros_tools.ros.tf_interface import TfListener
from robot_model.geometry import Pose
from ros_pybullet_interface.msg import WorldCommand, WorldCommands
from rpbi.bodies import Body
from rpbi.bodies.dynamic import DynamicObject
from rpbi.bodies.robots.robot import Robot
from rpbi.bodies.visual_shapes import followed_frame, link_frame
from rpbi.ros.headers import named_frame, prefixed, use_own_frames, use_prefix, world_frame
from rpbi.world import World
from rpbi.world.saved.command_log import RecordedCommand, apply_command
from rpbi.world.saved.description import WorldDescription
from rpbi_planning.node_configs import MotionPlannerConfig
from rpbi_planning.scene import PlanningScene
from rpbi_planning.scene_robot import SceneRobot

FIRST_S, POLL_S = 10.0, 0.05
"""Longest time to wait for the first messages, and time between two looks [s]."""
ALLOWED_S = 0.1
"""Largest age of a state relative to a request: time between messages, and difference of two computers' clocks [s]."""
CONTENTS = ("add", "remove")
"""Commands that change the bodies of a world."""


class SceneTopics:
    """Follows a world by its topics, and returns planning scenes with its present state.

    The bodies are those of a copy of the world, which is built from the world's description and is never stepped.
    Bodies that are added to the simulator or removed from it later are added to the copy or removed from it.

    Args:
        config: Names of files, bodies and frames.

    Raises:
        ConfigError: If `config.world` is not a valid world.
    """

    def __init__(self, config: MotionPlannerConfig) -> None:
        self._config, self._warn = config, ThrottledWarning()
        self.lock = threading.RLock()
        """Held while the copy of the world, or its robots, are used."""
        self._world: World | None = None
        self._description, self._resets, self._done = "", 0, 0
        self._fault = "no world yet: is the simulator running?"
        self._scene: PlanningScene | None = None
        self._joints: dict[str, tuple[rospy.Time, Mapping[str, float]]] = {}
        self._subscribers: dict[str, rospy.Subscriber] = {}
        self._buffer = tf2_ros.Buffer(debug=False)
        self._listener = TfListener(self._buffer)
        if config.world is not None:
            self._use(World.from_file(config.world, connection_mode=pybullet.DIRECT))
        else:
            rospy.Subscriber("rpbi/world_description", String, self._on_description, queue_size=1)
        self._commands: rospy.Subscriber | None = None

    def robot(self, name: str = "") -> Robot:
        """Returns a robot of the copy of the world.

        Args:
            name: Name of the robot; empty for that of the configuration, or else the only robot that follows
                trajectories.

        Raises:
            InterfaceError: If there is no world, or no such robot.
        """
        name = name or self._config.robot or ""
        with self.lock:
            if self._world is None:
                raise InterfaceError(self._fault)
            robots = {each.name: each for each in self._world.bodies.values() if isinstance(each, Robot)}
            following = [each for each in robots if robots[each].follower is not None]
        if not name and len(following) == 1:
            (name,) = following
        if name not in robots:
            known = ", ".join(robots) or "none"
            expected = f"a robot of the world, got '{name}'" if name else "the name of a robot"
            raise InterfaceError(f"robot: expected {expected}; there is {known}")
        return robots[name]

    def wait(self) -> None:
        """Waits until the world and joint states of all its robots have come, at most for `FIRST_S`."""
        end_s = time.monotonic() + FIRST_S
        while time.monotonic() < end_s and not rospy.is_shutdown():
            with self.lock:
                if self._scene is not None and self._subscribers.keys() <= self._joints.keys():
                    return
            time.sleep(POLL_S)

    def wait_for(self, stamp: rospy.Time) -> None:
        """Waits until the joint states of all robots are as new as a request, at most for `FIRST_S`.

        On a busy computer, messages of the simulator may come later than the request.

        Args:
            stamp: Time at which the request was sent. A time that is further ahead than `FIRST_S` is of another clock,
                for example of a client without simulated time, and is ignored.

        Raises:
            InterfaceError: If they do not come.
        """
        end_s = time.monotonic() + FIRST_S
        while stamp and not rospy.is_shutdown():
            with self.lock:
                ages = {
                    name: (stamp - self._joints[name][0]).to_sec() for name in self._subscribers.keys() & self._joints
                }
            oldest = max(ages, key=lambda name: ages[name], default="")
            if not ages or not ALLOWED_S < ages[oldest] <= FIRST_S:
                return
            if time.monotonic() > end_s:
                raise InterfaceError(
                    f"robot '{oldest}': expected joint states as new as the request, got states that are "
                    f"{ages[oldest]:.1f} s older; synchronise the clocks, or end other programs"
                )
            time.sleep(POLL_S)

    def present(self) -> PlanningScene:
        """Returns the scene with the present poses and joint positions. Held bodies stay at the link that holds them.

        Each call returns the same scene, unless bodies have been added or removed.

        Raises:
            InterfaceError: If there is no world, or a pose or joint positions are missing or too old.
        """
        with self.lock:
            if self._world is None or self._scene is None:
                raise InterfaceError(self._fault)
            for body in self._world.bodies.values():
                if body.name not in self._scene.names:
                    continue
                frame = self._frame_of(body)
                if frame and body.name not in self._scene.held:
                    self._scene.place(body.name, self.pose(frame, f"body '{body.name}'"))
                if isinstance(body, Robot):
                    _, positions = self.state(body)
                    driven = self._scene.robots[body.name].model.joint_names
                    self._scene.set_positions(body.name, {name: positions[name] for name in driven})
            return self._scene

    def state(self, robot: Robot) -> tuple[Pose, dict[str, float]]:
        """Returns the pose of a robot's root link in the world, and the positions of its joints [rad or m].

        Raises:
            InterfaceError: If they are missing or too old.
        """
        with self.lock:
            frame, names = self._frame_of(robot), {joint.index: joint.name for joint in robot.model.moving}
            base = self.pose(frame, f"robot '{robot.name}'") if frame else Pose(*robot.base_pose())
            start = {names[index]: position for index, position in robot.joint_positions().items()}
            return base, {**start, **self._positions(robot)}

    @property
    def dt_s(self) -> float:
        """Duration of a tick of the world [s]."""
        assert self._world is not None
        return self._world.config.timeStep

    def dynamic_objects(self) -> dict[str, Pose]:
        """Returns the present poses of the dynamic objects that TF contains, indexed by name.

        Raises:
            InterfaceError: If a pose is missing or too old.
        """
        with self.lock:
            bodies = self._world.bodies.values() if self._world is not None else ()
            frames = {each.name: self._frame_of(each) for each in bodies if isinstance(each, DynamicObject)}
            return {name: self.pose(frame, f"body '{name}'") for name, frame in frames.items() if frame}

    def pose(self, frame: str, subject: str) -> Pose:
        """Returns the newest pose of a TF frame in the world.

        Args:
            frame: Name of the frame.
            subject: Meaning of the frame, for errors.

        Raises:
            InterfaceError: If TF has no such pose, or if it is older than `timeout_s`.
        """
        try:
            found = self._buffer.lookup_transform(world_frame(), frame, rospy.Time(0))
        except tf2_ros.TransformException as error:
            raise InterfaceError(f"{subject}: expected the TF frame '{frame}': {error}") from None
        self._check_age(found.header.stamp, f"{subject}: TF frame '{frame}'")
        t, r = found.transform.translation, found.transform.rotation
        return Pose((t.x, t.y, t.z), (r.x, r.y, r.z, r.w))

    def _check_age(self, stamp: rospy.Time, subject: str) -> None:
        age_s = (rospy.Time.now() - stamp).to_sec()
        if stamp and age_s > self._config.timeout_s:
            raise InterfaceError(
                f"{subject}: expected an age of at most {self._config.timeout_s:g} s, got {age_s:.1f} s"
            )

    def _positions(self, robot: Robot) -> Mapping[str, float]:
        if robot.name not in self._joints:
            if robot.name in self._subscribers:
                topic = self._subscribers[robot.name].resolved_name
                raise InterfaceError(f"robot '{robot.name}': expected joint states on {topic}, none have come")
            return {}
        stamp, positions = self._joints[robot.name]
        self._check_age(stamp, f"joint states of '{robot.name}'")
        return positions

    def _frame_of(self, body: Body) -> str:
        """Returns the TF frame of a body's root link; empty for a body that stays at its pose."""
        if body.name in self._config.tracked:
            return self._config.tracked[body.name]
        assert self._world is not None
        own = link_frame(body, self._world.sensors_of(body.name), body.root_link)
        followed = followed_frame(body)
        return prefixed(own) if own else named_frame(followed) if followed else ""

    # --- The copy of the world

    def _on_description(self, message: String) -> None:
        with self.lock:
            self._description, self._done, self._resets = message.data, 0, 0
            self._rebuild()
            if self._commands is None:  # a new subscriber also gets the earlier commands
                self._commands = rospy.Subscriber("rpbi/commands", WorldCommands, self._on_commands, queue_size=1000)

    def _rebuild(self) -> None:
        try:
            self._use(World.from_description(WorldDescription(self._description)))
        except (InterfaceError, ValueError) as error:
            self._fault = f"rpbi/world_description: the world cannot be built here: {error}"
            rospy.logerr("%s", self._fault)

    def _use(self, world: World) -> None:
        if self._world is not None:
            self._world.close()
        self._world, self._scene = world, None
        use_prefix(world.config.tf_prefix)
        use_own_frames(world.frames())
        self._update()

    def _update(self) -> None:
        """Makes a new scene from the copy of the world, and subscribes to the joint states of its robots."""
        assert self._world is not None
        scene = PlanningScene.of_world(self._world, padding_m=self._config.padding_m)
        for name in {*self._config.left_out} & {*scene.names}:
            scene.remove(name)
        self._scene = scene
        robots = [each for each in self._world.bodies.values() if isinstance(each, Robot)]
        for name in self._subscribers.keys() - {each.name for each in robots}:
            self._subscribers.pop(name).unregister()
            self._joints.pop(name, None)
        for robot in robots:
            self._set_limits(scene.robots[robot.name])
            topic = self._topic_of(robot)
            if topic and robot.name not in self._subscribers:
                on_joints = partial(self._on_joints, robot.name)
                self._subscribers[robot.name] = rospy.Subscriber(topic, JointState, on_joints, queue_size=1)

    def _set_limits(self, robot: SceneRobot) -> None:
        limits, config = robot.limits, self._config
        robot.limits = limits._replace(
            velocity=config.speed * limits.velocity,
            acceleration=np.full_like(limits.acceleration, config.acceleration),
            jerk=np.full_like(limits.jerk, config.jerk),
        )
        for name, posture in config.postures.items():
            if set(posture) <= set(robot.model.joint_names):
                robot.postures[name] = robot.vector(posture, f"~config.postures.{name}")

    def _topic_of(self, robot: Robot) -> str:
        if self._config.joint_states and robot.name == self.robot().name:
            return self._config.joint_states
        return f"rpbi/{robot.name}/joint_states" if robot.config.joint_state_publisher_hz else ""

    def _on_joints(self, robot: str, message: JointState) -> None:
        try:
            values = values_in(message)
        except (InterfaceError, ValueError) as error:
            self._warn(robot, f"joint states of '{robot}' refused: {error}")
            return
        with self.lock:
            known = self._joints.get(robot, (None, {}))[1]
            self._joints[robot] = message.header.stamp, {**known, **dict(zip(values.names, values.position))}

    def _on_commands(self, message: WorldCommands) -> None:
        with self.lock:
            if self._world is None:
                return
            if message.resets != self._resets:
                self._resets, self._done = message.resets, 0
                self._rebuild()
            new = message.commands[max(self._done - message.first, 0) :]
            self._done = max(self._done, message.first + len(message.commands))
            changes = [command for command in new if command.what in CONTENTS]
            for command in changes:
                self._apply(command)
            if changes:
                self._update()

    def _apply(self, command: WorldCommand) -> None:
        assert self._world is not None
        try:
            apply_command(self._world, RecordedCommand(0, command.name, command.what, command.data))
        except (InterfaceError, ValueError) as error:
            self._warn(command.name, f"'{command.name}' is not in the planner's scene: {error}")
