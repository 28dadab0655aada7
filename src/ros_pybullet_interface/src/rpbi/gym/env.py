"""A world and a task as an environment of Gymnasium."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium
import pybullet
from gymnasium import spaces

from custom_ros_tools.config import load_config
from custom_ros_tools.errors import ConfigError, InterfaceError, Problem, UnknownNameError
from custom_ros_tools.schema.type_names import shown
from rpbi.plugins import plugin_errors
from rpbi.world import World

from .checks import CheckedTask
from .delays import DelayLine
from .randomization import Randomization, Randomizer
from .task import Task
from .tasks import TASKS
from .views import Image, Views

MODES = ("human", "rgb_array")


class WorldEnv(gymnasium.Env[Any, Any]):
    """A world in which a task is to be done.

    Args:
        world: Main YAML file of the world.
        task: The task: a YAML file or a mapping with its `type` and options, a name of `TASKS`, `module:Class`, or a
            class.
        randomization: YAML file, or mapping, of what varies from episode to episode; nothing by default.
        cameras: Cameras of the world whose images are in observations.
        render_mode: `rgb_array` for images of the world's first camera, `human` for PyBullet's window.

    Attributes:
        world: The world; nothing of it is hidden.
        task: The task.

    Raises:
        ConfigError: If a file is wrong; it lists all problems.
        PluginError: If a task of another package fails.
        UnknownNameError: If there is no such task or camera.
    """

    metadata: dict[str, Any] = {"render_modes": list(MODES)}

    def __init__(
        self,
        world: str,
        task: str | Mapping[str, Any] | type[Task],
        *,
        randomization: str | Mapping[str, Any] | None = None,
        cameras: Sequence[str] = (),
        render_mode: str | None = None,
    ) -> None:
        if render_mode not in (None, *MODES):
            raise ValueError(f"render_mode: expected None or one of {', '.join(MODES)}, got '{render_mode}'")
        varied = Randomization.read(randomization)
        self.render_mode = render_mode
        self.world = World.from_file(world, connection_mode=pybullet.GUI if render_mode == "human" else pybullet.DIRECT)
        try:
            self._task = CheckedTask(make_task(self.world, task))
            self.task = self._task.task
            self._views = Views(self.world, cameras)
            self._check_camera(world)
            file = randomization if isinstance(randomization, str) else "randomization"
            self._randomizer = Randomizer(self.world, varied, file)
        except BaseException:
            self.world.close()
            raise
        self.metadata = {**self.metadata, "render_fps": max(1, round(1.0 / self.task.period_s))}
        self.action_space = self._task.action_space
        self.observation_space = self._with_images(self._task.observation_space)
        self._line = DelayLine(1, 0, 0, None)
        self._drawn_s = 0.0
        self._step = self._watched_step if self._task.watches else self.world.step

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Starts an episode; the same seed and actions lead to the same observations, to the last bit.

        Args:
            seed: Seed of all that is random from now on; without one, what was random before goes on.
            options: None are known.

        Returns:
            The observation, and `is_success`.
        """
        super().reset(seed=seed)
        self.world.reset(rebuild=False)
        observation_ticks, action_ticks = self._randomizer.apply(self.np_random)
        self._task.reset(self.np_random)
        first = self._observe()
        self._line = DelayLine(self.task.config.action_ticks, observation_ticks, action_ticks, first)
        return first, self._info()

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Acts for some ticks.

        Returns:
            Observation, reward, whether the episode is over, whether all of its actions are used, and `is_success`.
        """
        self._task.count += 1
        observation = self._line.run(action, self._task.act, self._step, self._observe)
        reward, has_ended = self._task.reward(), self._task.has_ended()
        if self.render_mode == "human":
            self.render()
        return observation, reward, has_ended, self._task.count >= self.task.config.max_actions, self._info()

    def render(self) -> Image | None:
        """Returns what the world's first camera sees, uint8, shape (height, width, 3).

        With PyBullet's window it waits until the time of an action has passed since the last call, and returns nothing.
        """
        if self.render_mode == "rgb_array":
            return self._views.frame()
        if self.render_mode == "human":
            time.sleep(max(0.0, self._drawn_s + self.task.period_s - time.monotonic()))
            self._drawn_s = time.monotonic()
        return None

    def close(self) -> None:
        """Ends the world."""
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

    def _info(self) -> dict[str, Any]:
        return {"is_success": self._task.has_succeeded()}

    def _check_camera(self, file: str) -> None:
        if self.render_mode == "rgb_array" and not any(camera.pose for camera in self.world.cameras.values()):
            message = "render_mode rgb_array: expected a camera with a pose in `poses`, got none"
            raise ConfigError([Problem(file, "rgbd_sensor", message)])


def make_task(world: World, given: str | Mapping[str, Any] | type[Task]) -> Task:
    """Makes a task for a world, see `WorldEnv`.

    Raises:
        ConfigError: If its options are wrong or do not fit the world.
        UnknownNameError: If there is no such task.
        PluginError: If its class is of another package and fails.
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
