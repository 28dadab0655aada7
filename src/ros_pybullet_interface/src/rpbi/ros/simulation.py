"""The simulation loop: requests, ticks, samples out, in step with the wall clock."""

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
"""Shortest time between two checks for requests while stopped [s]."""
BURST_S = 0.005
"""Longest run of due ticks before the loop sends messages and looks at requests [s]."""


class StepRequest:
    """A request for ticks, and the number left; the caller waits for `done`."""

    def __init__(self, steps: int) -> None:
        self.done: Future[tuple[int, int]] = Future()
        """Tick and stamp [ns] after the last one."""
        self._steps = self.left = steps

    def finish(self, tick: int, stamp_ns: int) -> None:
        """Ends the wait with success."""
        if self.done.set_running_or_notify_cancel():
            self.done.set_result((tick, stamp_ns))

    def fail(self, error: Exception) -> None:
        """Ends the wait with an error."""
        if self.done.set_running_or_notify_cancel():
            self.done.set_exception(error)

    def __str__(self) -> str:
        return f"after {self._steps - self.left} of {self._steps} ticks"


class RestoreRequest:
    """A request to restore a state, and its progress; the caller waits for `done`.

    Args:
        ticks: Runs the ticks up to the state and yields each, see `World.restoring`.
        end: The last of them.
    """

    def __init__(self, ticks: Generator[int, None, None], end: int) -> None:
        self.done: Future[None] = Future()
        self._ticks, self._end, self._tick = ticks, end, 0

    def advance(self, end_s: float) -> bool:
        """Continues until a time of the monotonic clock [s]; returns whether it is done."""
        for tick in self._ticks:
            self._tick = tick
            if time.monotonic() > end_s:
                return False
        return True

    def end(self, error: Exception | None = None) -> None:
        """Ends the restoration and the wait for it; if it is not complete, the world is reset."""
        self._ticks.close()
        if self.done.set_running_or_notify_cancel():
            self.done.set_result(None) if error is None else self.done.set_exception(error)

    def __str__(self) -> str:
        return f"at tick {self._tick} of {self._end}"


class Simulation:
    """Runs, stops and steps a world on the one thread that owns PyBullet.

    All methods are for that thread; others reach it through the world's mailbox. Helpers are called at every pass and
    must return at once.
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
        """Error that stopped it, until the next start or step."""
        self._request: StepRequest | None = None
        self._restore: RestoreRequest | None = None
        self._thread: int | None = None
        self.passes = 0
        """Number of passes of the loop; grows as long as it is alive."""
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
        """Whether the caller is on the thread that runs the loop."""
        return self._thread == threading.get_ident()

    def start(self) -> bool:
        """Starts the world.

        Returns:
            False if it runs already.

        Raises:
            InterfaceError: If it is running the ticks of a request.
        """
        if self.running:
            return False
        self._refuse_while_stepping()
        self.running, self._failure = True, None
        self._pacer.restart()
        self._status.publish(True)
        return True

    def stop(self) -> bool:
        """Stops the world, with its last tick published completely.

        Returns:
            False if it is stopped already.
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
        """Advances by a tick; when it returns, everything of that tick has been passed to every subscriber.

        Returns:
            The new tick and its stamp [ns].

        Raises:
            InterfaceError: If the world runs, or the ticks of another request.
            PhysicsError: If something in the world is not finite any more.
        """
        self._refuse_while_moving()
        self._failure = None
        self._status.publish(True)
        self._run_tick(is_last=True)
        self._status.publish(False)
        return self.world.clock.tick, self.world.clock.stamp_ns

    def step_n(self, steps: int) -> Future[tuple[int, int]]:
        """Advances by ticks as fast as possible; other requests are served meanwhile, a stop ends it.

        Returns:
            The last tick and its stamp [ns], once everything of it has been passed to every subscriber.

        Raises:
            InterfaceError: If the world runs, or the ticks of another request.
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
        """Resets the world to its state when built; it stays running or stopped, and its time continues.

        Args:
            refill: Puts the inputs of the new start.

        Raises:
            InterfaceError: If something cannot be loaded any more; then it is stopped.
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
        """Restores a saved state of this world, a few milliseconds in each pass of the loop.

        Meanwhile nothing is published of the world, inputs are dropped, and requests that would change or save it are
        refused. A stop ends it and resets the world.

        Returns:
            A future that is done when the world continues, running or stopped, from that state. It fails with an
            InterfaceError if the state is not reached; then the world was reset and is stopped.
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
        """Publishes the restarted world, and sends it its inputs."""
        self._failure = None
        self.world.apply_inputs()
        self._pacer.restart()
        self._publishers.restart()
        self._state.restart()

    @property
    def real_time_factor(self) -> float:
        """Requested simulated seconds per second; 0 is as fast as possible."""
        return self._pacer.real_time_factor

    def set_real_time_factor(self, factor: float) -> None:
        """Changes how fast the world is to run, from now on.

        Raises:
            ValueError: If it is not valid, see `checked_real_time_factor`.
        """
        try:
            self._pacer.set_factor(checked_real_time_factor(factor))
        except ValueError as error:
            raise ValueError(f"real_time_factor: {error}") from None
        self._publishers.set_factor(factor)

    def run(self, is_over: Callable[[], bool]) -> None:
        """Loops until it is over, on the thread that calls it."""
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
        """Advances by ticks of which nothing is published, until a time [s]; returns their number."""
        return self.world.run_idle(min(ticks, self._state.ticks_to_hash - 1), end_s)

    def _run_tick(self, is_last: bool = False) -> None:
        """Advances by a tick; of the last one before a stop everything is published, due or not."""
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
        """Ends the ticks of a request early, with all of the last one published."""
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
        """Stops, and publishes nothing of a broken world until it is started or stepped again."""
        if str(error) == self._failure:
            return  # repeats the same error
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
