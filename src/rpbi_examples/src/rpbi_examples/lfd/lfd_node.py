"""`run_lfd.py`: learns from a person's demonstration to push a box, and plans and executes pushes from random starts.
Also draws the results.
"""

from __future__ import annotations

import math
import queue
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import rospy
from geometry_msgs.msg import PoseStamped
from matplotlib.figure import Figure
from nav_msgs.msg import Path as PathMessage
from sensor_msgs.msg import Joy
from std_msgs.msg import String
from std_srvs.srv import Trigger, TriggerResponse

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.lifecycle.end_launch import end_launch
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.tf_interface import TfInterface
from custom_ros_tools.ros.transform_messages import as_pose, transform_message
from custom_ros_tools.transforms import Array
from rpbi_examples.motions import PlanarPose
from rpbi_examples.ros.joint_targets import wait_until_ready

from .arm_topics import ORIGIN, TARGET, TIP, Arm, planar
from .box_services import GOAL, PushedBox
from .dmp_services import ServerMotion
from .person import HALF_SIDE_M, TIP_RADIUS_M
from .recording_services import begin_episode, discard_episode, finish_episode
from .report import SIZES, Run, draw_paths, draw_pipeline, write_picture, write_summary
from .skill import Learn, PushSkill, learn_dmp

LEARN: dict[str, Learn] = {"own": learn_dmp, "server": ServerMotion}
"""Functions that learn a motion, indexed by the launch file's argument `dmp`."""
DEMONSTRATING = "demonstrating"
AFTER_FAILURE = {DEMONSTRATING: "home", "demonstrated": "missed", "learned": "missed", "executed": "missed"}
"""State after a failed step, indexed by the state before the step. In other states, a failure keeps the state."""
ORIGIN_PLACE = np.zeros(2)
MAX_OFFSET_M = 0.1
"""Largest distance of a random start from the origin, along x and along y [m]."""
NEAR_ORIGIN_M = 0.03
"""Largest distance of the tip from the origin at the start of a demonstration [m]."""
QUIET_S = 15.0
"""Wall time after the start of a demonstration at which a warning is logged if the tip is still at the origin [s]."""
POLL_S = 0.05


class LfdNode:
    """Executes the steps that keys or services request, one by one. Publishes the node's state on `lfd/state`."""

    def __init__(self) -> None:
        self._out = Path(rospy.get_param("~out", "lfd"))
        self._rounds, self._seed = rospy.get_param("~rounds", 0), rospy.get_param("~seed", 0)
        self._plots = rospy.get_param("~plot", False)
        dmp = rospy.get_param("~dmp", "own")
        if dmp not in LEARN:
            raise InterfaceError(f"~dmp: expected {' or '.join(LEARN)}, got {dmp}")
        self._learn = LEARN[dmp]
        self._random = np.random.default_rng(self._seed)
        self._shown: list[Run] = []
        self._executed: list[Run] = []
        self._demonstration: Run | None = None
        self._skill: PushSkill | None = None
        self._quiet_s = math.inf
        self._wanted: queue.Queue[str] = queue.Queue()
        self._actions = {"home": self._home, "demonstrate": self._demonstrate, "learn": self._learn_or_execute}
        self._name = "start"
        self._state = rospy.Publisher("lfd/state", String, queue_size=1, latch=True)
        self._paths = {
            name: rospy.Publisher(f"lfd/{name}", PathMessage, queue_size=1, latch=True)
            for name in ("demonstration", "plan")
        }
        self._tf = TfInterface()
        self._box = PushedBox(self._tf)
        self._arm = Arm(self._tf, rospy.get_param("~ik", "kdl"))
        self._goal = self._pose(GOAL)
        for name in self._actions:
            rospy.Service(f"lfd/{name}", Trigger, partial(self._ask, name))
        self._indices, self._pressed = rospy.get_param("~buttons", [0, 1, 2]), frozenset[str]()
        rospy.Subscriber("joy", Joy, self._on_joy, queue_size=100)

    def run(self) -> None:
        """Runs until ROS shuts down, or until `~rounds` plans have been executed. With `~rounds` 0, there is no limit.

        Raises:
            InterfaceError: If an execution did not bring the box to its goal.
        """
        wait_until_ready()
        rospy.loginfo("key 1: home; key 2: starts and ends a demonstration; key 3: learns, and then executes")
        self._become("ready")
        while not rospy.is_shutdown() and not (self._rounds and len(self._executed) >= self._rounds):
            try:
                name = self._wanted.get(timeout=POLL_S)
            except queue.Empty:
                self._idle()
                continue
            before = self._name
            try:
                self._actions[name]()
            except (InterfaceError, OSError) as error:
                rospy.logerr("%s: %s", name, error)
                self._become(AFTER_FAILURE.get(before, before))
        missed = [str(run.error) for run in self._executed if not run.error.is_at_goal]
        if missed and not rospy.is_shutdown():
            raise InterfaceError(f"the box was not at its goal: {'; '.join(missed)}")
        if self._rounds and not rospy.is_shutdown():
            end_launch("all executions are done")

    # --- Keys

    def _on_joy(self, message: Joy) -> None:
        pressed = frozenset(
            name
            for name, index in zip(self._actions, self._indices)
            if 0 <= index < len(message.buttons) and message.buttons[index]
        )
        before, self._pressed = self._pressed, pressed
        for name in pressed - before:
            self._ask(name)

    def _ask(self, name: str, _: object = None) -> TriggerResponse:
        if self._name.endswith("ing") and self._name != DEMONSTRATING:
            rospy.logwarn("%s: not now, it is %s", name, self._name)
            return TriggerResponse(False, f"not now, it is {self._name}")
        self._wanted.put(name)
        return TriggerResponse(True, "")

    def _become(self, name: str) -> None:
        self._name = name
        self._state.publish(name)

    def _idle(self) -> None:
        """Updates the windows of the plots. Warns if the tip has not moved since the start of a demonstration."""
        if self._plots and self._executed:
            from matplotlib import pyplot

            pyplot.pause(POLL_S)
        if self._name == DEMONSTRATING and time.monotonic() > self._quiet_s:
            self._quiet_s = math.inf
            tip = self._pose(TIP)
            if math.hypot(tip.x, tip.y) < NEAR_ORIGIN_M:
                rospy.logwarn("no input moves the tip for %g s: does the window of the device have the focus?", QUIET_S)

    # --- The steps

    def _home(self) -> None:
        """Discards an unfinished demonstration, raises the arm, removes the box and moves the tip to the origin."""
        if self._name == DEMONSTRATING:
            rospy.loginfo("discarded: %s", discard_episode())
        self._become("moving")
        self._prepare(ORIGIN_PLACE)
        self._become("home")

    def _demonstrate(self) -> None:
        """Starts a demonstration, or ends the running demonstration."""
        if self._name == DEMONSTRATING:
            self._end_demonstration()
            return
        self._become("preparing")
        self._arm.require_reach(self._last_contact(), "the goal")
        if not self._is_at_origin():
            self._prepare(ORIGIN_PLACE)
        self._skill = self._demonstration = None
        self._begin_episode()
        self._quiet_s = time.monotonic() + QUIET_S
        self._become(DEMONSTRATING)
        rospy.loginfo("push the box to the green goal, then press 2")

    def _is_at_origin(self) -> bool:
        tip, target = self._pose(TIP), self._pose(TARGET)
        return not self._box.is_there and max(math.hypot(*each[:2]) for each in (tip, target)) < NEAR_ORIGIN_M

    def _last_contact(self) -> Array:
        """Returns the position of the tip at the end of a straight push from the origin to the goal, shape (2,) [m]."""
        goal = np.array([self._goal.x, self._goal.y])
        return np.asarray(goal * (1.0 - (HALF_SIDE_M + TIP_RADIUS_M) / np.linalg.norm(goal)))

    def _end_demonstration(self) -> None:
        run = finish_episode(self._out, self._box.error())
        self._shown.append(run)
        self._demonstration = run
        print(run.table.describe().round(3).to_string(), flush=True)
        self._publish("demonstration", run.table[["tip/x", "tip/y"]].to_numpy())
        rospy.loginfo("demonstration %d: %d rows; the box is %s", run.episode, len(run.table), run.error)
        if not run.error.is_good_to_learn:
            rospy.logwarn("a skill learned from it may not bring the box to the goal: press 2 to demonstrate again")
        self._become("demonstrated" if run.error.is_good_to_learn else "missed")

    def _learn_or_execute(self) -> None:
        if self._skill is not None:
            self._execute()
            return
        if self._demonstration is None:
            raise InterfaceError("there is no demonstration yet: press 2 to start one")
        self._skill = PushSkill(self._demonstration.path(), self._learn)
        rospy.loginfo("learned from demonstration %d; press 3 again to execute", self._demonstration.episode)
        self._become("learned")

    def _execute(self) -> None:
        """Plans from a random start, moves the tip to this start, executes the plan, and writes the results."""
        assert self._skill is not None
        start = self._random.uniform(-MAX_OFFSET_M, MAX_OFFSET_M, 2)
        self._become("executing")
        plan = self._skill.plan(start)
        self._arm.require_plan(plan)
        self._publish("plan", plan.places)
        self._prepare(start)
        self._begin_episode()
        self._arm.follow(plan)
        run = finish_episode(self._out, self._box.error(), plan)
        self._executed.append(run)
        self._report()
        rospy.loginfo("execution %d from (%.3f, %.3f): the box is %s", len(self._executed), *start, run.error)
        self._become("executed")

    def _pose(self, frame: str) -> PlanarPose:
        """Returns the pose of a frame in the person's frame."""
        return planar(self._tf.wait_for_tf_msg(ORIGIN, frame))

    def _prepare(self, start: Array) -> None:
        """Raises the arm, removes the box and moves the tip to a start position [m]."""
        self._arm.home()
        self._box.remove()
        self._arm.go_to(start)

    def _begin_episode(self) -> None:
        self._box.drop()
        rospy.loginfo(begin_episode())

    # --- Results

    def _report(self) -> None:
        """Writes summary.json and the pictures. With `~plot`, also shows the pictures in windows."""
        facts = {
            "operator": rospy.get_param("~operator", ""),
            "seed": self._seed,
            "goal": [round(each, 4) for each in self._goal],
        }
        write_summary(self._out / "summary.json", facts, self._shown, self._executed)
        draw: dict[str, Callable[[Figure], None]] = {
            "paths": lambda figure: draw_paths(figure, self._goal, self._shown[-1], self._executed),
            "pipeline": lambda figure: draw_pipeline(figure, self._goal, self._shown[-1], self._executed[-1]),
        }
        for name, make in draw.items():
            figure = self._figure(name)
            make(figure)
            write_picture(figure, self._out / f"{name}.png")

    def _figure(self, name: str) -> Figure:
        """Returns an empty figure. With `~plot`, the figure has a window."""
        if not self._plots:
            return Figure(figsize=SIZES[name], layout="constrained")
        from matplotlib import pyplot  # needs a screen

        figure = pyplot.figure(name, figsize=SIZES[name], layout="constrained", clear=True)
        pyplot.show(block=False)
        return figure

    def _publish(self, name: str, places: Array) -> None:
        message = PathMessage()
        message.header.frame_id = ORIGIN
        for place in places[::5]:
            pose = as_pose(transform_message((*place, 0.0), (0.0, 0.0, 0.0)))
            message.poses.append(PoseStamped(message.header, pose))
        self._paths[name].publish(message)


def main() -> None:
    """Runs the node."""
    run_node("run_lfd", lambda: LfdNode().run())
