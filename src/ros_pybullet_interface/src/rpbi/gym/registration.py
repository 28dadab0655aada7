"""Names of environments in Gymnasium."""

from __future__ import annotations

from typing import Any

import gymnasium


def register(name: str, world: str, task: Any, **options: Any) -> None:
    """Registers an environment, so that `gymnasium.make` and `gymnasium.make_vec` make it.

    Args:
        name: Its id, such as `rpbi/Reach-v0`.
        world: Main YAML file of the world.
        task: The task, see `WorldEnv`.
        options: Further options of `WorldEnv`; those of `gymnasium.make` override them.
    """
    gymnasium.register(
        name,
        entry_point="rpbi.gym.env:WorldEnv",
        vector_entry_point="rpbi.gym.vector.env:make_vector",
        kwargs={"world": world, "task": task, **options},
    )
