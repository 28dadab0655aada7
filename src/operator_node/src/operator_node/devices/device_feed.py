"""Keeps a device open, checks the device's readings, and publishes the valid readings."""

import logging
import math
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Sequence
from numbers import Real

from pydantic import Field

from custom_ros_tools.errors import MissingDependency
from custom_ros_tools.plugins import cause_of
from custom_ros_tools.schema import ConfigModel, HzOrOff, NonNegative
from operator_node.device import Device, DeviceClosedError, DeviceError, Reading

REOPENING_PERIOD_S = 1.0
"""Time between two attempts to open an absent device [s]."""
WARNING_PERIOD_S = 5.0
"""Shortest time between two warnings for the same reason [s]."""
AT_REST = 0.1
"""Largest difference between an axis and its value at rest at which the axis counts as being at rest."""
MAX_READINGS = 1000
"""Largest number of readings that are merged into one; otherwise a device that never pauses would not be published."""
MAX_REASONS, OTHER_REASONS = 100, "other reasons"
"""Largest number of reasons that are counted separately; further reasons are counted together. The limit is needed
because reasons from devices of other packages may contain numbers and so be arbitrarily many.
"""
MAX_POSTED = 1000
"""Largest number of queued actions on a device; beyond it, the oldest actions are dropped."""
HELD_S = 5.0
"""Time after opening at which a warning names the axes and buttons that have not been at rest yet [s]."""
logger = logging.getLogger(__name__)


class FeedConfig(ConfigModel):
    """Rate and merging of the published readings; the parameters are named as in ROS's `joy_node`."""

    autorepeat_rate: HzOrOff = Field(
        20.0,
        description="Rate at which an unchanged reading is published again, so that subscribers know that the "
        "reading is still valid; 0 disables repetition.",
    )
    coalesce_interval: NonNegative = Field(
        0.001,
        description="Time within which motions are merged into one message [s]; changes of buttons are published at "
        "once.",
    )


class DeviceFeed:
    """Keeps a device open, checks the device's readings, and publishes the valid readings.

    The feed tries to open an absent device once a second. The first published reading after opening is at rest. After
    opening, each axis and button is published as at rest until the device has reported it at rest once. An axis that
    is held while the device is plugged in therefore does not cause a motion. `held` names such axes and buttons. When
    the device disconnects or is closed, a last reading at rest is published.

    Invalid readings are counted and dropped, and the last valid reading remains in effect. The feed catches exceptions
    of the device, except those documented for `step`.

    All methods except `post` must be called from the same thread.

    Args:
        name: Name of the device in log messages.
        device: The device, which is not open yet.
        config: Rate and merging of the published readings.
        publish: Function that is called with each reading to publish.

    Attributes:
        problem: Reason why the device is not open; None while it is open.
        published: Number of published readings.
        refused: Number of refusals, keyed by reason.
        free_axes: Indices of the axes that have been at rest at least once since the device was opened.
        held: Axes and buttons that have not yet been at rest since the device was opened, such as "axis 'x'".
    """

    def __init__(self, name: str, device: Device, config: FeedConfig, publish: Callable[[Reading], None]) -> None:
        self.problem: str | None = "not opened yet"
        self.published = 0
        self.refused: Counter[str] = Counter()
        self._name, self._device, self._config, self._publish = name, device, config, publish
        self._last: Reading | None = None
        self.free_axes: set[int] = set()
        self.held: tuple[str, ...] = ()
        self._free_buttons: set[int] = set()
        self._held_warning_due_s = math.inf
        self._buttons: tuple[int, ...] | None = None
        """Buttons of the last reading; None until the first reading after the device was opened."""
        self._open_at_s = self._repeat_at_s = -math.inf
        self._is_absent = False
        self._warned_s: dict[str, float] = {}
        self._posted: deque[Callable[[], None]] = deque(maxlen=MAX_POSTED)
        self._pause = threading.Event()

    def run(self, is_over: Callable[[], bool], period_s: float = 0.02) -> None:
        """Publishes readings until `is_over` returns True or the user closes the device, then closes the device.

        Args:
            is_over: Function that is called before each step. The loop ends when it returns True.
            period_s: Longest time that one step waits [s]. Posted actions are delayed by at most this time.

        Raises:
            MissingDependency: If the device needs a library that is not installed.
        """
        try:
            while not is_over():
                self.step(period_s)
        except DeviceClosedError as error:
            logger.info("%s", error)
        finally:
            self.close()

    def step(self, timeout_s: float) -> None:
        """Runs the posted actions, then either tries to open the device or waits for one reading and publishes it.

        Args:
            timeout_s: Longest time to wait [s].

        Raises:
            DeviceClosedError: If the user has closed the device. If the device was open, a last reading at rest was
                published before.
            MissingDependency: If the device needs a library that is not installed.
        """
        for _ in range(len(self._posted)):
            self._guarded(self._posted.popleft(), "posted")
        now_s = time.monotonic()
        if self.problem is not None:
            if now_s < self._open_at_s:
                self._pause.wait(min(timeout_s, self._open_at_s - now_s))
                return
            self._open()
            return
        try:
            reading = self._next(max(min(timeout_s, self._repeat_at_s - now_s), 0.0))
        except DeviceError as error:
            self._lose(error.reason)
            if isinstance(error, DeviceClosedError):
                raise
            return
        except Exception as error:
            self._refuse(f"it failed: {type(error).__name__}", cause_of(error))
            self._lose(cause_of(error))
            return
        if reading is not None:
            self._process(reading)
        if self._last is not None and time.monotonic() >= self._repeat_at_s:
            self._emit(self._last)
        if self.held and time.monotonic() >= self._held_warning_due_s:
            self._held_warning_due_s = math.inf
            logger.warning("%s: %s", self._name, held_text(self.held))

    def post(self, action: Callable[[], None]) -> None:
        """Schedules an action that the feed's thread runs before the next reading. Any thread may call this method."""
        self._posted.append(action)

    def close(self) -> None:
        """Closes the device and publishes a last reading at rest. Does nothing if the device is not open."""
        if self.problem is None:
            self._leave()
        self.problem = "closed"

    def _open(self) -> None:
        self._open_at_s = time.monotonic() + REOPENING_PERIOD_S
        try:
            self._device.open()
        except MissingDependency:
            raise
        except DeviceClosedError:
            self._guarded(self._device.close, "close")
            raise
        except Exception as error:
            self._guarded(self._device.close, "close")
            self.problem = error.reason if isinstance(error, DeviceError) else cause_of(error)
            if not self._is_absent:
                logger.warning("%s: %s; looking for it once a second", self._name, self.problem)
            self._is_absent = True
            return
        if self._is_absent:
            logger.info("%s: it is available now", self._name)
        self.problem, self._is_absent = None, False
        self.free_axes.clear()
        self._free_buttons.clear()
        self.held, self._held_warning_due_s = (), time.monotonic() + HELD_S
        self._last = self._buttons = None
        self._emit(self._resting())

    def _lose(self, reason: str) -> None:
        """Closes a device that has disconnected or failed, and publishes a last reading at rest."""
        if not self._is_absent:
            logger.warning("%s: %s", self._name, reason)
        self._is_absent = True
        self._leave()
        self.problem = reason
        self._open_at_s = time.monotonic() + REOPENING_PERIOD_S

    def _leave(self) -> None:
        resting = self._resting()
        self._guarded(self._device.close, "close")
        self._emit(resting)
        self._last, self.held = None, ()

    def _resting(self) -> Reading:
        device = self._device
        try:
            resting = device.at_rest()
            problem, detail = problem_of(resting, device.axes, device.buttons), ""
        except Exception as error:
            problem, detail = f"it failed: {type(error).__name__}", cause_of(error)
        if problem is None:
            return resting
        self._refuse(f"at rest, {problem}", detail)
        return Reading((0.0,) * len(device.axes), (0,) * len(device.buttons))

    def _next(self, timeout_s: float) -> Reading | None:
        """Returns the next reading, merged with the readings that follow within `coalesce_interval`.

        Merging ends early at a reading with changed buttons, events or refusals. Returns None if no reading arrives
        within the timeout.
        """
        first = self._read(timeout_s)
        if first is None or first.buttons != self._buttons:
            return first
        end_s = time.monotonic() + self._config.coalesce_interval
        reading, events, refused = first, [*first.events], [*first.refused]
        for _ in range(MAX_READINGS):
            left_s = end_s - time.monotonic()
            if left_s <= 0.0 or reading.buttons != first.buttons or events or refused:
                break
            newer = self._read(left_s)
            if newer is not None:
                reading = newer
                events += newer.events
                refused += newer.refused
        return reading._replace(events=tuple(events), refused=tuple(refused))

    def _read(self, timeout_s: float) -> Reading | None:
        """Reads the device. Returns None if the device returns None or an object that is not a reading."""
        value = self._device.read(timeout_s)
        if value is None:
            return None
        try:
            return Reading(*map(tuple, value))
        except TypeError:
            self._refuse("it returned something other than a reading", f"got {value!r:.100}")
            return None

    def _process(self, reading: Reading) -> None:
        for reason in reading.refused:
            self._refuse(str(reason))
        self._buttons = reading.buttons
        problem = problem_of(reading, self._device.axes, self._device.buttons)
        if problem is not None:
            self._refuse(problem, f"got axes {reading.axes}, buttons {reading.buttons}")
            return
        reading = self._from_rest(reading)
        if self._last is None or reading.events or reading[:2] != self._last[:2]:
            self._emit(reading)

    def _from_rest(self, reading: Reading) -> Reading:
        """Sets axes and buttons to rest that have not yet been at rest since the device was opened.

        Also updates `free_axes` and `held`. Returns the changed reading.
        """
        resting = self._resting().axes
        for index, (value, rest) in enumerate(zip(reading.axes, resting)):
            if abs(value - rest) <= AT_REST:
                self.free_axes.add(index)
        self._free_buttons.update(index for index, value in enumerate(reading.buttons) if value == 0)
        axes = (
            float(value if index in self.free_axes else rest)
            for index, (value, rest) in enumerate(zip(reading.axes, resting))
        )
        buttons = (int(value) if index in self._free_buttons else 0 for index, value in enumerate(reading.buttons))
        parts = (("axis", self._device.axes, self.free_axes), ("button", self._device.buttons, self._free_buttons))
        self.held = tuple(
            f"{kind} '{name}'" for kind, names, free in parts for index, name in enumerate(names) if index not in free
        )
        return reading._replace(axes=tuple(axes), buttons=tuple(buttons))

    def _emit(self, reading: Reading) -> None:
        self._last = reading._replace(events=(), refused=())
        rate = self._config.autorepeat_rate
        self._repeat_at_s = time.monotonic() + (1.0 / rate if rate else math.inf)
        self.published += 1
        self._publish(reading)

    def _refuse(self, reason: str, detail: str = "") -> None:
        if reason not in self.refused and len(self.refused) >= MAX_REASONS:
            reason, detail = OTHER_REASONS, f"{reason}; {detail}"
        self.refused[reason] += 1
        now_s = time.monotonic()
        if now_s - self._warned_s.get(reason, -math.inf) >= WARNING_PERIOD_S:
            self._warned_s[reason] = now_s
            text = f"{reason} ({detail:.300})" if detail else reason
            logger.warning("%s: refused: %s; %d so far", self._name, text, self.refused[reason])

    def _guarded(self, action: Callable[[], None], what: str) -> None:
        try:
            action()
        except Exception as error:
            self._refuse(f"it failed in {what}: {type(error).__name__}", cause_of(error))


def held_text(held: Sequence[str]) -> str:
    """Returns a warning text about axes and buttons that have not yet been at rest since the device was opened."""
    return f"{', '.join(held)} not at rest since it was opened; release it: until then it counts as at rest"


def problem_of(reading: Reading, axes: Sequence[str], buttons: Sequence[str]) -> str | None:
    """Returns the reason why a reading is invalid; None if the reading is valid.

    The reasons do not contain measured values, so that equal faults can be counted together.

    Args:
        reading: The reading to check.
        axes: Names of the device's axes.
        buttons: Names of the device's buttons.
    """
    if len(reading.axes) != len(axes):
        return f"a reading whose number of axes differs from the {len(axes)} of the device"
    if len(reading.buttons) != len(buttons):
        return f"a reading whose number of buttons differs from the {len(buttons)} of the device"
    for name, value in zip(axes, reading.axes):
        if not isinstance(value, Real) or value != value or abs(value) == math.inf:
            return f"axis '{name}' is not a finite number"
        if not -1.0 <= value <= 1.0:
            return f"axis '{name}' is outside [-1, 1]"
    for name, value in zip(buttons, reading.buttons):
        if not isinstance(value, Real) or value not in (0, 1):
            return f"button '{name}' is neither 0 nor 1"
    return None
