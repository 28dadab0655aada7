"""Panel with sliders for the joints of robots."""

import math
from functools import partial
from typing import Any

import rospy
from PyQt5.QtCore import Qt
from PyQt5.QtWidgets import (
    QDoubleSpinBox,
    QGridLayout,
    QHBoxLayout,
    QPushButton,
    QSlider,
    QTabWidget,
    QVBoxLayout,
    QWidget,
)
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from ros_pybullet_interface.msg import JointInfo
from ros_pybullet_interface.srv import ResetJointState, RobotInfo, SetJointState
from rpbi_utils.console.running_simulator import RunningSimulator
from rpbi_utils.controls.requests import LIMIT_S, BackgroundRequests, RequestResult
from rpbi_utils.plain_text import plain_label

from .link import SimulatorLink, SimulatorSnapshot
from .panel import Panel, ScrolledDown, named

UNLIMITED_RAD, UNLIMITED_M = math.pi, 1.0
"""Half the slider range of a joint without limits: of a revolute joint [rad], and of another joint [m]."""
SLIDER_STEPS = 10_000
MOVED = "font-weight: bold"
"""Style of the name of a joint whose slider was moved."""


class JointRow:
    """Widgets of one joint: a slider, a field with the target, and a text with the measured position.

    Slider and target follow the measured position until the user changes one of them.

    Args:
        info: Name, type and limits of the joint.
    """

    def __init__(self, info: JointInfo) -> None:
        self.name = info.jointName
        lower, upper = info.jointLowerLimit, info.jointUpperLimit
        if lower >= upper or not math.isfinite(upper - lower):
            upper = UNLIMITED_RAD if info.is_revolute else UNLIMITED_M
            lower = -upper
        self._lower, self._span = lower, upper - lower
        unit = "rad" if info.is_revolute else "m"
        self.slider = named(
            QSlider(Qt.Orientation.Horizontal), f"slider {self.name}", f"{lower:.3f} to {upper:.3f} {unit}"
        )
        self.slider.setRange(0, SLIDER_STEPS)
        self.slider.setMinimumWidth(120)
        self.target = named(QDoubleSpinBox(), f"target {self.name}", "Target")
        self.target.setRange(lower, upper)
        self.target.setDecimals(3 if info.is_revolute else 4)
        self.target.setSingleStep(self._span / 100)
        self.target.setSuffix(f" {unit}")
        self.measured = named(plain_label(), f"measured {self.name}", "Present position")
        self.measured.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        self.measured.setMinimumWidth(self.measured.fontMetrics().horizontalAdvance("-000.0000 m"))
        self._digits, self._unit = self.target.decimals(), unit
        self.title = plain_label(self.name)
        self.title.setStyleSheet(MOVED)
        self.title.setMinimumWidth(self.title.sizeHint().width())  # otherwise the slider would move under the mouse
        self.title.setStyleSheet("")
        self.is_moved = False
        self.slider.valueChanged.connect(self._on_slider)
        self.target.valueChanged.connect(self._on_target)

    def show_position(self, position: float) -> None:
        """Shows a measured position of the joint [rad or m]."""
        self.measured.setText(f"{position:.{self._digits}f} {self._unit}")
        if not self.is_moved and not self.slider.isSliderDown():
            self._set(position)

    def release(self) -> None:
        """Makes slider and target follow the measured position again."""
        self._mark(False)

    def _on_slider(self, step: int) -> None:
        self._set(self._lower + self._span * step / SLIDER_STEPS, slider=False)
        self._mark(True)

    def _on_target(self, position: float) -> None:
        self._set(position, target=False)
        self._mark(True)

    def _set(self, position: float, slider: bool = True, target: bool = True) -> None:
        for widget, is_set, value in (
            (self.slider, slider, round(SLIDER_STEPS * (position - self._lower) / self._span)),
            (self.target, target, position),
        ):
            if is_set:
                widget.blockSignals(True)
                widget.setValue(value)
                widget.blockSignals(False)

    def _mark(self, is_moved: bool) -> None:
        self.is_moved = is_moved
        self.title.setStyleSheet(MOVED if is_moved else "")


class RobotTab(QWidget):
    """Tab with the joints of one robot.

    Args:
        robot: Name of the robot.
        panel: Panel that contains the tab.
    """

    def __init__(self, robot: str, panel: Panel) -> None:
        super().__init__()
        self._robot, self._panel = robot, panel
        self._rows: dict[str, JointRow] = {}
        self._is_known = self._is_asked = False
        self._snapshot = SimulatorSnapshot()
        layout = QVBoxLayout(self)
        self._table = QWidget()
        self._grid = QGridLayout(self._table)
        self._grid.setContentsMargins(0, 0, 8, 0)
        self._grid.setColumnStretch(1, 1)
        layout.addWidget(ScrolledDown(self._table))

        self._duration = named(QDoubleSpinBox(), "duration", "Duration of a motion, in the world's time")
        self._duration.setRange(0.1, 600.0)
        self._duration.setDecimals(1)
        self._duration.setValue(2.0)
        self._duration.setSuffix(" s")
        self._send = _button("Send", "Moves the joints whose sliders were moved", self._on_send)
        self._home = _button("Home", "Moves all joints to where they started", self._on_home)
        self._halt = _button("Halt", "Ends a motion; the joints hold where they are", self._on_halt)
        self._back = _button("Discard", "Makes the sliders follow the joints again", self._on_discard)
        line = QHBoxLayout()
        line.addWidget(plain_label("In"))
        for widget in (self._duration, self._send, self._home, self._halt, self._back):
            line.addWidget(widget)
        layout.addLayout(line)

    def refresh(self, snapshot: SimulatorSnapshot, state: JointState | None) -> None:
        """Shows the measured positions, and enables the buttons whose services the simulator offers."""
        if not self._is_known:
            self._ask_for_joints()
        positions = dict(zip(state.name, state.position)) if state is not None else {}
        for name in positions.keys() & self._rows.keys():
            self._rows[name].show_position(positions[name])
        self._home.setEnabled(snapshot.has(self._service("move_to_initial_joint_state")))
        self._halt.setEnabled(snapshot.has(self._service("stop_motion")))
        self._snapshot = snapshot
        self._show_moved()

    def _show_moved(self) -> None:
        """Enables or disables the buttons Send and Discard, and the field with the duration."""
        snapshot = self._snapshot
        is_moved = any(row.is_moved for row in self._rows.values())
        moves = snapshot.has(self._service("move_to_joint_state"))
        self._send.setEnabled(is_moved and (moves or snapshot.has(self._service("set_joint_state"))))
        self._back.setEnabled(is_moved)
        self._duration.setEnabled(moves)

    def _service(self, name: str) -> str:
        return f"rpbi/{self._robot}/{name}"

    def _ask_for_joints(self) -> None:
        if self._is_asked:
            return
        self._is_asked = True
        call = partial(_call, self._service("robot_info"), RobotInfo)
        self._panel.ask(f"Joints of {self._robot}", call, self._show_joints)

    def _show_joints(self, outcome: RequestResult) -> None:
        self._is_asked, self._is_known = False, not outcome.error
        if outcome.error:
            return
        movable = [info for info in outcome.value.joint_info if not info.is_fixed]
        for row, joint in enumerate(map(JointRow, movable)):
            self._rows[joint.name] = joint
            joint.slider.valueChanged.connect(self._show_moved)
            joint.target.valueChanged.connect(self._show_moved)
            for column, widget in enumerate((joint.title, joint.slider, joint.target, joint.measured)):
                self._grid.addWidget(widget, row, column)
        self._grid.setRowStretch(len(movable), 1)
        state = outcome.value.current_joint_state
        for name, position in zip(state.name, state.position):
            if name in self._rows:
                self._rows[name].show_position(position)

    def _on_send(self) -> None:
        moved = {name: row.target.value() for name, row in self._rows.items() if row.is_moved}
        state = JointState(name=[*moved], position=[*moved.values()])
        if self._snapshot.has(self._service("move_to_joint_state")):
            self._move("move_to_joint_state", "Send", state, self._release(moved))
        else:  # a visual robot takes any joint positions
            call = partial(_call, self._service("set_joint_state"), SetJointState, state)
            self._panel.ask(f"Send of {self._robot}", call, self._release(moved))

    def _release(self, moved: dict[str, float]) -> Any:
        def release(outcome: RequestResult) -> None:
            for name, position in moved.items():
                if not outcome.error and self._rows[name].target.value() == position:  # not moved again meanwhile
                    self._rows[name].release()

        return release

    def _on_home(self) -> None:
        self._move("move_to_initial_joint_state", "Home", JointState())

    def _on_halt(self) -> None:
        self._panel.ask(f"Halt of {self._robot}", partial(_call, self._service("stop_motion"), Trigger))

    def _on_discard(self) -> None:
        for row in self._rows.values():
            row.release()

    def _move(self, service: str, name: str, state: JointState, then: Any = None) -> None:
        duration_s = self._duration.value()
        simulation = self._snapshot.state
        pace = simulation.real_time_factor_asked if simulation else 1.0
        limit_s = duration_s / (pace or 1.0) * 2.0 + LIMIT_S
        call = partial(_call, self._service(service), ResetJointState, state, duration_s)
        self._panel.ask(f"{name} of {self._robot}", call, then, limit_s)


class JointsPanel(Panel):
    """Sliders for the joints of all robots, with one tab per robot.

    Args:
        first: Name of the robot whose tab is initially selected; None for the first tab.
    """

    def __init__(self, link: SimulatorLink, requests: BackgroundRequests, first: str | None) -> None:
        super().__init__("Joints", link, requests)
        self._first = first
        self._tabs = named(QTabWidget(), "robots")
        self._nothing = plain_label("no robot")
        self._nothing.setAlignment(Qt.AlignmentFlag.AlignCenter)
        layout = QVBoxLayout(self)
        layout.addWidget(self._nothing)
        layout.addWidget(self._tabs)

    def refresh(self, snapshot: SimulatorSnapshot) -> None:
        super().refresh(snapshot)
        robots = snapshot.robots
        for index in reversed(range(self._tabs.count())):
            if self._tabs.tabText(index) not in robots:
                tab = self._tabs.widget(index)
                self._tabs.removeTab(index)
                tab.deleteLater()
        present = [self._tabs.tabText(index) for index in range(self._tabs.count())]
        for robot in robots:
            if robot not in present:
                self._tabs.addTab(RobotTab(robot, self), robot)
                if robot == self._first:
                    self._tabs.setCurrentIndex(self._tabs.count() - 1)
        self._tabs.setVisible(bool(robots))
        self._nothing.setVisible(not robots)
        shown = self._tabs.tabText(self._tabs.currentIndex()) if robots else ""
        self.link.follow(self.link.joints, rospy.resolve_name(f"rpbi/{shown}/joint_states") if shown else "")
        if shown:
            self._tabs.currentWidget().refresh(snapshot, self.link.joints.message)


def _button(title: str, tip: str, action: Any) -> QPushButton:
    button: QPushButton = named(QPushButton(title), title.lower(), tip)
    button.clicked.connect(action)
    return button


def _call(service: str, service_type: type, *arguments: object) -> Any:
    answer = RunningSimulator().call(service, service_type, *arguments)
    return answer if service_type is RobotInfo else answer.message
