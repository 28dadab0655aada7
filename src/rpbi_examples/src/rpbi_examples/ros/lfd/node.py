"""`run_lfd.py`: learns from a person how to push a box, plans from random starts, executes, and draws what happened."""

from __future__ import annotations

import math
import queue
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import rospy
from cob_srvs.srv import SetString
from geometry_msgs.msg import PoseStamped, TransformStamped
from matplotlib.figure import Figure
from nav_msgs.msg import Path as PathMessage
from sensor_msgs.msg import Joy
from std_msgs.msg import String
from std_srvs.srv import Trigger, TriggerResponse

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.services import call_service
from custom_ros_tools.ros.tf_interface import TfInterface
from custom_ros_tools.ros.transform_messages import as_pose, transform_message
from custom_ros_tools.transforms import Array
from episodes import EpisodeFolder
from episodes.folder import BAG
from ros_pybullet_interface.msg import PybulletObject
from ros_pybullet_interface.srv import AddPybulletObject
from rpbi_examples.lfd.report import DPI, SIZE, BoxError, Run, draw_paths, draw_pipeline, write_summary
from rpbi_examples.lfd.skill import Plan, PushSkill, Shown
from rpbi_examples.motions import PlanarPose
from rpbi_examples.ros.human_interaction import interrupt_roslaunch
from rpbi_utils import bag_to_dataframes, transforms_between

from .arm import ORIGIN, TARGET, TIP, Arm, planar, yaw_of

BOX_FILE, BOX_NAME = "{rpbi_examples}/configs/lfd/box.yaml", "pushing_box"
BOX, GOAL = f"rpbi/{BOX_NAME}", "rpbi/goal"
CONTACTS, SIGNAL = f"/rpbi/{BOX_NAME}/contacts", "/operator_node/signal"
ROBOT = "kuka_lwr"
DEMONSTRATING = "demonstrating"
AFTER_FAILURE = {DEMONSTRATING: "home", "demonstrated": "missed", "learned": "missed", "executed": "missed"}
"""State after a step that failed, by the state before."""
ORIGIN_PLACE = np.zeros(2)
MAX_OFFSET_M = 0.1
"""Largest distance of a random start from the origin, along x and y [m]."""
NEAR_ORIGIN_M = 0.03
"""Distance of the tip from the origin up to which a demonstration may begin [m]."""
REST_S, MAX_DROP_S = 0.5, 5.0
"""Time for which the box has to lie still, and longest time until it does [s]."""
REST_M = 0.0005
"""Distance by which a box that lies still may move meanwhile [m]."""
QUIET_S = 15.0
"""Wall time of a demonstration without motion after which it is reported [s]."""
POLL_S = 0.05


class Lesson:
    """Does what keys ask for, one after the other, and publishes on `lfd/state` what it is ready for."""

    def __init__(self) -> None:
        self._out = Path(rospy.get_param("~out", "lfd"))
        self._rounds, self._seed = rospy.get_param("~rounds", 0), rospy.get_param("~seed", 0)
        self._random = np.random.default_rng(self._seed)
        self._shown: list[Run] = []
        self._executed: list[Run] = []
        self._skill: PushSkill | None = None
        self._has_box = False
        self._quiet_s = math.inf
        self._wanted: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._actions = {"home": self._home, "demonstrate": self._demonstrate, "learn": self._learn_or_execute}
        self._name = "start"
        self._state = rospy.Publisher("lfd/state", String, queue_size=1, latch=True)
        self._paths = {
            name: rospy.Publisher(f"lfd/{name}", PathMessage, queue_size=1, latch=True)
            for name in ("demonstration", "plan")
        }
        self._tf = TfInterface()
        self._arm = Arm(self._tf, rospy.get_param("~ik", "kdl"))
        self._goal = self._pose(GOAL)
        for name in self._actions:
            rospy.Service(f"lfd/{name}", Trigger, partial(self._ask, name))
        self._indices, self._pressed = rospy.get_param("~buttons", [0, 1, 2]), frozenset[str]()
        rospy.Subscriber("joy", Joy, self._on_joy, queue_size=100)

    def run(self) -> None:
        """Acts until ROS shuts down, or until the wanted number of executions.

        Raises:
            InterfaceError: If the box was not at its goal after one of them.
        """
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
            interrupt_roslaunch()

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
        """Warns of a demonstration in which nothing happens."""
        if self._name == DEMONSTRATING and time.monotonic() > self._quiet_s:
            self._quiet_s = math.inf
            tip = self._pose(TIP)
            if math.hypot(tip.x, tip.y) < NEAR_ORIGIN_M:
                rospy.logwarn("no input moves the tip for %g s: does the window of the device have the focus?", QUIET_S)

    # --- The steps of the lesson

    def _home(self) -> None:
        """Raises the arm, takes the box away and goes to the origin; a demonstration is discarded."""
        if self._name == DEMONSTRATING:
            rospy.loginfo("discarded: %s", call_service("record/discard", Trigger).message)
        self._become("moving")
        self._prepare(ORIGIN_PLACE)
        self._become("home")

    def _demonstrate(self) -> None:
        """Starts a demonstration, or ends it."""
        if self._name == DEMONSTRATING:
            self._end_demonstration()
            return
        self._become("preparing")
        self._arm.require_reach(np.array([self._goal.x, self._goal.y]), "the goal")
        if not self._is_at_origin():
            self._prepare(ORIGIN_PLACE)
        self._skill = None
        self._drop_box()
        self._record()
        self._quiet_s = time.monotonic() + QUIET_S
        self._become(DEMONSTRATING)
        rospy.loginfo("push the box to the green goal, then press 2")

    def _is_at_origin(self) -> bool:
        tip, target = self._pose(TIP), self._pose(TARGET)
        return not self._has_box and max(math.hypot(*each[:2]) for each in (tip, target)) < NEAR_ORIGIN_M

    def _end_demonstration(self) -> None:
        run = self._finish(None)
        self._shown.append(run)
        print(run.table.describe().round(3).to_string(), flush=True)
        self._publish("demonstration", run.table[["tip/x", "tip/y"]].to_numpy())
        rospy.loginfo("demonstration %d: %d rows; the box is %s", run.episode, len(run.table), run.error)
        if not run.error.is_at_goal:
            rospy.logwarn("what is learned from it will not bring the box there: press 2 to demonstrate again")
        self._become("demonstrated" if run.error.is_at_goal else "missed")

    def _learn_or_execute(self) -> None:
        if self._skill is not None:
            self._execute()
            return
        if not self._shown or self._name == "home":
            raise InterfaceError("there is no demonstration yet: press 2 to start one")
        table = self._shown[-1].table
        touched = table.index[table["contact"] > 0.0]
        contact_s = float(touched[0]) if len(touched) else None
        self._skill = PushSkill(Shown(table.index.to_numpy(), table[["tip/x", "tip/y"]].to_numpy(), contact_s))
        rospy.loginfo("learned from demonstration %d; press 3 again to execute", self._shown[-1].episode)
        self._become("learned")

    def _execute(self) -> None:
        """Plans from a random start, goes there first, and then executes the plan."""
        assert self._skill is not None
        start = self._random.uniform(-MAX_OFFSET_M, MAX_OFFSET_M, 2)
        self._become("executing")
        plan = self._skill.plan(start)
        self._arm.require_plan(plan)
        self._publish("plan", plan.places)
        self._prepare(start)
        self._drop_box()
        self._record()
        self._arm.follow(plan)
        run = self._finish(plan)
        self._executed.append(run)
        self._report()
        rospy.loginfo("execution %d from (%.3f, %.3f): the box is %s", len(self._executed), *start, run.error)
        self._become("executed")

    # --- Box and arm

    def _pose(self, frame: str) -> PlanarPose:
        """Returns where a frame is in the person's frame."""
        return planar(self._tf.wait_for_tf_msg(ORIGIN, frame))

    def _box_in(self, frame: str) -> TransformStamped:
        """Returns the pose of the box from now on, in a frame."""
        now = rospy.Time.now()
        while (message := self._tf.wait_for_tf_msg(frame, BOX)) is None or message.header.stamp < now:
            time.sleep(POLL_S)
        return message

    def _prepare(self, start: Array) -> None:
        """Raises the arm, takes the box away and moves the tip to a start."""
        self._arm.home()
        if self._has_box:
            call_service("rpbi/remove_pybullet_object", SetString, BOX_NAME)
            self._has_box = False
        self._arm.go_to(start)

    def _drop_box(self) -> None:
        """Drops the box in, and waits until it lies still."""
        box = PybulletObject(object_type=PybulletObject.DYNAMIC, filename=BOX_FILE)
        call_service("rpbi/add_pybullet_object", AddPybulletObject, box)
        self._has_box = True
        last = planar(self._box_in(ORIGIN))
        begin_s = still_s = rospy.get_time()
        while rospy.get_time() - still_s < REST_S:
            if rospy.get_time() - begin_s > MAX_DROP_S:
                raise InterfaceError(f"the box does not lie still after {MAX_DROP_S:g} s")
            rospy.sleep(POLL_S)
            pose = self._pose(BOX)
            if math.hypot(pose.x - last.x, pose.y - last.y) > REST_M:
                still_s, last = rospy.get_time(), pose

    # --- Episodes

    def _record(self) -> None:
        rospy.loginfo(call_service("record/start", Trigger).message)

    def _finish(self, plan: Plan | None) -> Run:
        """Ends an episode, and returns it as a table."""
        error = BoxError.of(*TfInterface.msg_to_pos_quat(self._box_in(GOAL)))
        call_service("record/stop", Trigger)
        folder = EpisodeFolder(self._out / "episodes")
        episode = max(each.number for each in folder.all())
        call_service("record/label", SetString, "success" if error.is_at_goal else "failure")
        table = read_episode(folder.folder_of(episode) / BAG)
        tables = self._out / "tables"
        tables.mkdir(parents=True, exist_ok=True)
        table.to_parquet(tables / f"episode_{episode:06d}.parquet", engine="fastparquet")
        table.to_csv(tables / f"episode_{episode:06d}.csv", float_format="%.6g")
        return Run(episode, table, error, plan)

    def _report(self) -> None:
        """Writes summary.json and the pictures, and shows them if wanted."""
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
            figure = Figure(figsize=SIZE, layout="constrained")
            make(figure)
            figure.savefig(self._out / f"{name}.png", dpi=DPI)

    def _publish(self, name: str, places: Array) -> None:
        message = PathMessage()
        message.header.frame_id = ORIGIN
        for place in places[::5]:
            pose = as_pose(transform_message((*place, 0.0), (0.0, 0.0, 0.0)))
            message.poses.append(PoseStamped(message.header, pose))
        self._paths[name].publish(message)


def read_episode(bag: Path) -> pd.DataFrame:
    """Returns tip, box, contact and signal of an episode in one table, at the times of the tip; see `Run`."""
    tables = bag_to_dataframes(bag)
    tip, box = (transforms_between(tables, ORIGIN, frame) for frame in (TIP, BOX))
    table = tip[["translation/x", "translation/y"]].set_axis(["tip/x", "tip/y"], axis=1)
    box_yaw = [yaw_of(quat) for quat in box[[f"rotation/{each}" for each in "xyzw"]].to_numpy()]
    box_table = (
        box[["translation/x", "translation/y"]]
        .set_axis(["box/x", "box/y"], axis=1)
        .assign(**{"box/yaw": np.unwrap(box_yaw)})
    )
    contacts = tables[CONTACTS]
    touch = contacts["normal_force"].where(contacts["other_body"] == ROBOT, 0.0).groupby(level=0).max()
    signal = tables[SIGNAL][["data/0", "data/1"]].set_axis(["signal/x", "signal/y"], axis=1)
    for part in (box_table, touch.rename("contact").to_frame(), signal):
        table = pd.merge_asof(table, part, left_index=True, right_index=True, direction="nearest")
    return table


def main() -> None:
    """Runs the node."""
    run_node("run_lfd", Lesson, Lesson.run)
