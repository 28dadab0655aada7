"""Keeps a device open and hands on what it says, if it may be trusted."""

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

from .device import Device, DeviceClosedError, DeviceError, Reading

REOPENING_PERIOD_S = 1.0
"""How often a device that is not there is looked for."""
WARNING_PERIOD_S = 5.0
"""How often the same is warned of at most."""
AT_REST = 0.1
"""So near its value at rest, an axis counts as let go."""
MOST_READINGS = 1000
"""Readings that are put together into one at most, so that a device that never falls silent is heard all the same."""
logger = logging.getLogger(__name__)


class FeedConfig(ConfigModel):
    """How readings are handed on; the names are those of `joy_node`."""

    autorepeat_rate: HzOrOff = Field(
        20.0, description="How often a reading that does not change is repeated, so that others know that it counts."
    )
    coalesce_interval: NonNegative = Field(
        0.001, description="For how long motions are put together into one reading; buttons are handed on at once [s]."
    )


class DeviceFeed:
    """Keeps a device open, checks what it says, and hands it on.

    A device that is not there is looked for once a second. The first reading after it was found is one at rest, and
    each axis and button stays at rest until it has been there: what is held while a node starts, or a plug is put in,
    moves nothing. When the device goes or is closed, the last reading is at rest, too.

    Readings that make no sense are counted, and the last good one counts on. Whatever a device raises, nothing but
    what is said at `step` gets out.

    All but `post` belongs to one thread.

    Args:
        name: What the device is called in messages.
        device: The device, not open.
        config: How often, and how much at once.
        publish: Takes the readings.

    Attributes:
        problem: Why the device is not open; None if it is.
        published: Count of readings handed on.
        refused: Count of readings that were not, by reason.
        free_axes: Indices of the axes that have been at rest since the device was opened.
    """

    def __init__(self, name: str, device: Device, config: FeedConfig, publish: Callable[[Reading], None]) -> None:
        self.problem: str | None = "not opened yet"
        self.published = 0
        self.refused: Counter[str] = Counter()
        self._name, self._device, self._config, self._publish = name, device, config, publish
        self._last: Reading | None = None
        self.free_axes: set[int] = set()
        self._free_buttons: set[int] = set()
        self._buttons: tuple[int, ...] = ()
        """As the device has them."""
        self._open_at_s = self._repeat_at_s = -math.inf
        self._is_absent = False
        self._warned_s: dict[str, float] = {}
        self._posted: deque[Callable[[], None]] = deque()
        self._pause = threading.Event()

    def run(self, is_over: Callable[[], bool], period_s: float = 0.02) -> None:
        """Hands readings on until it is over or the person closes the device, and closes it then.

        Args:
            is_over: Asked about once in a period.
            period_s: How long it may take until it is asked again, and what was posted is done [s].

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
        """Opens the device if need be, and waits for one reading.

        Raises:
            DeviceClosedError: If the person has closed the device; there was a last reading.
            MissingDependency: If the device needs a library that is not installed.
        """
        while self._posted:
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
            self._take(reading)
        if self._last is not None and time.monotonic() >= self._repeat_at_s:
            self._hand_on(self._last)

    def post(self, action: Callable[[], None]) -> None:
        """Has the feed's thread do something with the device before its next reading; any thread may call this."""
        self._posted.append(action)

    def close(self) -> None:
        """Closes the device, after a last reading at rest."""
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
            logger.info("%s: it is there now", self._name)
        self.problem, self._is_absent = None, False
        self.free_axes.clear()
        self._free_buttons.clear()
        self._last = None
        self._hand_on(self._resting())

    def _lose(self, reason: str) -> None:
        """Closes a device that has gone."""
        if not self._is_absent:
            logger.warning("%s: %s", self._name, reason)
        self._is_absent = True
        self._leave()
        self.problem = reason
        self._open_at_s = time.monotonic() + REOPENING_PERIOD_S

    def _leave(self) -> None:
        resting = self._resting()
        self._guarded(self._device.close, "close")
        self._hand_on(resting)
        self._last = None

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
        """Returns the next reading, and with it those that follow within the coalescing time."""
        first = self._device.read(timeout_s)
        if first is None or first.buttons != self._buttons:
            return first
        end_s = time.monotonic() + self._config.coalesce_interval
        reading, events, refused = first, [*first.events], [*first.refused]
        for _ in range(MOST_READINGS):
            left_s = end_s - time.monotonic()
            if left_s <= 0.0 or reading.buttons != first.buttons or events or refused:
                break
            newer = self._device.read(left_s)
            if newer is not None:
                reading = newer
                events += newer.events
                refused += newer.refused
        return reading._replace(events=tuple(events), refused=tuple(refused))

    def _take(self, reading: Reading) -> None:
        for reason in reading.refused:
            self._refuse(reason)
        self._buttons = reading.buttons
        problem = problem_of(reading, self._device.axes, self._device.buttons)
        if problem is not None:
            self._refuse(problem)
            return
        reading = self._from_rest(reading)
        if self._last is None or reading.events or reading[:2] != self._last[:2]:
            self._hand_on(reading)

    def _from_rest(self, reading: Reading) -> Reading:
        """Returns a reading in which whatever has not been at rest since the device was opened is."""
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
        return reading._replace(axes=tuple(axes), buttons=tuple(buttons))

    def _hand_on(self, reading: Reading) -> None:
        self._last = reading._replace(events=(), refused=())
        rate = self._config.autorepeat_rate
        self._repeat_at_s = time.monotonic() + (1.0 / rate if rate else math.inf)
        self.published += 1
        self._publish(reading)

    def _refuse(self, reason: str, detail: str = "") -> None:
        self.refused[reason] += 1
        now_s = time.monotonic()
        if now_s - self._warned_s.get(reason, -math.inf) >= WARNING_PERIOD_S:
            self._warned_s[reason] = now_s
            text = f"{reason} ({detail})" if detail else reason
            logger.warning("%s: refused: %s; %d so far", self._name, text, self.refused[reason])

    def _guarded(self, action: Callable[[], None], what: str) -> None:
        try:
            action()
        except Exception as error:
            self._refuse(f"it failed in {what}: {type(error).__name__}", cause_of(error))


def problem_of(reading: Reading, axes: Sequence[str], buttons: Sequence[str]) -> str | None:
    """Returns why a reading makes no sense, None if it does.

    The reasons are few, so that they can be counted.

    Args:
        reading: The reading.
        axes: Names of the device's axes.
        buttons: Names of its buttons.
    """
    if len(reading.axes) != len(axes):
        return f"a reading of another number of axes than the {len(axes)} of the device"
    if len(reading.buttons) != len(buttons):
        return f"a reading of another number of buttons than the {len(buttons)} of the device"
    for name, value in zip(axes, reading.axes):
        if not isinstance(value, Real) or not math.isfinite(value):
            return f"axis '{name}' is not a finite number"
        if not -1.0 <= value <= 1.0:
            return f"axis '{name}' is outside [-1, 1]"
    for name, value in zip(buttons, reading.buttons):
        if value not in (0, 1):
            return f"button '{name}' is neither 0 nor 1"
    return None
