"""`primitives_node.py`: learns movement primitives from demonstrations, plans motions and executes motions."""

from __future__ import annotations

import math
import re
import threading
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import rospy
import tf2_ros
from cob_srvs.srv import SetString, SetStringRequest, SetStringResponse
from geometry_msgs.msg import WrenchStamped
from std_msgs.msg import Float64MultiArray, Header
from std_srvs.srv import Trigger, TriggerResponse
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.plugins import trust_only
from custom_ros_tools.ros.lifecycle.parameters import private_config
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning, WallTimer
from custom_ros_tools.ros.services import ToggleService
from custom_ros_tools.ros.tf_interface import TfInterface
from custom_ros_tools.transforms import Array, finite_vector
from motion_primitives.coupling import ObstacleCoupling
from motion_primitives.demonstration import Demonstration
from motion_primitives.dynamics import Coupling, Execution, MotionState
from motion_primitives.errors import PlanError
from motion_primitives.files import load, save
from motion_primitives.msg import PrimitiveState
from motion_primitives.node_configs import PrimitivesNodeConfig
from motion_primitives.primitive import MAX_LONGER, MotionPlan, Primitive, ViaPoint
from motion_primitives.primitives import PRIMITIVES
from motion_primitives.srv import PlanPrimitive, PlanPrimitiveRequest, PlanPrimitiveResponse

from .signals import outputs_of, source_of

NODE = "primitives_node"
STATE_HZ = 10.0
"""Rate at which the state is published, in addition to each change of the mode [Hz]."""
MAX_STEP_S, MAX_TICK_S = 0.01, 0.1
"""Longest integration step, and longest time by which a motion advances in one tick, even if the tick is late [s]."""
MAX_SAMPLES = 1_000_000
"""Largest number of samples in a recording; later samples are ignored."""
NAME = re.compile(r"[A-Za-z0-9_]+")
IDLE, RECORDING, EXECUTING = "idle", "recording", "executing"

Answer = tuple[bool, str]
"""Response of a service: whether the request succeeded, and a message."""


class PrimitivesNode:
    """Offers services that record demonstrations, learn a primitive, plan motions and execute motions.

    See docs/learning.md.

    Raises:
        ConfigError: If the configuration is invalid.
    """

    def __init__(self) -> None:
        self._config = private_config(PrimitivesNodeConfig)
        self._space = self._config.source.space
        self._primitive = self._new_primitive()
        trust_only({"motion_primitives"}, "a node of primitives imports only what its ~config names when it starts")
        self._lock = threading.RLock()
        self._warn = ThrottledWarning()
        self._mode, self._message = IDLE, ""
        self._begun = self._ticked = rospy.Time()
        self._recording: list[tuple[float, Array]] = []
        self._demonstrations: list[Demonstration] = []
        self._execution: Execution | None = None
        self._force = self._config.coupling.force(self._space)
        self._obstacles = [(each.frame_id, each.obstacle()) for each in self._config.coupling.obstacles]
        self._tf = TfInterface()
        self._state = rospy.Publisher("primitive/state", PrimitiveState, queue_size=10, latch=True)
        self._outputs = outputs_of(self._config.output, self._space, self._tf)
        self._source = source_of(self._config.source, self._tf, self._record)
        rospy.Subscriber("primitive/goal", Float64MultiArray, self._on_goal, queue_size=1, tcp_nodelay=True)
        if self._force is not None:
            rospy.Subscriber("primitive/wrench", WrenchStamped, self._on_wrench, queue_size=1, tcp_nodelay=True)
        ToggleService("primitive/record", self._start_recording, self._stop_recording)
        for name, action in (("discard", self._discard), ("learn", self._learn), ("stop", self._stop)):
            rospy.Service(f"primitive/{name}", Trigger, lambda _, action=action: TriggerResponse(*self._tried(action)))
        for name, act in (("add_bag", self._add_bag), ("save", self._save), ("load", self._load)):
            rospy.Service(f"primitive/{name}", SetString, self._string_handler(act))
        rospy.Service("primitive/plan", PlanPrimitive, lambda request: self._serve(request, False))
        rospy.Service("primitive/execute", PlanPrimitive, lambda request: self._serve(request, True))
        WallTimer(self._config.hz, self._tick)
        WallTimer(STATE_HZ, self._publish_state)

    def _new_primitive(self) -> Primitive:
        options = {key: value for key, value in self._config.primitive.items() if key != "type"}
        return PRIMITIVES.make(self._config.primitive["type"], options, "~config.primitive")

    # --- Demonstrations

    def _start_recording(self) -> Answer:
        with self._lock:
            if self._mode != IDLE:
                return False, f"the node is {self._mode}"
            self._recording = []
            self._set_mode(RECORDING, "")
        return True, "recording"

    def _record(self, time_s: float, point: Array) -> None:
        with self._lock:
            if self._mode == RECORDING and len(self._recording) < MAX_SAMPLES:
                self._recording.append((time_s, point))

    def _stop_recording(self) -> Answer:
        with self._lock:
            if self._mode != RECORDING:
                return False, "nothing is being recorded"
            self._set_mode(IDLE, "")
            return self._tried(self._add_recording)

    def _add_recording(self) -> str:
        times = [time_s for time_s, _ in self._recording]
        points = [point for _, point in self._recording] or np.zeros((0, len(self._space.point_names)))
        return self._add(Demonstration.of_points(self._space, times, points))

    def _add(self, demonstration: Demonstration) -> str:
        self._demonstrations.append(demonstration)
        length = f"{demonstration.duration_s:.2f} s and {len(demonstration.times)} samples"
        return f"demonstration {len(self._demonstrations)} of {length} is stored"

    def _add_bag(self, path: str) -> str:
        if not path.endswith(".bag"):
            raise PlanError("data", "the path of a file NAME.bag", f"'{path[:60]}'")
        return self._add(self._source.of_bag(path))

    def _discard(self) -> str:
        if not self._demonstrations:
            raise PlanError("demonstrations", "at least one", "none")
        self._demonstrations.pop()
        return f"{len(self._demonstrations)} demonstrations are left"

    def _learn(self) -> str:
        primitive = self._new_primitive().learn(self._demonstrations)
        self._primitive = primitive
        return f"learned from {len(self._demonstrations)} demonstrations"

    # --- Files

    def _path(self, name: str) -> Path:
        if not NAME.fullmatch(name):
            raise PlanError("data", "a name of letters, digits and '_'", f"'{name[:60]}'")
        return Path(self._config.folder).expanduser() / f"{name}.yaml"

    def _save(self, name: str) -> str:
        path = self._path(name)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            save(self._primitive, path)
        except OSError as error:
            raise PlanError("folder", "one that can be written", f"{path}: {error.strerror}") from None
        return f"saved as {path}"

    def _load(self, name: str) -> str:
        path = self._path(name)
        primitive = load(path)
        if primitive.space != self._space:
            names = ", ".join(primitive.space.point_names)
            raise PlanError("data", f"a primitive of {', '.join(self._space.point_names)}", f"{names} in {path}")
        self._primitive = primitive
        return f"loaded {path}"

    # --- Plans and their execution

    def _serve(self, request: PlanPrimitiveRequest, executes: bool) -> PlanPrimitiveResponse:
        try:
            with self._lock:
                primitive = self._primitive
                if executes and self._mode != IDLE:
                    raise PlanError("execution", "an idle node", self._mode)
            wanted = self._arguments(request)
            trajectory = primitive.plan(*wanted, dt_s=1.0 / self._config.hz)
            self._check_bounds(trajectory)
            if executes:
                self._execute(primitive.begin(*wanted))
        except (InterfaceError, ValueError) as error:
            return PlanPrimitiveResponse(False, str(error), JointTrajectory())
        message = f"{'executing' if executes else 'planned'} a motion of {trajectory.duration_s:.2f} s"
        return PlanPrimitiveResponse(True, message, _trajectory_message(trajectory))

    def _arguments(
        self, request: PlanPrimitiveRequest
    ) -> tuple[Array | Sequence[float] | None, Sequence[float] | None, float | None, list[ViaPoint]]:
        start = request.start or self._source.present()
        if not 0.0 <= request.duration < math.inf:
            raise PlanError("duration", "a finite time, or 0 for that of the demonstrations", f"{request.duration}")
        via_points = [ViaPoint(each.time, each.position) for each in request.via_points]
        return start, request.goal or None, request.duration or None, via_points

    def _check_bounds(self, trajectory: MotionPlan) -> None:
        for index, name in enumerate(trajectory.space.names):
            lower, upper = self._config.bounds.get(name, (-math.inf, math.inf))
            column = trajectory.positions[:, index]
            for value in (column[-1], column.min(), column.max()):  # the last point first: the goal may be wrong
                if not lower <= value <= upper:
                    subject = f"goal: {name}" if value == column[-1] else name
                    raise PlanError(subject, f"positions from {lower:g} to {upper:g}", f"{value:.4g}")

    def _execute(self, execution: Execution) -> None:
        with self._lock:
            if self._mode != IDLE:
                raise PlanError("execution", "an idle node", self._mode)
            self._execution = execution
            self._set_mode(EXECUTING, "")

    def _stop(self) -> str:
        if self._mode != EXECUTING:
            raise PlanError("execution", "a motion to stop", "none")
        self._end("stopped")
        return "stopped"

    def _on_goal(self, message: Float64MultiArray) -> None:
        with self._lock:
            try:
                if self._execution is None:
                    raise PlanError("goal", "a motion that is executed", "none")
                self._execution.set_goal(message.data)
            except InterfaceError as error:
                self._warn("primitive/goal", f"message refused: {error}")

    def _on_wrench(self, message: WrenchStamped) -> None:
        force, torque = message.wrench.force, message.wrench.torque
        numbers = (force.x, force.y, force.z, torque.x, torque.y, torque.z)
        try:
            wrench = finite_vector(numbers, 6, "wrench")
        except ValueError as error:
            self._warn("primitive/wrench", f"message refused: {error}")
            return
        assert self._force is not None
        self._force.force = wrench[: self._space.dof]

    def _couplings(self) -> list[Coupling]:
        found: list[Coupling] = [] if self._force is None else [self._force]
        parent = self._config.source.tf.parent if self._config.source.tf is not None else ""
        for frame_id, obstacle in self._obstacles:
            center = self._center(parent, frame_id, obstacle)
            if center is not None:
                obstacle.center = center
                found.append(obstacle)
        return found

    def _center(self, parent: str, frame_id: str, obstacle: ObstacleCoupling) -> Array | None:
        try:
            position, _ = self._tf.get_tf(parent, frame_id)
        except (ValueError, tf2_ros.TransformException):
            position = None
        if position is None:
            self._warn(f"obstacle {frame_id}", f"there is no TF from '{parent}' to it: it is not avoided")
        return position

    def _tick(self) -> None:
        if self._mode == RECORDING:
            self._source.poll()
            return
        with self._lock:
            execution = self._execution
            if execution is None:
                return
            now = rospy.Time.now()
            passed_s = min((now - self._ticked).to_sec(), MAX_TICK_S)
            self._ticked = now
            if passed_s <= 0.0:  # simulated time is paused, or has been reset
                return
            count, couplings = math.ceil(passed_s / MAX_STEP_S), self._couplings()
            for _ in range(count):
                execution.step(passed_s / count, couplings)
            self._send(execution.state)
            if execution.is_at_goal():
                self._end("goal reached" if execution.goal is not None else "time is over")
            elif execution.state.time_s > MAX_LONGER * execution.end_s:
                distance, angle_rad = execution.miss()
                self._end(f"goal missed by {distance:.3g} m or rad and {angle_rad:.3g} rad: it is out of reach")

    def _send(self, state: MotionState) -> None:
        for output in self._outputs:
            output(state)

    def _end(self, message: str) -> None:
        """Ends the execution. Publishes the last point again, with velocity 0."""
        assert self._execution is not None
        last = self._execution.state
        self._execution = None
        self._send(MotionState(last.time_s, last.point, np.zeros_like(last.velocity)))
        self._set_mode(IDLE, message)

    # --- State

    def _set_mode(self, mode: str, message: str) -> None:
        self._mode, self._message, self._begun = mode, message, rospy.Time.now()
        self._ticked = self._begun
        self._publish_state()

    def _publish_state(self) -> None:
        with self._lock:
            state = self._execution.state if self._execution is not None else None
            elapsed_s = 0.0 if self._mode == IDLE else (rospy.Time.now() - self._begun).to_sec()
            self._state.publish(
                PrimitiveState(
                    header=Header(stamp=rospy.Time.now()),
                    mode=self._mode,
                    demonstrations=len(self._demonstrations),
                    is_learned=self._primitive.is_learned,
                    elapsed=elapsed_s,
                    position=[] if state is None else state.point.tolist(),
                    velocity=[] if state is None else state.velocity.tolist(),
                    message=self._message,
                )
            )

    def _tried(self, action: Callable[[], str]) -> Answer:
        """Runs the action of a service, publishes the state, and returns the response.

        Args:
            action: Function that returns the message of a successful response, or raises an error.
        """
        with self._lock:
            try:
                success, self._message = True, action()
            except (InterfaceError, ValueError) as error:
                success, self._message = False, str(error)
            message = self._message
        self._publish_state()
        return success, message

    def _string_handler(self, act: Callable[[str], str]) -> Callable[[SetStringRequest], SetStringResponse]:
        return lambda request: SetStringResponse(*self._tried(lambda: act(request.data)))


def _trajectory_message(trajectory: MotionPlan) -> JointTrajectory:
    rows = zip(trajectory.times.tolist(), trajectory.points.tolist(), trajectory.velocities.tolist())
    points = [
        JointTrajectoryPoint(positions=point, velocities=velocity, time_from_start=rospy.Duration.from_sec(time_s))
        for time_s, point, velocity in rows
    ]
    return JointTrajectory(joint_names=list(trajectory.space.point_names), points=points)


def main() -> None:
    """Runs the node."""
    run_node(NODE, PrimitivesNode, loggers=["rpbi_data"])
