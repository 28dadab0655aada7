"""Moves a frame in a figure eight, `figure_eight` in `figure_eight_base`."""

from __future__ import annotations

from custom_ros_tools.ros.lifecycle.parameters import private_parameters
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.services import ToggleService
from custom_ros_tools.toggle import Toggle
from rpbi_examples.figure_eight import FigureEight

from .moving_frame import NO_ROTATION, move_frame


class FigureEightNode:
    """Broadcasts the frame; it stands where it is while the node is switched off.

    Raises:
        ConfigError: If a parameter is wrong.
    """

    def __init__(self) -> None:
        figure = private_parameters(FigureEight)
        self._time_s, self._last_s, self._moves = 0.0, 0.0, False
        moving = Toggle("figure eight", lambda: self._switch(True), lambda: self._switch(False))
        if figure.start_on_init:
            moving.on()
        ToggleService("toggle_figure_eight", moving.on, moving.off)
        parent, child = figure.frame("figure_eight_base"), figure.frame("figure_eight")
        move_frame(parent, child, lambda now_s: (figure.position(self._own_time_s(now_s)), NO_ROTATION), figure.hz)

    def _switch(self, on: bool) -> None:
        self._moves = on

    def _own_time_s(self, now_s: float) -> float:
        """Returns the time that it has moved [s]."""
        if self._moves:
            self._time_s += now_s - self._last_s
        self._last_s = now_s
        return self._time_s


def main() -> None:
    """Runs the node."""
    run_node("figure_eight", FigureEightNode)
