"""The schedule of all sensors of a world: at which ticks each sensor is read."""

import heapq
import logging
import math
from collections.abc import Iterator, Sequence
from typing import Any

from rpbi.engine.clock import Clock, Schedule
from rpbi.plugins import check_sample, is_foreign, raise_plugin_error
from rpbi.sensors.sensor import Sensor

log = logging.getLogger(__name__)


class _Scheduled:
    """A sensor and the ticks at which it is due."""

    def __init__(self, sensor: Sensor, dt_ns: int, tick: int, order: int) -> None:
        self.sensor = sensor
        self._is_foreign = is_foreign(sensor)
        self.order = order
        self.read_tick = -1
        """Tick of the last sample; -1 before the first sample."""
        self.schedule_from(tick, dt_ns)

    def schedule_from(self, tick: int, dt_ns: int) -> None:
        """Computes the first tick after `tick` at which the sensor is due; does nothing if its rate is 0."""
        if self.sensor.hz:
            self.schedule = Schedule(self.sensor.hz, dt_ns)
            self.next_tick = self.schedule.next_due(tick)

    def read(self, tick: int) -> Any:
        try:
            sample = self.sensor.read(tick)
            if sample is None:
                return None
            if self._is_foreign:
                check_sample(sample, self.sensor.sample_type, self.sensor.name)
        except Exception as error:
            raise_plugin_error(self.sensor, f"read of '{self.sensor.name}' at tick {tick}", error)
            raise
        self.read_tick = tick
        return sample


class SensorSchedule:
    """Reads each sensor of a world when it is due."""

    not_in_keyframes = ("_warned",)

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._scheduled: dict[str, list[_Scheduled]] = {}
        self.watching: list[Sensor] = []
        """Sensors that have a `before_step` or `after_step` to be called at every tick."""
        self._queue: list[tuple[int, int, _Scheduled]] = []
        """Heap with an entry for each sensor: its next due tick, its number in the order of adding, and the sensor."""
        self._count = 0
        self._warned: set[tuple[str, float]] = set()
        """Sensor names and rates of all warnings so far, so that a reset does not repeat a warning."""

    def __contains__(self, name: str) -> bool:
        """Returns whether a body or camera with this name was added, even if it has no sensors."""
        return name in self._scheduled

    def __getitem__(self, name: str) -> list[Sensor]:
        """Returns the sensors of a body; for the name of a camera, returns a list with the camera."""
        return [each.sensor for each in self._scheduled[name]]

    def add(self, name: str, sensors: Sequence[Sensor]) -> None:
        """Adds a camera, or the sensors of a body; `name` is the camera's or body's name."""
        dt_ns, tick = self._clock.dt_ns, self._clock.tick
        self._scheduled[name] = [_Scheduled(one, dt_ns, tick, order) for order, one in enumerate(sensors, self._count)]
        self._count += len(sensors)
        for each in self._scheduled[name]:
            self._warn_if_clamped(each)
        self._rebuild()

    def set_rate(self, name: str, number: int, hz: float) -> None:
        """Changes the rate [Hz] of a sensor from the present tick on, see `World.set_sensor_rate`."""
        scheduled = self._scheduled[name]
        if not 0 <= number < len(scheduled):
            raise ValueError(f"'{name}' has {len(scheduled)} sensors, got number {number}")
        if not 0.0 <= hz < math.inf:
            raise ValueError(f"hz: must be finite and >= 0 [Hz], got {hz:g}")
        each = scheduled[number]
        each.sensor.hz = hz
        each.schedule_from(self._clock.tick, self._clock.dt_ns)
        self._warn_if_clamped(each)
        self._rebuild()

    def remove(self, name: str) -> None:
        """Removes a camera, or the sensors of a body; `name` is the camera's or body's name."""
        del self._scheduled[name]
        self._rebuild()

    @property
    def keep_state(self) -> bool:
        """Whether at least one sensor has internal state, see `Sensor.keeps_state`."""
        return any(each.sensor.keeps_state for each in self._all())

    def restart(self) -> None:
        """Forgets the ticks of all samples, and schedules all sensors from the present tick on."""
        for each in self._all():
            each.read_tick = -1
        self.reschedule()

    def reschedule(self) -> None:
        """Schedules all sensors from the present tick on, according to their present rates.

        Raises:
            ValueError: If the rate of a sensor is negative or not finite, for instance because a file contained it.
        """
        for each in self._all():
            if not 0.0 <= each.sensor.hz < math.inf:
                raise ValueError(f"'{each.sensor.name}': expected a finite rate of at least 0 Hz, got {each.sensor.hz}")
            each.schedule_from(self._clock.tick, self._clock.dt_ns)
        self._rebuild()

    def clear(self) -> None:
        """Removes all sensors."""
        self._scheduled.clear()
        self._rebuild()

    def _warn_if_clamped(self, scheduled: _Scheduled) -> None:
        sensor = scheduled.sensor
        if sensor.hz and scheduled.schedule.clamped and (sensor.name, sensor.hz) not in self._warned:
            self._warned.add((sensor.name, sensor.hz))
            log.warning("%s: %s Hz is more than a sample a tick; it gets one a tick", sensor.name, sensor.hz)

    def act(self, method: str) -> None:
        """Calls `method` (`before_step` or `after_step`) of all sensors that override at least one of these methods."""
        for sensor in self.watching:
            try:
                getattr(sensor, method)(self._clock.tick)
            except Exception as error:
                raise_plugin_error(sensor, f"{method} of '{sensor.name}' at tick {self._clock.tick}", error)
                raise

    @property
    def idle_ticks(self) -> float:
        """Number of ticks that may pass before a sensor has to be called or read; inf if no sensor ever has to be."""
        if self.watching:
            return 0.0
        return self._queue[0][0] - self._clock.tick - 1 if self._queue else math.inf

    def read_due(self) -> list[Any]:
        """Reads the sensors that are due at the present tick, and returns their samples."""
        tick = self._clock.tick
        queue = self._queue
        if not queue or queue[0][0] > tick:
            return []
        samples: list[Any] = []
        while queue and queue[0][0] <= tick:
            _, order, each = queue[0]
            each.next_tick = each.schedule.next_due(tick)
            heapq.heapreplace(queue, (each.next_tick, order, each))
            if each.sensor.wanted:
                samples.append(each.read(tick))
        return _present(samples)

    def read_rest(self) -> list[Any]:
        """Reads sensors that have not been read at the present tick, see `World.read_rest`; returns the samples."""
        tick = self._clock.tick
        return _present(each.read(tick) for each in self._rated() if each.read_tick != tick)

    def read_idle(self, tick: int, since: int) -> list[Any]:
        """Reads sensors of a stopped world as if the world were running, see `World.read_idle`; returns the samples."""
        now = self._clock.tick
        return _present(each.read(now) for each in self._rated() if each.schedule.is_due(tick, since))

    def _rebuild(self) -> None:
        self._queue = [(each.next_tick, each.order, each) for each in self._all() if each.sensor.hz]
        heapq.heapify(self._queue)
        self.watching = [each.sensor for each in self._all() if _acts_at_ticks(type(each.sensor))]

    def _all(self) -> Iterator[_Scheduled]:
        for scheduled in self._scheduled.values():
            yield from scheduled

    def _rated(self) -> Iterator[_Scheduled]:
        """Returns an iterator over the sensors whose rate is not 0 and whose samples have a receiver."""
        return (each for each in self._all() if each.sensor.hz and each.sensor.wanted)


def _acts_at_ticks(sensor_type: type[Sensor]) -> bool:
    """Returns True if a sensor class overrides at least one of `before_step` and `after_step`."""
    return sensor_type.before_step is not Sensor.before_step or sensor_type.after_step is not Sensor.after_step


def _present(samples: Any) -> list[Any]:
    """Returns the samples that are not None."""
    return [sample for sample in samples if sample is not None]
