"""What tests of the simulator node share."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest


@pytest.fixture
def placed(ros: Any) -> Iterator[None]:
    """Has the camera of `camera_world` above the floor."""
    from camera_world import place

    with place("rpbi/eye"):
        yield


@pytest.fixture
def start(ros: Any, tmp_path: Path) -> Callable[..., Any]:
    """Starts a world with an arm that follows trajectories; see `open_world` for the arguments."""
    from trajectory_world import open_world

    return partial(open_world, ros, tmp_path)


@pytest.fixture(scope="module")
def shared_robot(module_ros: Any, tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The world behind `robot`."""
    from trajectory_world import open_world

    return open_world(module_ros, tmp_path_factory.mktemp("shared"))


@pytest.fixture
def robot(shared_robot: Any) -> Any:
    """A running world with an arm that follows trajectories, as it was at its start; one node for the tests of a file.

    Tests that start nodes of their own stand in other files, since those would take the name of this one.
    """
    from trajectory_world import begin_anew

    begin_anew(shared_robot)
    return shared_robot
