"""The services `rpbi/save`, `rpbi/save_keyframe` and `rpbi/restore`, which write and read states of the world."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import rospy
from cob_srvs.srv import SetStringRequest

from custom_ros_tools.errors import ConfigError, InterfaceError, Problem, shortened
from custom_ros_tools.foreign import path_below
from rpbi.ros.endpoints import Answer
from rpbi.world.saved.state import WorldState

STATE_SUFFIX = ".world"


def state_folder() -> Path:
    """Returns the folder that the parameter `~state_folder` names; by default the user's home.

    Raises:
        ConfigError: If the parameter is not the absolute path of an existing folder.
    """
    given = rospy.get_param("~state_folder", "~")
    folder = Path(given).expanduser() if isinstance(given, str) and given else None
    if folder is None or not folder.is_absolute() or not folder.is_dir():
        raise ConfigError([Problem("~state_folder", "", f"expected the full path of a folder, got {given!r}")])
    return folder


def save(node: Any, request: SetStringRequest) -> Answer:
    """Saves the state of the world in a file, which `rpbi/restore` reads."""
    return _write(node, request.data, lambda: node.ask(node.simulation.world.save))


def save_keyframe(node: Any, request: SetStringRequest) -> Answer:
    """Makes a keyframe and saves it in a file, which `rpbi/restore` can restore without simulating again."""
    return _write(node, request.data, lambda: node.ask.wait_for(node.ask(node.keyframes.save)))


def _write(node: Any, name: str, save: Callable[[], WorldState]) -> Answer:
    path = state_file(node.state_folder, name)
    if os.path.lexists(path) and not (path.is_file() and WorldState.is_file(path)):
        raise InterfaceError(f"{path}: exists, and is no saved state: it is not overwritten")
    state = save()
    try:
        state.write(path)
    except OSError as error:
        raise InterfaceError(f"{path}: cannot be written: {(error.strerror or str(error)).lower()}") from None
    return Answer(True, f"saved tick {state.tick} in {path}")


def restore(node: Any, request: SetStringRequest) -> Answer:
    """Restores a saved state by simulating again from the world's start or the file's keyframe; stamps continue.

    The saved state must come from this world. During the restoration, the node answers other requests; `rpbi/stop`
    aborts the restoration and resets the world.
    """
    state = WorldState.read(state_file(node.state_folder, request.data))
    node.objects.reset(state)
    return Answer(True, f"restored tick {state.tick}")


def state_file(folder: Path, name: str) -> Path:
    """Returns the path of the state file that a request names.

    Args:
        folder: Folder that must contain the file, possibly in a subfolder.
        name: Absolute path of the file, or its path relative to the folder.

    Raises:
        InterfaceError: If the file is outside the folder, its path passes a symbolic link, or its name does not end
            with `.world`.
    """
    if not name.endswith(STATE_SUFFIX):
        raise InterfaceError(f"data: expected the path of a {STATE_SUFFIX} file, got {shortened(repr(name))}")
    if name.startswith("/"):
        roots = [root for root in (folder, folder.resolve()) if Path(name).is_relative_to(root)]
        if not roots:
            given = shortened(repr(name))
            raise InterfaceError(f"data: expected a file below {folder} (~state_folder of the node), got {given}")
        name = str(Path(name).relative_to(roots[0]))
    return path_below(folder, name)
