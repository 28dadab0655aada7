"""A world and a task as an environment of Gymnasium."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import deepcopy
from typing import Any

import pybullet

from custom_ros_tools.config import load_config
from custom_ros_tools.errors import ConfigError, InterfaceError, MissingDependency, Problem, UnknownNameError
from custom_ros_tools.schema.type_names import shown
from rpbi.plugins import plugin_errors
from rpbi.world import World

try:
    import gymnasium
    from gymnasium import spaces
except ImportError:
    raise MissingDependency("gymnasium", "./rpbi setup gym") from None

from .checks import CheckedTask, check_action
from .randomization import Randomization, Randomizer
from .task import WorldTask
from .tasks import TASKS
from .views import Image, Views

MODES = ("human", "rgb_array")
ARGUMENTS = ("world", "task", "randomization", "cameras", "render_mode")
"""Names of the arguments of an environment."""


class WorldEnv(gymnasium.Env[Any, Any]):
    """A Gymnasium environment: a world, and a task to be done in it.

    Args:
        world: Main YAML file of the world.
        task: The task: a YAML file or a mapping with `type` and options, a name in `TASKS`, `module:Class`, or a class.
        randomization: Configuration of random variation, as YAML file or mapping, see `Randomization`. None: nothing
            varies.
        cameras: Names of the world's cameras whose images are part of observations.
        render_mode: `rgb_array` for images of the world's first camera, `human` for PyBullet's window.

    Attributes:
        world: The simulated world, for direct access.
        task: The task object.

    Raises:
        ConfigError: If a file is not valid; the error lists all problems.
        PluginError: If a task from another package fails.
        UnknownNameError: If the task, a camera or an argument is unknown.
        ValueError: If the render mode is unknown.
    """

    metadata: dict[str, Any] = {"render_modes": list(MODES)}

    def __init__(
        self,
        world: str,
        task: str | Mapping[str, Any] | type[WorldTask],
        *,
        randomization: str | Mapping[str, Any] | None = None,
        cameras: Sequence[str] = (),
        render_mode: str | None = None,
        **unknown: Any,
    ) -> None:
        require_arguments(unknown)
        if render_mode not in (None, *MODES):
            raise ValueError(f"render_mode: expected None or one of {', '.join(MODES)}, got '{render_mode}'")
        varied = Randomization.read(randomization)
        self.render_mode = render_mode
        self.world = World.from_file(world, connection_mode=pybullet.GUI if render_mode == "human" else pybullet.DIRECT)
        try:
            self._task = CheckedTask(make_task(self.world, task))
            self.task = self._task.task
            self._views = Views(self.world, cameras, render_mode, self.task.period_s)
            file = randomization if isinstance(randomization, str) else "randomization"
            self._randomizer = Randomizer(self.world, varied, file)
        except BaseException:
            self.world.close()
            raise
        self.metadata = {**self.metadata, "render_fps": max(1, round(1.0 / self.task.period_s))}
        self.action_space = self._task.action_space
        self.observation_space = self._with_images(self._task.observation_space)
        self._line = DelayLine(1, 0, 0, None)
        self._step = self._watched_step if self._task.watches else self.world.step

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Starts an episode; the same seed and actions lead to bit-identical observations.

        Args:
            seed: Seed of all random numbers from now on; without a seed, the random sequence continues.
            options: Not used.

        Returns:
            The observation, and an information dictionary with `is_success`.
        """
        super().reset(seed=seed)
        self.world.reset(rebuild=False)
        observation_ticks, action_ticks = self._randomizer.apply(self.np_random)
        self._task.reset(self.np_random)
        first = self._observe()
        self._line = DelayLine(self.task.config.action_ticks, observation_ticks, action_ticks, first)
        return first, {"is_success": self._task.has_succeeded()}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Applies an action, and advances the world by the duration of an action.

        Returns:
            Observation, reward, `terminated` (whether the task has ended the episode), `truncated` (whether the maximum
            number of actions per episode is reached), and an information dictionary with `is_success`.

        Raises:
            ValueError: If the type or shape of the action does not fit the action space, or a number in the action is
                not finite. The world is then unchanged.
        """
        if action is not None or self.task.needs_action:
            check_action(self.action_space, action)
        self._task.count += 1
        observation = self._line.run(action, self._task.act, self._step, self._observe)
        reward, has_succeeded = self._task.reward(), self._task.has_succeeded()
        has_ended = self._task.has_ended() if self._task.ends_otherwise else has_succeeded
        is_last = self._task.count >= self.task.max_actions
        if self.render_mode == "human":
            self.render()
        return observation, reward, has_ended, is_last, {"is_success": has_succeeded}

    def render(self) -> Image | None:
        """Returns the image of the world's first camera, uint8, shape (height, width, 3).

        In render mode `human`, waits instead until the duration of an action has passed since the last call, and
        returns None. Without a render mode, returns None.
        """
        return self._views.render()

    def close(self) -> None:
        """Closes the renderer and the world."""
        self._views.close()
        self.world.close()

    def _watched_step(self) -> None:
        self.world.step()
        self._task.after_tick()

    def _observe(self) -> Any:
        observation = self._task.observation()
        return {**observation, **self._views.read()} if self._views.spaces else observation

    def _with_images(self, space: spaces.Space[Any]) -> spaces.Space[Any]:
        if not self._views.spaces:
            return space
        if not isinstance(space, spaces.Dict):
            raise InterfaceError(f"images need observations that are dictionaries, got {space}")
        return spaces.Dict({**space.spaces, **self._views.spaces})


def require_arguments(given: Iterable[str], further: Iterable[str] = ()) -> None:
    """Raises an UnknownNameError if a name is neither in ARGUMENTS nor in `further`."""
    known = [*ARGUMENTS, *further]
    for name in given:
        if name not in known:
            raise UnknownNameError("argument of an environment", name, known)


def make_task(world: World, given: str | Mapping[str, Any] | type[WorldTask]) -> WorldTask:
    """Makes a task for a world, see `WorldEnv`.

    Raises:
        ConfigError: If the task's options are wrong or do not fit the world.
        UnknownNameError: If the task is unknown.
        PluginError: If the task's class is from another package and fails.
    """
    file = given if isinstance(given, str) and given.endswith((".yaml", ".yml")) else "task"
    if isinstance(given, type):
        kind, options = given, {}
    else:
        entry = load_config(given) if file == given else {"type": given} if isinstance(given, str) else given
        options = dict(entry) if isinstance(entry, Mapping) else {}
        name = options.pop("type", None)
        if not isinstance(name, str):
            raise ConfigError([Problem(file, "type", f"expected a name of a task, got {shown(name)}")])
        kind = TASKS.configured(name, file, "type")
    config = kind.Config.parse(options, file)
    with plugin_errors(kind, "making the task"):
        try:
            return kind(world, config)
        except (ValueError, UnknownNameError) as error:
            raise ConfigError([Problem(file, "", str(error))]) from None


class DelayLine:
    """Steps the world for the duration of an action, with delayed actions and delayed observations.

    An observation with delay d is made d ticks before the end of an action. If this time is before the start of the
    episode, the first observation is used instead.

    Args:
        ticks: Number of ticks per action.
        observation_ticks: Age [ticks] of observations.
        action_ticks: Delay [ticks] until an action takes effect.
        first: Observation at the start of the episode.
    """

    def __init__(self, ticks: int, observation_ticks: int, action_ticks: int, first: Any) -> None:
        self._ticks, self._action_ticks = ticks, action_ticks
        self._has_delay = bool(observation_ticks or action_ticks)
        self._observed_at = (-observation_ticks) % ticks or ticks
        """Tick within each action, counted from 1, after which an observation is made."""
        self._observations = deque(deepcopy(first) for _ in range(observation_ticks // ticks))
        self._actions: deque[tuple[int, Any]] = deque()
        self._tick = 0

    def run(self, action: Any, act: Callable[[Any], None], step: Callable[[], Any], observe: Callable[[], Any]) -> Any:
        """Steps the world for the duration of one action, and returns the delayed observation at the end.

        Args:
            action: New action, which is applied after its delay.
            act: Function that applies an action to the world.
            step: Function that advances the world by one tick.
            observe: Function that returns the present observation.
        """
        if not self._has_delay:
            act(action)
            for _ in range(self._ticks):
                step()
            return observe()
        actions = self._actions
        actions.append((self._tick + self._action_ticks, deepcopy(action)))
        for tick in range(1, self._ticks + 1):
            if actions and actions[0][0] <= self._tick:
                act(actions.popleft()[1])
            step()
            self._tick += 1
            if tick == self._observed_at:
                self._observations.append(observe())
        return self._observations.popleft()


def register(name: str, world: str, task: Any, **options: Any) -> None:
    """Registers an environment, so that `gymnasium.make` and `gymnasium.make_vec` can make it.

    Args:
        name: Id of the environment, such as `rpbi/Reach-v0`.
        world: Main YAML file of the world.
        task: The task, see `WorldEnv`.
        options: Further arguments of `WorldEnv`; arguments given to `gymnasium.make` override them.

    Raises:
        UnknownNameError: If an option is not an argument of `WorldEnv`.
    """
    require_arguments(options)
    gymnasium.register(
        name,
        entry_point="rpbi.gym.env:WorldEnv",
        vector_entry_point="rpbi.gym.vector_env:make_vector",
        kwargs={"world": world, "task": task, **options},
    )
