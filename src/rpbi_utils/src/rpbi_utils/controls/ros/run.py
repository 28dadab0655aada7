"""Panels that start, stop and step the world or a model predictive controller, and a panel for planned motions."""

from functools import partial
from typing import Any

from PyQt5.QtWidgets import QDoubleSpinBox, QGridLayout, QHBoxLayout, QPushButton, QSpinBox
from std_srvs.srv import Trigger

from ros_pybullet_interface.srv import SetRealTimeFactor, StepN
from rpbi_utils.console.running_simulator import RunningSimulator
from rpbi_utils.controls.requests import BackgroundRequests, RequestResult
from rpbi_utils.plain_text import plain_label

from .link import SimulatorLink, SimulatorSnapshot
from .panel import Condition, Panel, named

MAX_STEPS = 1_000_000
"""Largest number of steps in one request. The simulator refuses a request with more steps."""
STEPS_LIMIT_S = 3600.0
DASH = "–"


class RunPanel(Panel):
    """Starts, stops, steps and resets the world, sets the real-time factor, and shows the world's state."""

    def __init__(self, link: SimulatorLink, requests: BackgroundRequests) -> None:
        super().__init__("Simulation", link, requests)
        grid = QGridLayout(self)
        for column, button in enumerate(
            (
                self._button("Start", "rpbi/start", "Lets the world run", _stands),
                self._button("Step", "rpbi/step", "Advances by one tick", _stands),
                self._button("Stop", "rpbi/stop", "Stops the world", _runs),
                self._button("Reset", "rpbi/reset", "Resets the world to its start", lambda _: True),
            )
        ):
            grid.addWidget(button, 0, column)

        self._count = named(QSpinBox(), "steps", "Number of steps")
        self._count.setRange(1, MAX_STEPS)
        self._count.setValue(100)
        self._count.setGroupSeparatorShown(True)
        self._steps = named(QPushButton("N steps"), "n_steps", "Advances by this number of ticks, as fast as possible")
        self._steps.clicked.connect(lambda: self._go(self._count.value()))
        self.require("rpbi/step_n", self._count)
        self.require("rpbi/step_n", self._steps, when=_stands)
        grid.addWidget(plain_label("Steps"), 1, 0)
        grid.addWidget(self._count, 1, 1, 1, 2)
        grid.addWidget(self._steps, 1, 3)

        self._factor = named(QDoubleSpinBox(), "factor", "Simulated seconds per second")
        self._factor.setRange(0.0, 1000.0)
        self._factor.setDecimals(3)
        self._factor.setSingleStep(0.1)
        self._factor.setValue(1.0)
        self._factor.setSpecialValueText("as fast as possible")
        self._set = named(QPushButton("Set"), "set_factor", "Changes the pace")
        self._set.clicked.connect(lambda: self._pace(self._factor.value()))
        self.require("rpbi/set_real_time_factor", self._set, self._factor)
        grid.addWidget(plain_label("Real-time factor"), 2, 0)
        grid.addWidget(self._factor, 2, 1, 1, 2)
        grid.addWidget(self._set, 2, 3)

        self._status = named(plain_label(), "status")
        self._figures = {
            name: named(plain_label(DASH), name) for name in ("time", "tick", "achieved", "overruns", "lost", "resets")
        }
        titles = ("Time", "Tick", "Achieved", "Overruns", "Lost time", "Resets")
        grid.addWidget(plain_label("Status"), 3, 0)
        grid.addWidget(self._status, 3, 1, 1, 3)
        for index, (title, label) in enumerate(zip(titles, self._figures.values())):
            row, column = divmod(index, 2)
            grid.addWidget(plain_label(title), 4 + row, 2 * column)
            grid.addWidget(label, 4 + row, 2 * column + 1)
        for column in range(4):
            grid.setColumnStretch(column, 1)
        self._asked: float | None = None

    def refresh(self, snapshot: SimulatorSnapshot) -> None:
        super().refresh(snapshot)
        self._show_status(snapshot)
        state = snapshot.state
        if state is None:
            for label in self._figures.values():
                label.setText(DASH)
            self._asked = None
            return
        if state.real_time_factor_asked != self._asked:  # at the start, or changed by another node
            self._asked = state.real_time_factor_asked
            self._factor.setValue(state.real_time_factor_asked)
        texts = {
            "time": f"{state.simulated_time:.3f} s",
            "tick": f"{state.tick:,}",
            "achieved": f"{state.real_time_factor:.3f}",
            "overruns": f"{state.overruns:,}",
            "lost": f"{state.lost_time:.3f} s",
            "resets": f"{state.resets}",
        }
        for name, text in texts.items():
            self._figures[name].setText(text)

    def _show_status(self, snapshot: SimulatorSnapshot) -> None:
        if not snapshot.is_alive:
            text, colour = "no simulator", "#a02020"
        elif not snapshot.is_running:
            text, colour = "stopped", "#806000"
        elif snapshot.warning:
            text, colour = snapshot.warning, "#806000"
        else:
            text, colour = "running", "#207020"
        self._status.setText(text)
        self._status.setStyleSheet(f"font-weight: bold; color: {colour}")

    def _button(self, title: str, service: str, tip: str, when: Condition) -> QPushButton:
        button: QPushButton = named(QPushButton(title), title.lower(), tip)
        button.clicked.connect(lambda: self.ask(title, partial(_call, service, Trigger), self._look_again))
        self.require(service, button, when=when)
        return button

    def _look_again(self, outcome: RequestResult) -> None:
        if outcome.name == "Reset" and not outcome.error:
            self.link.look()  # a reset adds removed objects again

    def _go(self, steps: int) -> None:
        self.ask("N steps", partial(_call, "rpbi/step_n", StepN, steps), limit_s=STEPS_LIMIT_S)

    def _pace(self, factor: float) -> None:
        self.ask("Real-time factor", partial(_call, "rpbi/set_real_time_factor", SetRealTimeFactor, factor))


def _call(service: str, service_type: type, *arguments: object) -> Any:
    return RunningSimulator().call(service, service_type, *arguments).message


def _runs(snapshot: SimulatorSnapshot) -> bool:
    return snapshot.is_running


def _stands(snapshot: SimulatorSnapshot) -> bool:
    return not snapshot.is_running


BUTTONS = {"Start": "Lets the controller run", "Step": "Runs one cycle", "Stop": "Lets the robot stand"}
"""Title and tool tip of each button. The button `Start` calls the service `mpc/start`, and so on."""


class MpcPanel(Panel):
    """Starts, stops and steps a model predictive controller. The panel is hidden unless `mpc/step` is offered."""

    def __init__(self, link: SimulatorLink, requests: BackgroundRequests) -> None:
        super().__init__("Model predictive control", link, requests)
        row = QHBoxLayout(self)
        for title, tip in BUTTONS.items():
            service = f"mpc/{title.lower()}"
            button = named(QPushButton(title), f"mpc_{title.lower()}", tip)
            button.clicked.connect(partial(self._call, f"MPC {title.lower()}", service))
            self.require(service, button)
            row.addWidget(button)

    def refresh(self, snapshot: SimulatorSnapshot) -> None:
        super().refresh(snapshot)
        self.setVisible(snapshot.has("mpc/step"))

    def _call(self, name: str, service: str, _: Any = None) -> None:
        self.ask(name, lambda: RunningSimulator().call(service, Trigger).message)


PLANNER_BUTTONS = {
    "Plan": ("planner/plan_to_frame", "Plans a motion to the goal that is dragged in RViz, and shows it"),
    "Move": ("planner/move", "Executes the shown motion"),
    "Stop": ("planner/stop", "Stops planning and moving"),
}
"""Title, service and tool tip of each button."""
PLANNER_LIMIT_S = 600.0


class PlannerPanel(Panel):
    """Plans a motion to the dragged goal, and executes it. The panel is hidden unless a planner offers its services."""

    def __init__(self, link: SimulatorLink, requests: BackgroundRequests) -> None:
        super().__init__("Motion planning", link, requests)
        row = QHBoxLayout(self)
        for title, (service, tip) in PLANNER_BUTTONS.items():
            button = named(QPushButton(title), f"planner_{title.lower()}", tip)
            button.clicked.connect(partial(self._call, title, service))
            self.require(service, button)
            row.addWidget(button)

    def refresh(self, snapshot: SimulatorSnapshot) -> None:
        super().refresh(snapshot)
        self.setVisible(snapshot.has("planner/plan_to_frame"))

    def _call(self, name: str, service: str, _: Any = None) -> None:
        self.ask(name, lambda: RunningSimulator().call(service, Trigger).message, limit_s=PLANNER_LIMIT_S)
