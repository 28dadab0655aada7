"""The simulation loop: serves requests, runs ticks and publishes samples, in step with the wall clock."""

import logging
import math
import threading
import time
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Future

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.sockets import flush_buffered_sockets
from rpbi.config.world import checked_real_time_factor
from rpbi.engine.pacer import Pacer
from rpbi.engine.priority import RealTimePriority
from rpbi.ros.publishers.commands import CommandPublisher
from rpbi.ros.publishers.sample_publishers import SamplePublishers, TickPublisher
from rpbi.ros.publishers.status import StatePublisher, StatusPublisher
from rpbi.world import World
from rpbi.world.saved.state import WorldState

log = logging.getLogger(__name__)

IDLE_PERIOD_S = 0.001
"""Shortest period [s] of the loop while the world is stopped."""
BURST_S = 0.005
"""Longest time [s] that the loop runs due ticks before it sends messages and serves requests."""


class StepRequest:
    """A request to run ticks, and the number of remaining ticks; the caller waits for `done`."""

    def __init__(self, steps: int) -> None:
        self.done: Future[tuple[int, int]] = Future()
        """Tick and stamp [ns] after the last one."""
        self._steps = self.left = steps

    def finish(self, tick: int, stamp_ns: int) -> None:
        """Sets the result of `done`: the number and stamp [ns] of the last tick."""
        if self.done.set_running_or_notify_cancel():
            self.done.set_result((tick, stamp_ns))

    def fail(self, error: Exception) -> None:
        """Sets the exception of `done`."""
        if self.done.set_running_or_notify_cancel():
            self.done.set_exception(error)

    def __str__(self) -> str:
        return f"after {self._steps - self.left} of {self._steps} ticks"


class RestoreRequest:
    """A request to restore a state, and its progress; the caller waits for `done`.

    Args:
        ticks: Iterator that runs the ticks up to the saved state and yields each tick's number, see `World.restoring`.
        end: Number of the last tick.
    """

    def __init__(self, ticks: Generator[int, None, None], end: int) -> None:
        self.done: Future[None] = Future()
        self._ticks, self._end, self._tick = ticks, end, 0

    def advance(self, end_s: float) -> bool:
        """Continues the restoration until it is complete or the monotonic clock reaches `end_s` [s].

        Returns:
            Whether the restoration is complete.
        """
        for tick in self._ticks:
            self._tick = tick
            if time.monotonic() > end_s:
                return False
        return True

    def end(self, error: Exception | None = None) -> None:
        """Ends the restoration, and sets the result or exception of `done`.

        If the restoration is not complete, the world is reset.
        """
        self._ticks.close()
        if self.done.set_running_or_notify_cancel():
            self.done.set_result(None) if error is None else self.done.set_exception(error)

    def __str__(self) -> str:
        return f"at tick {self._tick} of {self._end}"


class Simulation:
    """Runs, stops and steps a world in the simulation thread, the only thread that calls PyBullet.

    Only the simulation thread may call the methods; other threads send requests through the world's mailbox.

    Args:
        helpers: Functions that each pass of the loop calls; they must return at once.
        priority: Changes the scheduling priority of the node's threads; None if the priority is never changed.
    """

    def __init__(
        self,
        world: World,
        publishers: SamplePublishers,
        helpers: Sequence[Callable[[], None]],
        priority: RealTimePriority | None = None,
    ) -> None:
        self.world = world
        self.running = False
        self._failure: str | None = None
        """Error that stopped the world; None again after the next start or step."""
        self._request: StepRequest | None = None
        self._restore: RestoreRequest | None = None
        self._thread: int | None = None
        self.passes = 0
        """Number of passes of the loop; grows as long as the loop is alive."""
        idle_ticks = max(1, round(IDLE_PERIOD_S / world.clock.dt_s))
        self._publishers = TickPublisher(world, publishers, idle_ticks)
        self._helpers = helpers
        self._before_tick = publishers.cameras.before_tick
        self._pacer = Pacer(world.clock.dt_s, world.config.real_time_factor)
        self._idle_pacer = Pacer(max(world.clock.dt_s, IDLE_PERIOD_S))
        cameras = publishers.cameras
        self._status = StatusPublisher(world, self._pacer, cameras.facts, cameras.fault, priority)
        self._state = StatePublisher(world, self._pacer)
        self._commands = CommandPublisher(world)

    @property
    def is_own_thread(self) -> bool:
        """Whether the caller is in the simulation thread."""
        return self._thread == threading.get_ident()

    def start(self) -> bool:
        """Starts the world.

        Returns:
            False if the world runs already.

        Raises:
            InterfaceError: If a request for ticks is still in progress.
        """
        if self.running:
            return False
        self._refuse_while_stepping()
        self.running, self._failure = True, None
        self._pacer.restart()
        self._status.publish(True)
        return True

    def stop(self) -> bool:
        """Stops a running world, aborts a request for ticks, or aborts a restoration.

        All samples of the last tick are published. An aborted restoration resets the world.

        Returns:
            False if the world is stopped already.
        """
        if self._request is not None:
            self._abort_request(InterfaceError(f"stopped {self._request}"))
            return True
        if (restore := self._restore) is not None:
            self._end_restore(InterfaceError(f"stopped {restore}: the world was reset"))
            self.running = False
            self._start_again()
            self._status.publish(False)
            return True
        if not self.running:
            return False
        self._halt()
        return True

    def step(self) -> tuple[int, int]:
        """Advances a stopped world by a tick, and sends all samples of the tick to the subscribers before it returns.

        Returns:
            Number and stamp [ns] of the new tick.

        Raises:
            InterfaceError: If the world runs, or a request for ticks is still in progress.
            PhysicsError: If a number in the world is no longer finite.
        """
        self._refuse_while_moving()
        self._failure = None
        self._status.publish(True)
        self._run_tick(is_last=True)
        self._status.publish(False)
        return self.world.clock.tick, self.world.clock.stamp_ns

    def step_n(self, steps: int) -> Future[tuple[int, int]]:
        """Makes the loop run ticks as fast as possible, and returns at once.

        Between ticks, the loop serves other requests; `stop` aborts the ticks.

        Args:
            steps: Number of ticks.

        Returns:
            A future with the number and stamp [ns] of the last tick. The future is done when all samples of that tick
            have been sent to the subscribers.

        Raises:
            InterfaceError: If the world runs, or another request for ticks is still in progress.
        """
        self._refuse_while_moving()
        request = StepRequest(steps)
        if not steps:
            request.finish(self.world.clock.tick, self.world.clock.stamp_ns)
            return request.done
        self._failure = None
        self._request, self._state.is_stepping = request, True
        self._status.publish(True)
        return request.done

    def reset(self, refill: Callable[[], None] = lambda: None) -> None:
        """Resets the world to its initial state. Stamps continue, and a running world continues to run.

        Args:
            refill: Function, called after the reset, that sends inputs to the world; the default does nothing.

        Raises:
            InterfaceError: If an object can no longer be loaded; the world is then stopped.
        """
        self._interrupt_request()
        try:
            self.world.reset()
        except InterfaceError as error:
            self._break_off(error)
            raise
        refill()
        self._start_again()

    def restore(self, to: WorldState) -> Future[None]:
        """Starts to restore a saved state of this world, and returns at once.

        Each pass of the loop spends a few milliseconds on the restoration. Until the state is reached, samples are not
        published, inputs are dropped, and requests that would change or save the world are refused. `stop` aborts the
        restoration and resets the world.

        Returns:
            A future that is done when the state is reached; the world then runs if it ran before. The future fails with
            an InterfaceError if the state is not reached; the world is then reset and stopped.
        """
        self._interrupt_request()
        restore = self._restore = RestoreRequest(self.world.restoring(to), to.tick)
        self.world.mailbox.hold(lambda: f"the world is being restored, {restore}; rpbi/stop ends that")
        self._advance_restore(restore)
        return restore.done

    def _interrupt_request(self) -> None:
        if self._request is not None:
            request = self._end_request()
            request.fail(InterfaceError(f"the world was reset {request}"))

    def _advance_restore(self, restore: RestoreRequest) -> None:
        try:
            if restore.advance(time.monotonic() + BURST_S):
                self._end_restore()
                self._start_again()
        except Exception as error:
            self._end_restore(error)
            self._break_off(error)

    def _end_restore(self, error: Exception | None = None) -> None:
        restore, self._restore = self._restore, None
        self.world.mailbox.hold(None)
        if restore is not None:
            restore.end(error)

    def _start_again(self) -> None:
        """After a reset or restoration, applies waiting inputs to the world and publishes the world's state."""
        self._failure = None
        self.world.apply_inputs()
        self._pacer.restart()
        self._publishers.restart()
        self._state.restart()

    @property
    def real_time_factor(self) -> float:
        """Requested simulated seconds per second of wall time; 0 is as fast as possible."""
        return self._pacer.real_time_factor

    def set_real_time_factor(self, factor: float) -> None:
        """Changes the requested real-time factor.

        Raises:
            ValueError: If the factor is invalid, see `checked_real_time_factor`.
        """
        try:
            self._pacer.set_factor(checked_real_time_factor(factor))
        except ValueError as error:
            raise ValueError(f"real_time_factor: {error}") from None
        self._publishers.set_factor(factor)

    def run(self, is_over: Callable[[], bool]) -> None:
        """Runs the loop in the calling thread until `is_over` returns True."""
        self._thread = threading.get_ident()
        parts = (self._move, flush_buffered_sockets, *self._helpers, self._publish)
        while not is_over():
            self.passes += 1
            self.world.mailbox.run_requests()
            for part in parts:
                try:
                    part()
                except Exception as error:
                    if not self.world.is_connected:  # the loop ends with this error
                        break
                    self._break_off(error)
            if self._request is None and self._restore is None:
                (self._pacer if self.running else self._idle_pacer).wait()

    def _move(self) -> None:
        if self._restore is not None:
            self._advance_restore(self._restore)
        elif self._request is not None:
            self._advance_request(self._request)
        elif not self.running:
            self._idle()
        else:
            self._run_due_ticks()

    def _publish(self) -> None:
        busy = "" if self._restore is None else f"restoring, {self._restore}"
        self._status.spin(self.running and not busy, self._request is not None, busy)
        self._commands.spin()
        self._state.spin(self.running and not busy or self._request is not None)
        flush_buffered_sockets()

    def _run_due_ticks(self) -> None:
        end_s = time.monotonic() + BURST_S
        while self._pacer.is_due():
            self._run_tick()
            if self._pacer.is_free:
                self._pacer.count(self._run_idle(math.inf, end_s))
            if time.monotonic() > end_s:
                break
        self._publishers.publish_time()

    def _run_idle(self, ticks: float, end_s: float) -> int:
        """Advances by ticks that do not publish anything, and returns their number.

        Args:
            ticks: Maximum number of ticks.
            end_s: Latest end [s], as a time of the monotonic clock.
        """
        return self.world.run_idle(min(ticks, self._state.ticks_to_hash - 1), end_s)

    def _run_tick(self, is_last: bool = False) -> None:
        """Advances by a tick and publishes the samples that are due.

        Args:
            is_last: Whether the world stops after this tick; if so, all samples are published, due or not.
        """
        self._before_tick()
        publish = self._publishers.publish_all if is_last else self._publishers.publish_tick
        publish(self.world.step())
        if self._state.is_hash_due:  # after the commands that it depends on: a recording may end between the two
            self._commands.catch_up()
            flush_buffered_sockets()
            self._state.publish_hash()
        if is_last:
            flush_buffered_sockets()  # before the caller of the tick gets an answer

    def _advance_request(self, request: StepRequest) -> None:
        end_s = time.monotonic() + BURST_S
        while request.left > 1 and time.monotonic() < end_s:
            self._run_tick()
            request.left -= 1
            request.left -= self._run_idle(request.left - 1, end_s)
        self._publishers.publish_time()
        if request.left == 1:
            self._run_tick(is_last=True)
            request.left = 0
            self._end_request()
            self._status.publish(False)
            request.finish(self.world.clock.tick, self.world.clock.stamp_ns)

    def _end_request(self) -> StepRequest:
        assert self._request is not None
        request, self._request, self._state.is_stepping = self._request, None, False
        return request

    def _abort_request(self, error: Exception) -> None:
        """Ends the running request for ticks early, and publishes all samples of its last tick."""
        request = self._end_request()
        self._halt()
        request.fail(error)

    def _refuse_while_moving(self) -> None:
        if self.running:
            raise InterfaceError("the simulation is running: stop it before stepping")
        self._refuse_while_stepping()

    def _refuse_while_stepping(self) -> None:
        if self._request is not None:
            raise InterfaceError("the simulation is stepping: wait for that, or stop it")

    def _break_off(self, error: Exception) -> None:
        """Stops the world after an error; samples are not published until the next start or step."""
        if str(error) == self._failure:
            return  # this error was reported before
        log.error("simulation stopped: %s", error, exc_info=not isinstance(error, InterfaceError))
        self.running, self._failure = False, str(error)
        if self._request is not None:
            self._end_request().fail(error)
        self.world.halt("the simulation was aborted")
        self._publishers.publish_last_time()
        self._status.publish(False)

    def _halt(self) -> None:
        self.running = False
        self.world.pause("the simulation was stopped")
        self._publishers.publish_all([])
        self._status.publish(False)

    def _idle(self) -> None:
        if not self._idle_pacer.is_due():
            return
        self._publishers.repeat_time()
        if self._failure is None:
            self.world.apply_inputs()
            self._publishers.publish_idle()
