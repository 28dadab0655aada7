"""Publishes the state of the simulation on /clock, `rpbi/status`, `rpbi/state` and /diagnostics."""

import logging
import math
import time
from collections.abc import Callable, Mapping
from typing import Any

import rosgraph
import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rosgraph_msgs.msg import Clock as ClockMessage
from std_msgs.msg import Int64

from custom_ros_tools.ros.lifecycle.wall_time import WallRate
from ros_pybullet_interface.msg import SimulationState
from rpbi.engine.clock import Schedule
from rpbi.engine.pacer import Load, Pacer
from rpbi.engine.priority import RealTimePriority
from rpbi.ros.endpoints import Topic
from rpbi.ros.headers import to_ros_time
from rpbi.ros.state_topic import FastTopic
from rpbi.world import World

log = logging.getLogger(__name__)

CLOCK = Topic(
    "/clock", ClockMessage, meaning="The world's time, if `/use_sim_time` is true; every tick, or `clock_hz`."
)
STATUS = Topic(
    "rpbi/status", Int64, meaning="1 while the world runs, 0 while it is stopped; `status_hz`.", key="status_hz"
)
DIAGNOSTICS = Topic("/diagnostics", DiagnosticArray, meaning="Real-time factor, overruns, lost time, renderer; 1 Hz.")

STATE = Topic(
    "rpbi/state",
    SimulationState,
    meaning="Tick, time, real-time factor and hash of the state; `state_hz`, `state_hash_hz`.",
    key="state_hz",
)
WINDOW_S = 1.0
"""Shortest period over which the real-time factor is measured [s] of wall time."""
STOPPED_CLOCK_PERIOD_S = 0.05
MAX_CLOCK_HZ = 1000.0
FREE_RUNNING_CLOCK_HZ = 250.0
FALLING_BEHIND = 0.98
"""Share of the requested real-time factor; if the measured factor is below it, the diagnostics warn."""
SLOW_PERIODS = 3
"""Number of consecutive diagnostics of a slow world after which a warning names the cause; a start may be slow."""
WINDOW_ADVICE = "without a graphics card use RViz and connection_mode DIRECT"
SLOW_CALL_S = 0.0005
"""Duration of a PyBullet call above which the window is reported to slow the world down [s]; without a window, a call
takes 10 µs."""


def _warn_of_rivals() -> None:
    """Logs a warning if another node publishes /clock too, since ROS time would jump between both nodes' times."""
    published: list[tuple[str, list[str]]] = rosgraph.Master(rospy.get_name()).getSystemState()[0]
    rivals = [node for topic, nodes in published if topic == CLOCK.name for node in nodes if node != rospy.get_name()]
    if rivals:
        log.warning("/clock is published by %s too: another node already publishes /clock", ", ".join(rivals))


def clock_message(stamp_ns: int) -> ClockMessage:
    """Returns a /clock message with the time `stamp_ns` [ns]."""
    return ClockMessage(to_ros_time(stamp_ns))


def state_message(world: World, with_hash: bool, **pace: Any) -> SimulationState:
    """Returns a message with the state of a world.

    Args:
        world: The world.
        with_hash: Whether to compute the hash of the state; otherwise the message's `state_hash` is empty.
        pace: Further fields of the message that describe the simulation loop, such as `running`.
    """
    message = SimulationState(
        tick=world.clock.tick,
        simulated_time=world.clock.time_s,
        resets=world.resets,
        commands=world.commands.count,
        state_hash=world.state_hash() if with_hash else "",
        **pace,
    )
    message.header.stamp = to_ros_time(world.clock.stamp_ns)
    return message


class ClockPublisher:
    """Publishes simulated time on /clock; warns if another node publishes /clock too."""

    def __init__(self, world: World) -> None:
        self._clock, self._most_hz = world.clock, world.config.clock_hz
        _warn_of_rivals()
        self._publisher = FastTopic(CLOCK.name, ClockMessage)
        self._sent_ns = 0
        self.set_factor(world.config.real_time_factor)

    def set_factor(self, real_time_factor: float) -> None:
        """Sets the rate of /clock for a real-time factor (0 is as fast as possible), limited by `clock_hz`."""
        limit_hz = min(real_time_factor / self._clock.dt_s, MAX_CLOCK_HZ) if real_time_factor else FREE_RUNNING_CLOCK_HZ
        self._period_s = 1.0 / min(self._most_hz or limit_hz, limit_hz)
        self._due_s = 0.0

    def publish_tick(self) -> None:
        """Publishes the time of the present tick, if the tick is new and a message is due."""
        now_s = time.monotonic()
        if now_s >= self._due_s and self._clock.stamp_ns != self._sent_ns:
            # The next deadline follows from the last one, which keeps the mean rate, but pauses are not caught up.
            self._due_s = max(self._due_s + self._period_s, now_s - self._period_s)
            self._send()

    def publish_now(self) -> None:
        """Publishes the time of the present tick regardless of the rate, for instance when the world stops."""
        self._due_s = time.monotonic() + STOPPED_CLOCK_PERIOD_S
        self._send()

    def repeat(self) -> None:
        """Publishes a stopped world's time every STOPPED_CLOCK_PERIOD_S, so that later subscribers receive it too."""
        if time.monotonic() >= self._due_s or self._clock.stamp_ns != self._sent_ns:
            self.publish_now()

    def _send(self) -> None:
        self._sent_ns = self._clock.stamp_ns
        if self._publisher.has_subscribers:
            self._publisher.publish(clock_message(self._sent_ns))


class StatusPublisher:
    """Publishes the world's status (running or stopped) on `rpbi/status`, and diagnostics on /diagnostics.

    Args:
        world: The world.
        pacer: Times the ticks of the world.
        facts: Returns further values for the diagnostics.
        fault: Returns why the camera renderer does not answer, for a warning in the diagnostics; otherwise empty.
        priority: Adapts the scheduling priority of the node's threads to the load; None if it is never changed.
    """

    def __init__(
        self,
        world: World,
        pacer: Pacer,
        facts: Callable[[], Mapping[str, str]],
        fault: Callable[[], str],
        priority: RealTimePriority | None,
    ) -> None:
        self._world, self._clock, self._pacer, self._facts, self._fault = world, world.clock, pacer, facts, fault
        self._priority = priority
        self._load = Load.now(world.physics_s, world.clock.tick)
        """Load at the last message of the diagnostics."""
        self._slow_periods = 0
        self._advice: set[str] = set()
        """Advice logged so far for slow worlds."""
        self._rate = WallRate(world.config.status_hz)
        self._diagnostics_rate = WallRate(1.0, delay_s=1.0)
        self._status = rospy.Publisher(STATUS.name, Int64, queue_size=10)
        self._diagnostics = rospy.Publisher(DIAGNOSTICS.name, DiagnosticArray, queue_size=10)
        self._overruns = 0

    def spin(self, running: bool, stepping: bool = False, busy: str = "") -> None:
        """Publishes the status and the diagnostics, each if a message is due by the wall clock.

        Args:
            running: Whether the world runs.
            stepping: Whether the world advances by a number of ticks that a client requested.
            busy: Message for the diagnostics while a state is being restored, otherwise empty.
        """
        if self._rate.is_due():
            self.publish(running or stepping)
        if self._diagnostics_rate.is_due():
            self._publish_diagnostics(running, stepping, busy)

    def publish(self, running: bool) -> None:
        """Publishes the status: 1 if the world runs, 0 if it is stopped."""
        self._status.publish(Int64(int(running)))

    def _publish_diagnostics(self, running: bool, stepping: bool, busy: str) -> None:
        factor = self._pacer.measure()
        overruns = self._pacer.overruns - self._overruns
        self._overruns = self._pacer.overruns
        status = DiagnosticStatus(name=f"{rospy.get_name()}: simulation", hardware_id="rpbi", level=DiagnosticStatus.OK)
        status.message = busy or ("running" if running else "stepping" if stepping else "stopped")
        asked = self._pacer.real_time_factor
        if running and factor < FALLING_BEHIND * asked:
            status.level = DiagnosticStatus.WARN
            status.message = f"too slow: real-time factor {factor:.3f} instead of {asked:g}"
            self._slow_periods += 1
        else:
            self._slow_periods = 0
        before, self._load = self._load, Load.now(self._world.physics_s, self._clock.tick)
        load = self._load.since(before)
        if self._priority is not None:
            self._priority.review(load, self._pacer.period_s)
        self._warn_of_cause(status.message, load)
        if fault := self._fault():
            status.level, status.message = DiagnosticStatus.WARN, f"{status.message}; {fault}"
        values = {
            "real_time_factor": f"{factor if running else 0.0:.4f}",
            "overruns_total": str(self._pacer.overruns),
            "overruns_in_last_period": str(overruns),
            "lost_s_total": f"{self._pacer.lost_s:.3f}",
            "tick": str(self._clock.tick),
            "time_s": f"{self._clock.time_s:.6f}",
            "real_time_priority": str(self._priority is not None and self._priority.acts),
            **self._facts(),
        }
        status.values = [KeyValue(key, value) for key, value in values.items()]
        message = DiagnosticArray(status=[status])
        message.header.stamp = to_ros_time(self._clock.stamp_ns)
        self._diagnostics.publish(message)

    def _warn_of_cause(self, message: str, load: Load) -> None:
        """If the world was too slow in the last SLOW_PERIODS diagnostics, logs the cause, but only once per cause."""
        if self._slow_periods < SLOW_PERIODS or WINDOW_ADVICE in self._advice:
            return
        reason, window = load.reason(self._clock.dt_s), self._world.window
        if window is not None and (call_s := window.seconds_per_call()) > SLOW_CALL_S:
            reason = f"with its window, PyBullet takes {1e3 * call_s:.1f} ms a call; {WINDOW_ADVICE}"
        advice = reason.rpartition("; ")[2]
        if advice not in self._advice:
            self._advice.add(advice)
            log.warning("%s: %s (docs/slow.md)", message, reason)


class StatePublisher:
    """Publishes the state of the simulation on `rpbi/state`.

    Messages without a hash of the state are sent at a rate in wall time. Messages with a hash are sent at a rate in the
    world's time.
    """

    def __init__(self, world: World, pacer: Pacer) -> None:
        self._world, self._pacer = world, pacer
        config = world.config
        self._rate = WallRate(config.state_hz)
        self._schedule = Schedule(config.state_hash_hz, world.clock.dt_ns) if config.state_hash_hz else None
        self._topic = FastTopic(STATE.name, SimulationState)
        self._factor = self._window_s = 0.0
        self._window_tick = 0
        self._moves = False
        self.is_stepping = False
        """Whether the ticks are those of a request."""
        self.restart()

    def restart(self) -> None:
        """Publishes the state of a world that was just built or reset; includes the hash, if hashes are configured."""
        tick = self._world.clock.tick
        self._hash_tick = None if self._schedule is None else self._schedule.next_due(tick)
        self._begin_window()
        self._publish(self._schedule is not None)

    @property
    def is_hash_due(self) -> bool:
        """Whether the hash of the present tick is due."""
        return self._hash_tick is not None and self._world.clock.tick >= self._hash_tick

    @property
    def ticks_to_hash(self) -> float:
        """Number of ticks until the next hash is due; inf if hashes are not configured."""
        return math.inf if self._hash_tick is None else self._hash_tick - self._world.clock.tick

    def publish_hash(self) -> None:
        """Publishes the state of the present tick, including the hash."""
        if self._schedule is not None:
            self._hash_tick = self._schedule.next_due(self._world.clock.tick)
        self._publish(with_hash=True)

    def spin(self, moves: bool) -> None:
        """Publishes the state if a message is due by the wall clock, and measures the real-time factor.

        Args:
            moves: True if the world runs or is executing ticks that a client requested, False if it is stopped.
        """
        now_s = time.monotonic()
        if moves != self._moves:
            self._moves = moves
            self._begin_window()
        elif moves and now_s - self._window_s >= WINDOW_S:
            ticks = self._world.clock.tick - self._window_tick
            self._factor = ticks * self._world.clock.dt_s / (now_s - self._window_s)
            self._window_s, self._window_tick = now_s, self._world.clock.tick
        if self._rate.is_due():
            self._publish()

    def _begin_window(self) -> None:
        """Starts to measure the real-time factor, which is 0 until the first measurement."""
        self._factor = 0.0
        self._window_s, self._window_tick = time.monotonic(), self._world.clock.tick

    def _publish(self, with_hash: bool = False) -> None:
        if not self._topic.has_subscribers:
            return
        message = state_message(
            self._world,
            with_hash,
            running=self._moves and not self.is_stepping,
            stepping=self.is_stepping,
            real_time_factor_asked=self._pacer.real_time_factor,
            real_time_factor=self._factor,
            overruns=self._pacer.overruns,
            lost_time=self._pacer.lost_s,
        )
        self._topic.publish(message)
