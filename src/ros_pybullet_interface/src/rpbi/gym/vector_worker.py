"""Entry point of a worker process with environments: `python -m rpbi.gym.vector_worker FD`.

FD is the file descriptor of the connection to the calling process.
"""

from __future__ import annotations

import gc
import os
import pickle
import signal
import sys
from collections.abc import Callable, Mapping, Sequence
from multiprocessing.connection import Connection
from multiprocessing.reduction import recv_handle
from typing import Any, NamedTuple

import cloudpickle
import gymnasium
from gymnasium import spaces
from gymnasium.vector import AutoresetMode

from custom_ros_tools.errors import InterfaceError

from .shared_arrays import SharedArrays

Info = dict[str, Any]


class StepResult(NamedTuple):
    """Outcome of a step.

    Attributes:
        observation: Observation after the step; if the step reset the environment, the new episode's first observation.
        reward: Reward of the action.
        terminated: Whether the task has ended the episode.
        truncated: Whether the episode has ended at the maximum number of actions.
        info: Information dictionary that belongs to `observation`.
        final: Last observation (`final_obs`) and information (`final_info`) of an episode that has just ended in mode
            `SAME_STEP`; otherwise None.
    """

    observation: Any
    reward: float
    terminated: bool
    truncated: bool
    info: dict[str, Any]
    final: dict[str, Any] | None = None


class Slot:
    """An environment that is reset when its episode has ended, according to one of Gymnasium's three modes.

    Args:
        env: The environment.
        mode: `NEXT_STEP`: the step after the end of an episode ignores the action and resets. `SAME_STEP`: the step
            that ends the episode also resets. `DISABLED`: the caller resets.
    """

    def __init__(self, env: gymnasium.Env[Any, Any], mode: AutoresetMode) -> None:
        self.env, self._mode = env, mode
        self._has_ended = False

    def reset(self, seed: int | None, options: dict[str, Any] | None) -> tuple[Any, dict[str, Any]]:
        """Starts an episode."""
        self._has_ended = False
        return self.env.reset(seed=seed, options=options)

    def step(self, action: Any) -> StepResult:
        """Takes a step, or resets the environment as the mode requires.

        Raises:
            ValueError: If the episode has ended in mode `DISABLED`, and the caller has not reset the environment.
        """
        if self._has_ended and self._mode is AutoresetMode.DISABLED:
            raise ValueError("the episode has ended: expected reset(options={'reset_mask': ...}) before the next step")
        if self._has_ended and self._mode is AutoresetMode.NEXT_STEP:
            observation, info = self.reset(None, None)
            return StepResult(observation, 0.0, False, False, info)
        observation, reward, terminated, truncated, info = self.env.step(action)
        self._has_ended = terminated or truncated
        if not self._has_ended or self._mode is not AutoresetMode.SAME_STEP:
            return StepResult(observation, float(reward), terminated, truncated, info)
        final = {"final_obs": observation, "final_info": info}
        observation, info = self.reset(None, None)
        self._has_ended = False
        return StepResult(observation, float(reward), terminated, truncated, info, final)


class Worker:
    """The environments of this worker process, a subset of the vector's environments.

    Args:
        makers: Functions that make one environment each.
        first: Index of this worker's first environment among all environments.
        mode: Decides when environments are reset, see `Slot`.
    """

    def __init__(self, makers: Sequence[Callable[[], Any]], first: int, mode: AutoresetMode) -> None:
        self._slots = [Slot(make(), mode) for make in makers]
        self._first = first
        self._shared: SharedArrays | None = None

    def spaces(self) -> tuple[list[tuple[spaces.Space[Any], spaces.Space[Any]]], dict[str, Any], str | None]:
        """Returns each environment's observation and action space, and metadata and render mode of the first one."""
        env = self._slots[0].env
        each = [(slot.env.observation_space, slot.env.action_space) for slot in self._slots]
        return each, dict(env.metadata), env.render_mode

    def share(self, shared: SharedArrays) -> None:
        """Sets the shared memory to which all later results are written."""
        self._shared = shared

    def reset(self, seeds: Sequence[int | None], mask: Sequence[bool], options: Info | None) -> list[Info | None]:
        """Resets the environments whose `mask` is true. Returns the information of each reset; None for the others."""
        assert self._shared is not None
        infos: list[Info | None] = []
        for index, (slot, seed, is_reset) in enumerate(zip(self._slots, seeds, mask), self._first):
            info = None
            if is_reset:
                observation, info = slot.reset(seed, options)
                self._shared.write(index, observation)
                self._shared.terminations[index] = self._shared.truncations[index] = False
            infos.append(info)
        return infos

    def step(self, actions: Sequence[Any]) -> list[tuple[Info, Info | None]]:
        """Takes a step with each environment; returns `info` and `final` of each `StepResult`."""
        shared = self._shared
        assert shared is not None
        infos = []
        for index, (slot, action) in enumerate(zip(self._slots, actions), self._first):
            found = slot.step(action)
            shared.write(index, found.observation)
            shared.rewards[index] = found.reward
            shared.terminations[index], shared.truncations[index] = found.terminated, found.truncated
            infos.append((found.info, found.final))
        return infos

    def call(self, name: str, arguments: tuple[Any, ...], options: Mapping[str, Any]) -> list[Any]:
        """Returns the named attribute of each environment. If the attribute is callable, returns its result instead."""
        found = [slot.env.get_wrapper_attr(name) for slot in self._slots]
        return [each(*arguments, **options) if callable(each) else each for each in found]

    def set(self, name: str, values: Sequence[Any]) -> None:
        """Sets an attribute of each environment to the environment's entry in `values`."""
        for slot, value in zip(self._slots, values):
            slot.env.set_wrapper_attr(name, value)

    def close(self) -> None:
        """Closes all environments."""
        for slot in self._slots:
            slot.env.close()


def main() -> None:
    """Answers requests of the calling process until that process closes the connection."""
    connection = Connection(int(sys.argv[1]))
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # only the calling process handles Ctrl-C
    worker: Worker | None = None
    while True:
        try:
            request = connection.recv_bytes()
        except (EOFError, OSError):
            break
        try:
            name, arguments = cloudpickle.loads(request)
            if name == "make":
                worker, answer = Worker(*arguments), None
                gc.collect()
                gc.freeze()  # otherwise a garbage collection walks all worlds while other processes wait
            elif name == "share":
                file = recv_handle(connection)
                os.set_blocking(connection.fileno(), True)  # non-blocking by now if sockets have a default timeout
                answer = getattr(worker, name)(SharedArrays(arguments[0], arguments[1], file))
            else:
                answer = getattr(worker, name)(*arguments)
            text = pickle.dumps((True, answer), pickle.HIGHEST_PROTOCOL)
        except Exception as error:
            text = pickle.dumps((False, as_sent(error)))
        connection.send_bytes(text)
    if worker is not None:
        worker.close()


def as_sent(error: Exception) -> Exception:
    """Returns `error` if another process can unpickle it, otherwise an InterfaceError with the text of `error`."""
    try:
        if str(pickle.loads(pickle.dumps(error))) == str(error):
            return error
    except Exception:  # the error's class may raise anything
        pass
    return InterfaceError(f"{type(error).__name__}: {error}")


if __name__ == "__main__":
    main()
