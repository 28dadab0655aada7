"""The panel of a live view: buttons, sliders and fields by which viewers control a world."""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from custom_ros_tools.errors import InterfaceError

from .controls import MAX_STEPS, PRIMITIVES, Controls, JointRange, NewObject
from .moment import HISTORY_S

COMMANDS = ("Start", "Stop", "Step", "Reset")
NOTHING = "–"
"""Choice for no object, robot or image."""
FILE = "file"
MAX_FACTOR, MAX_DURATION_S = 1000.0, 600.0
SETTLED_S = 2.0
"""Time after which a change of the real-time factor is in the state of the world [s]."""
GOOD_S, BAD_S = 4.0, 15.0
"""Time for which a message is shown, if an action has succeeded and if it has failed [s]."""

_BLANK = np.zeros((1, 1, 3), np.uint8)
_log = logging.getLogger(__name__)


class ViewPanel:
    """Fields of a live view, which all viewers share: if one moves a slider, the others see it move.

    An action runs in a thread of its own. While it runs, it cannot be requested again. If the value of a field is
    changed meanwhile, the last value is applied afterwards.

    Args:
        gui: The fields of viser.
        controls: Controls of the world.

    Attributes:
        is_playing: Whether the past is being played.
    """

    def __init__(self, gui: Any, controls: Controls) -> None:
        self._gui, self._controls = gui, controls
        self._lock = threading.Lock()
        self._running: dict[str, Any] = {}
        """The last event of each running action that came while the action ran; None without one."""
        self._moved: dict[str, float] = {}
        self._sliders: dict[str, Any] = {}
        self._robot = NOTHING
        self._asked: float | None = None
        """The real-time factor that the field shows; None before it is known."""
        self._asked_s = -math.inf
        self.is_playing = False
        gui.configure_theme(control_width="medium", show_logo=False, show_share_button=False)
        self._add_world()
        self._add_time_line()
        self._add_display()
        with gui.add_folder("Joints", expand_by_default=False) as self._joints:
            self._add_joints()
        with gui.add_folder("Objects", expand_by_default=False):
            self._add_objects()
        if controls.records:
            with gui.add_folder("Recording", expand_by_default=False):
                self._add_recording()

    @property
    def shows_frames(self) -> bool:
        """Whether viewers want to see the axes of frames."""
        return bool(self._frames.value)

    @property
    def shows_names(self) -> bool:
        """Whether viewers want to see the names of frames."""
        return bool(self._names.value)

    @property
    def age_s(self) -> float:
        """Chosen point of the time line, before the moment at which it was stopped [s]; 0 shows the present."""
        return float(min(HISTORY_S, max(0.0, -self._time.value)))

    @property
    def image(self) -> str:
        """Chosen topic of images; empty for none."""
        return "" if self._image.value == NOTHING else str(self._image.value)

    def advance(self, seconds: float) -> None:
        """Moves the time line towards the present while the past is being played."""
        if self.is_playing:
            self._time.value = min(0.0, self._time.value + seconds)
            self.is_playing = self._time.value < 0.0

    def refresh(self, images: Sequence[str]) -> None:
        """Shows the present state of the world, and offers the robots and objects that it has now.

        Args:
            images: Topics of images.
        """
        controls = self._controls
        self._status.value = controls.status()
        factor = controls.factor()
        is_settled = time.monotonic() - self._asked_s > SETTLED_S  # otherwise the factor may be an older one
        if factor is not None and factor != self._asked and is_settled:  # at the start, or changed by another program
            self._asked = factor
            self._factor.value = min(MAX_FACTOR, factor)
        robots = controls.robots()
        _offer(self._choice, robots)
        if self._robot == NOTHING and robots:
            self._choice.value = robots[0]
        _offer(self._object, controls.objects())
        _offer(self._image, images)
        if self._choice.value != self._robot:
            self._show_robot(str(self._choice.value))
        positions = controls.positions(self._robot) if self._robot != NOTHING else {}
        with self._lock:
            for name, position in positions.items():
                if name in self._sliders and name not in self._moved:
                    slider = self._sliders[name]
                    slider.value = min(slider.max, max(slider.min, round(position, 3)))
        if controls.records:
            self._record.label = "End" if controls.is_recording else "Record"

    def show_image(self, pixels: Any) -> None:
        """Shows an image in the panel, or none."""
        if pixels is None:
            self._picture.visible = False
        else:
            self._picture.image = pixels
            self._picture.visible = True

    def _add_world(self) -> None:
        gui = self._gui
        self._status = gui.add_text("World", "", disabled=True)
        buttons = gui.add_button_group("", COMMANDS)
        self._on(buttons, None, lambda event: self._controls.run(_one_of(event.target.value, COMMANDS)))
        steps = gui.add_number("Ticks", 100, min=1, max=MAX_STEPS, step=1, hint="Number of ticks of the next button")
        go = gui.add_button("Run these ticks", hint="Advances the stopped world by these ticks, as fast as possible")
        self._on(go, "Ticks", lambda _: self._controls.step(int(min(MAX_STEPS, max(1, steps.value)))))
        self._factor = gui.add_number(
            "Real-time factor", 1.0, min=0.0, max=MAX_FACTOR, step=0.1, hint="Simulated seconds per second; 0: no limit"
        )
        self._on(self._factor, "Real-time factor", lambda event: self._set_factor(event.target.value))

    def _add_time_line(self) -> None:
        gui = self._gui
        self._time = gui.add_slider(
            "Time line [s]", -HISTORY_S, 0.0, 0.1, 0.0, hint="Seconds before now; all viewers see the same moment"
        )
        play = gui.add_button_group("", ("Play", "Pause", "Now"))

        @play.on_click
        def _(event: Any) -> None:
            if event.client is not None:
                self.is_playing = event.target.value == "Play"
                if event.target.value == "Now":
                    self._time.value = 0.0

    def _add_display(self) -> None:
        gui = self._gui
        with gui.add_folder("Display"):
            self._frames = gui.add_checkbox("Frames", False, hint="Axes of all frames on TF")
            self._names = gui.add_checkbox("Names of frames", False)
            self._image = gui.add_dropdown("Image", (NOTHING,), hint="Images of a camera, here and at its frustum")
            self._picture = gui.add_image(_BLANK, label="", format="jpeg", jpeg_quality=75, visible=False)

    def _add_joints(self) -> None:
        gui = self._gui
        self._choice = gui.add_dropdown("Robot", (NOTHING,))
        self._duration = gui.add_number("Duration [s]", 2.0, min=0.1, max=MAX_DURATION_S, step=0.1)
        self._send = gui.add_button("Move", disabled=True, hint="Moves the joints whose sliders were moved")
        self._on(self._send, None, lambda _: self._move())
        others = gui.add_button_group("", ("Home", "Halt", "Discard"))
        self._on(others, None, lambda event: self._run_robot(event.target.value))

    def _add_objects(self) -> None:
        gui, controls = self._gui, self._controls
        self._object = gui.add_dropdown("Object", (NOTHING,))
        remove = gui.add_button("Remove", color="red")
        self._on(remove, "Remove", lambda _: controls.remove(_chosen(self._object)))
        kinds = (*PRIMITIVES, FILE) if controls.adds_files else tuple(PRIMITIVES)
        kind = gui.add_dropdown("New", kinds)
        file = gui.add_text(
            "File", "", hint="YAML or URDF file of the simulator's computer, for 'file'", visible=controls.adds_files
        )
        name = gui.add_text("Name", "", hint="Name of the new object")
        position = gui.add_vector3("Position [m]", (0.0, 0.0, 1.0), step=0.05)
        size = gui.add_vector3("Size [m]", (0.1, 0.1, 0.1), step=0.01)
        mass = gui.add_number("Mass [kg]", 1.0, min=0.001, step=0.1)
        add = gui.add_button("Add", color="green")

        def add_it(_: Any) -> str:
            if kind.value == FILE and controls.adds_files:
                return controls.add_file(file.value.strip(), name.value.strip(), position.value)
            return controls.add(NewObject(name.value, str(kind.value), size.value, position.value, mass.value))

        self._on(add, "Add", add_it)

    def _add_recording(self) -> None:
        gui, controls = self._gui, self._controls
        label = gui.add_text("Label", "")
        self._record = gui.add_button("Record")
        self._on(
            self._record,
            "Record",
            lambda _: controls.end_recording() if controls.is_recording else controls.record(label.value.strip()),
        )
        mark = gui.add_button("Set label", hint="Labels the recording")
        self._on(mark, "Label", lambda _: controls.label(label.value.strip()))

    def _set_factor(self, factor: float) -> str:
        self._asked, self._asked_s = factor, time.monotonic()
        return self._controls.set_factor(factor)

    def _show_robot(self, robot: str) -> None:
        """Replaces the sliders by those of another robot."""
        try:
            joints = self._controls.joints(robot) if robot != NOTHING else ()
            positions = self._controls.positions(robot) if robot != NOTHING else {}
        except InterfaceError as error:
            _log.warning("the joints of %s are not shown: %s", robot, error)
            return
        with self._lock:
            for slider in self._sliders.values():
                slider.remove()
            self._robot = robot
            self._moved.clear()
            with self._joints:
                self._sliders = {joint.name: self._slider(joint, positions.get(joint.name, 0.0)) for joint in joints}
        self._send.disabled = True

    def _slider(self, joint: JointRange, position: float) -> Any:
        start = min(joint.upper, max(joint.lower, position))
        step = 0.001 if joint.upper - joint.lower > 0.002 else (joint.upper - joint.lower) / 2
        slider = self._gui.add_slider(
            joint.name,
            joint.lower,
            joint.upper,
            step,
            start,
            hint=f"{joint.lower:.3f} to {joint.upper:.3f} {joint.unit}",
        )

        @slider.on_update
        def _(event: Any) -> None:
            if event.client is not None:
                with self._lock:
                    self._moved[joint.name] = min(joint.upper, max(joint.lower, float(event.target.value)))
                self._send.disabled = False

        return slider

    def _move(self) -> str:
        with self._lock:
            robot, moved = self._robot, dict(self._moved)
        if not moved:
            raise InterfaceError("expected a joint whose slider was moved")
        text = self._controls.move(robot, moved, self._duration_s)
        with self._lock:
            if robot == self._robot:
                for name, position in moved.items():
                    if self._moved.get(name) == position:  # not moved again meanwhile
                        del self._moved[name]
                self._send.disabled = not self._moved
        return text

    @property
    def _duration_s(self) -> float:
        return float(min(MAX_DURATION_S, max(0.1, self._duration.value)))

    def _run_robot(self, command: str) -> str:
        robot = _chosen(self._choice)
        if command == "Home":
            return self._controls.home(robot, self._duration_s)
        if command == "Halt":
            return self._controls.halt(robot)
        with self._lock:
            self._moved.clear()
        self._send.disabled = True
        return "the sliders follow the joints again"

    def _on(self, handle: Any, name: str | None, action: Callable[[Any], str]) -> None:
        """Runs an action when a viewer changes or clicks a field, and shows the action's message to this viewer.

        Args:
            handle: The field.
            name: Name of the action; None for the value or the label of the field.
            action: Function of viser's event.
        """

        def act(event: Any) -> None:
            if event.client is None:  # changed by this program
                return
            title = name or (event.target.value if isinstance(event.target.value, str) else event.target.label)
            with self._lock:
                if title in self._running:
                    self._running[title] = event
                    return
                self._running[title] = None
            while event is not None:
                self._perform(event, title, action)
                with self._lock:
                    later = self._running.pop(title)
                    event = None if hasattr(handle, "on_click") else later
                    if event is not None:
                        self._running[title] = None

        if hasattr(handle, "on_click"):
            handle.on_click(act)
        else:
            handle.on_update(act)

    def _perform(self, event: Any, title: str, action: Callable[[Any], str]) -> None:
        try:
            text, is_good = action(event), True
        except InterfaceError as error:
            text, is_good = str(error), False
        except Exception as error:
            _log.warning("%s: %s", title, error, exc_info=True)
            text, is_good = f"{type(error).__name__}: {error}", False
        event.client.add_notification(
            title, text, auto_close_seconds=GOOD_S if is_good else BAD_S, color="green" if is_good else "red"
        )


def _offer(dropdown: Any, names: Sequence[str]) -> None:
    """Changes the options of a field, if they differ."""
    options = (NOTHING, *names)
    if options != tuple(dropdown.options):
        dropdown.options = options


def _chosen(dropdown: Any) -> str:
    return _one_of(dropdown.value, [each for each in dropdown.options if each != NOTHING])


def _one_of(value: Any, options: Sequence[str]) -> str:
    if value not in options:
        raise InterfaceError("expected a choice from the list")
    return str(value)
