"""A vector environment of Gymnasium whose environments run in worker processes."""

from __future__ import annotations

import os
import pickle
import signal
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from multiprocessing.connection import Connection, Pipe
from multiprocessing.reduction import send_handle
from typing import Any

import cloudpickle
import numpy as np
import numpy.typing as npt
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space, iterate

from custom_ros_tools.child_process import python_module, start_child
from custom_ros_tools.errors import InterfaceError

from .checks import check_action
from .env import WorldEnv, require_arguments
from .shared_arrays import SharedArrays

ENVIRONMENT = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
"""Variables of workers, so that their libraries start no threads, which would contend for the processors."""
Info = dict[str, Any]
Result = tuple[Any, npt.NDArray[np.float64], npt.NDArray[np.bool_], npt.NDArray[np.bool_], Info]


class WorldVectorEnv(VectorEnv[Any, Any, Any]):
    """A vector of n environments in worker processes; each process has one or more environments.

    For a step, each process gets a single request. Observations are transferred in shared memory. Processes are not
    forked but started as new programs. Therefore scripts do not need `if __name__ == "__main__"`, and the calling
    process may have threads.

    Args:
        makers: Functions without arguments, each of which makes one environment. Lambdas are allowed.
        workers: Number of processes, by default the number of processors; reduced to the number of environments.
        autoreset_mode: Decides when an environment is reset after the end of its episode, see docs/gym.md.

    Attributes:
        workers: Number of processes.

    Raises:
        InterfaceError: If the environments' spaces differ, or an observation space contains other spaces than boxes
            and dictionaries.
        ValueError: If `makers` is empty, or `workers` is not positive.
    """

    def __init__(
        self,
        makers: Sequence[Callable[[], Any]],
        workers: int | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
    ) -> None:
        if not makers or (workers is not None and workers < 1):
            raise ValueError(f"expected an environment and a worker at least, got {len(makers)} and {workers}")
        self.num_envs = len(makers)
        self.workers = min(workers or os.cpu_count() or 1, self.num_envs)
        self._mode = AutoresetMode(autoreset_mode)
        self._shared: SharedArrays | None = None
        self._parts = [slice(*ends) for ends in _parts(self.num_envs, self.workers)]
        self._processes = [_Process(index) for index in range(self.workers)]
        processors = sorted(os.sched_getaffinity(0))
        if self.workers == len(processors):  # otherwise Linux may run two workers on one processor while another idles
            for process, processor in zip(self._processes, processors):
                process.stay_on(processor)
        try:
            self._ask_all("make", [(list(makers[part]), part.start, self._mode) for part in self._parts])
            self._set_spaces(self._ask_all("spaces"))
            self._share()
        except BaseException:
            self.close_extras()
            raise

    def reset(self, *, seed: int | Sequence[int | None] | None = None, options: Info | None = None) -> tuple[Any, Info]:
        """Starts episodes in all environments, or in the environments that a mask selects.

        Args:
            seed: A seed for each environment; or a number, to which the index of each environment is added.
            options: `reset_mask`, bool, shape (n,), selects the environments to reset. All other options are passed to
                the environments.

        Returns:
            Observations of all environments, and information from the environments that were reset.

        Raises:
            ValueError: If there are more or fewer seeds than environments, or the mask is not an array of n bools with
                at least one true.
        """
        seeds = [seed + i for i in range(self.num_envs)] if isinstance(seed, (int, np.integer)) else seed
        seeds = [None] * self.num_envs if seeds is None else list(seeds)
        if len(seeds) != self.num_envs:
            raise ValueError(f"expected {self.num_envs} seeds, got {len(seeds)}")
        rest = dict(options or {})
        mask = self._mask(rest.pop("reset_mask", None))
        given = rest if options is not None else None
        answers = self._ask_all("reset", [(seeds[part], mask[part].tolist(), given) for part in self._parts])
        infos: Info = {}
        for index, info in enumerate(each for answer in answers for each in answer):
            if info is not None:
                infos = self._add_info(infos, info, index)
        assert self._shared is not None
        return self._shared.read(), infos

    def step(self, actions: Any) -> Result:
        """Takes a step in all environments.

        Args:
            actions: One action for each of the n environments, shape (n, ...).

        Returns:
            Observations, rewards, terminations, truncations, and information.

        Raises:
            ValueError: If there are more or fewer actions than environments, or an action does not fit its space. The
                environments are then unchanged. Also if an episode has ended and autoreset is disabled.
            PluginError: If a task from another package fails.
            InterfaceError: If a worker process has ended.
        """
        each = actions if isinstance(actions, np.ndarray) else list(iterate(self.action_space, actions))
        if len(each) != self.num_envs:
            raise ValueError(f"expected {self.num_envs} actions, got {len(each)}")
        for index, action in enumerate(each):
            check_action(self.single_action_space, action, f"actions[{index}]")
        answers = self._ask_all("step", [(each[part],) for part in self._parts])
        infos: Info = {}
        for index, (info, final) in enumerate(one for answer in answers for one in answer):
            if final is not None:
                infos = self._add_info(infos, final, index)
            infos = self._add_info(infos, info, index)
        shared = self._shared
        assert shared is not None
        ends = shared.terminations.copy(), shared.truncations.copy()
        return shared.read(), shared.rewards.copy(), *ends, infos

    def render(self) -> tuple[Any, ...]:
        """Returns an image of each environment."""
        return self.call("render")

    def call(self, name: str, *arguments: Any, **options: Any) -> tuple[Any, ...]:
        """Returns the named attribute of each environment. If the attribute is callable, returns its result instead."""
        answers = self._ask_all("call", [(name, arguments, options)] * self.workers)
        return tuple(each for answer in answers for each in answer)

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """Returns an attribute of each environment."""
        return self.call(name)

    def set_attr(self, name: str, values: Any) -> None:
        """Sets an attribute; `values` is a list or tuple with a value for each environment, or one value for all."""
        each = list(values) if isinstance(values, (list, tuple)) else [values] * self.num_envs
        if len(each) != self.num_envs:
            raise ValueError(f"expected {self.num_envs} values, got {len(each)}")
        self._ask_all("set", [(name, each[part]) for part in self._parts])

    def close_extras(self, **_: Any) -> None:
        """Ends the worker processes and closes the shared memory."""
        for process in self._processes:
            process.close()
        if self._shared is not None:
            self._shared.close()
            self._shared = None

    def _set_spaces(self, answers: Sequence[Any]) -> None:
        spaces = [each for answer in answers for each in answer[0]]
        for index, found in enumerate(spaces):
            if found != spaces[0]:
                raise InterfaceError(f"environment {index}: expected the spaces {spaces[0]}, got {found}")
        self.single_observation_space, self.single_action_space = spaces[0]
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.metadata = {**answers[0][1], "autoreset_mode": self._mode}
        self.render_mode = answers[0][2]

    def _share(self) -> None:
        self._shared = SharedArrays(self.single_observation_space, self.num_envs)
        for process in self._processes:
            process.send(request("share", self.single_observation_space, self.num_envs))
            process.send_file(self._shared.file)
            process.receive()

    def _mask(self, given: Any) -> npt.NDArray[np.bool_]:
        if given is None:
            return np.ones(self.num_envs, np.bool_)
        mask = np.asarray(given)
        if mask.shape != (self.num_envs,) or mask.dtype != np.bool_ or not mask.any():
            raise ValueError(f"reset_mask: expected {self.num_envs} bools, one true at least, got {given!r}")
        return mask

    def _ask_all(self, name: str, arguments: Sequence[tuple[Any, ...]] | None = None) -> list[Any]:
        """Sends a request to each process, then returns all answers, or raises the first error among them."""
        requests = [request(name, *each) for each in arguments or [()] * self.workers]
        for process, each in zip(self._processes, requests):  # all requests first, so that no process starts late
            process.send(each)
        answers = [process.answer() for process in self._processes]
        for is_good, answer in answers:
            if not is_good:
                raise answer
        return [answer for _, answer in answers]


class _Process:
    """The calling process's connection to a worker process."""

    def __init__(self, index: int) -> None:
        self._index = index
        ours, theirs = Pipe()
        with theirs:
            self._process = start_child(
                python_module("rpbi.gym.vector_worker", str(theirs.fileno())),
                signal.SIGKILL,
                pass_fds=[theirs.fileno()],
                env={**os.environ, **ENVIRONMENT, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            )
        self._connection: Connection = ours

    def stay_on(self, processor: int) -> None:
        """Restricts the process to one processor."""
        with suppress(ProcessLookupError):  # `answer` reports that it has ended
            os.sched_setaffinity(self._process.pid, {processor})

    def send(self, text: bytes) -> None:
        """Sends a request."""
        with suppress(OSError):  # `answer` reports that it has ended
            self._connection.send_bytes(text)

    def send_file(self, file: int) -> None:
        """Sends a file descriptor."""
        send_handle(self._connection, file, self._process.pid)
        os.set_blocking(self._connection.fileno(), True)  # non-blocking by now if sockets have a default timeout

    def answer(self) -> tuple[bool, Any]:
        """Waits for an answer. Returns (True, result) if the request succeeded, otherwise (False, error)."""
        try:
            is_good, answer = pickle.loads(self._connection.recv_bytes())
        except (EOFError, OSError) as error:
            why = str(error) or "it was killed, or its memory has run out"
            return False, InterfaceError(f"worker {self._index} has ended: {why}")
        return is_good, answer

    def receive(self) -> Any:
        """Waits for the answer to a request, and returns the result or raises the error."""
        is_good, answer = self.answer()
        if not is_good:
            raise answer
        return answer

    def close(self) -> None:
        """Ends the process."""
        self._connection.close()
        self._process.kill()
        self._process.wait()
        assert self._process.stdin is not None
        self._process.stdin.close()


def request(name: str, *arguments: Any) -> bytes:
    """Serializes a request to a worker: for steps with `pickle`, which is faster, otherwise with `cloudpickle`."""
    dumps = pickle.dumps if name == "step" else cloudpickle.dumps
    return dumps((name, arguments), pickle.HIGHEST_PROTOCOL)


def _parts(count: int, workers: int) -> list[tuple[int, int]]:
    """Divides environments evenly among workers.

    Returns, for each worker, the index of its first environment, and the index of its last environment plus 1.
    """
    ends = [count * each // workers for each in range(workers + 1)]
    return list(zip(ends, ends[1:]))


def make_vector(
    num_envs: int = 1,
    *,
    workers: int | None = None,
    autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
    **options: Any,
) -> WorldVectorEnv:
    """Makes a vector of equal environments, for `gymnasium.make_vec`.

    Args:
        num_envs: Number of environments.
        workers: Number of worker processes, see `WorldVectorEnv`.
        autoreset_mode: See `WorldVectorEnv`.
        options: Arguments of `WorldEnv`.

    Raises:
        UnknownNameError: If an option is not an argument of `WorldEnv`.
    """
    require_arguments(options, ("workers", "autoreset_mode"))
    return WorldVectorEnv([partial(WorldEnv, **options)] * num_envs, workers, autoreset_mode)
