"""Start, stop and step of a model predictive controller."""

from functools import partial
from typing import Any

from PyQt5.QtWidgets import QHBoxLayout, QPushButton
from std_srvs.srv import Trigger

from rpbi_utils.console.running_simulator import RunningSimulator
from rpbi_utils.controls.requests import BackgroundRequests

from .link import SimulatorLink, SimulatorSnapshot
from .panel import Panel, named

BUTTONS = {"Start": "Lets the controller run", "Step": "Runs one cycle", "Stop": "Lets the robot stand"}
"""Titles of buttons and their tips; their services are `mpc/start` and so on."""


class MpcPanel(Panel):
    """Start, stop and step of the controller behind `mpc/...`; hidden as long as there is none."""

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
