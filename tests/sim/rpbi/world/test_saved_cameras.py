"""Cameras are part of a state: save, restore, fork and predict keep them, and what sensors see by them."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import costs
import numpy as np
import pytest
import yaml
from costs import cameras
from worlds import FLOOR, box, write_world

from rpbi.geometry import Pose
from rpbi.images import CameraImages
from rpbi.samples import AprilTagsSample
from rpbi.world import World
from rpbi.world.forks import shadow
from rpbi.world.saved.description import WorldDescription

AHEAD = 60
"""Ticks for which worlds go on."""
DOWN = (1.0, 0.0, 0.0, 0.0)
"""Orientation of an optical frame that looks down."""
TAG = {"id": 7, "size": 0.1, "position": [0.0, 0.0, 0.1]}


def camera(name: str) -> dict[str, Any]:
    """Returns the configuration of a camera whose frame has its name."""
    view = {"fov": 60.0, "width": 320, "height": 240}
    return {"name": name, "hz": 10, "intrinsics": view, "object_tf": {"tf_id": name}}


@pytest.fixture
def world(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[World]:
    """A box with a tag, and cameras of the main file, of another file, and one that came later; a fourth one went."""
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join((str(Path(costs.__file__).parent), *sys.path)))
    sensors = [
        {
            "type": "april_tags",
            "name": name,
            "hz": 100,
            "camera": name,
            "topic": name,
            "latency_s": 0.015,
            "tags": [TAG],
        }
        for name in ("eye", "placed", "late")
    ]
    for name in ("placed", "gone"):
        (tmp_path / f"{name}.yaml").write_text(yaml.safe_dump(camera(name)))
    poses = [{"tf_id": "placed", "position": [0.1, 0.0, 1.5], "orientation": list(DOWN)}]
    path = write_world(
        tmp_path,
        collision=(FLOOR,),
        dynamic=(box("box", basePosition=[0.0, 0.0, 0.3], sensors=sensors),),
        rgbd_sensor=camera("eye"),
        rgbd_sensors=["placed.yaml", "gone.yaml"],
        poses=poses,
    )
    built = World.from_file(path)
    run(built, 20)
    built.add_camera(camera("late"))
    built.remove("gone")
    built.put("eye/pose", Pose((0.0, 0.1, 1.2), DOWN))
    run(built, 20)
    built.put("late/pose", Pose((0.1, 0.1, 1.3), DOWN))
    built.set_sensor_rate("late", 0, 20.0)
    run(built, 20)
    yield built
    built.close()


def run(world: World, ticks: int) -> list[Any]:
    """Returns what the detectors of tags report meanwhile."""
    return [one for _ in range(ticks) for one in world.step() if isinstance(one, AprilTagsSample)]


@pytest.mark.parametrize("keyframe", [False, True])
def test_a_saved_world_has_its_cameras(world: World, tmp_path: Path, keyframe: bool) -> None:
    state, known = world.save(tmp_path / "seen.world", keyframe=keyframe), cameras(world)
    assert set(known) == {"eye", "placed", "late"} and all(pose for _, pose, *_ in known.values())
    expected = run(world, AHEAD)
    assert {one.name for one in expected if one.tags} == {"box/eye", "box/placed", "box/late"}
    elsewhere = World.from_state(tmp_path / "seen.world")
    assert cameras(elsewhere) == known
    assert run(elsewhere, AHEAD) == expected
    elsewhere.close()
    world.put("eye/pose", Pose((5.0, 0.0, 1.0), DOWN))
    world.remove("late")
    world.restore(state)
    assert cameras(world) == known
    assert run(world, AHEAD) == expected


def test_a_restored_world_has_the_same_images(world: World) -> None:
    elsewhere = World.from_state(world.save())
    with CameraImages(world) as here, CameraImages(elsewhere) as there:
        for name in ("eye", "late"):
            one, other = here.frame(name), there.frame(name)
            assert np.array_equal(one.segmentation, other.segmentation) and np.array_equal(one.colour, other.colour)
            assert len(np.unique(one.segmentation)) > 1
    elsewhere.close()


@pytest.mark.parametrize("largest_mb", [0.0, 1e6], ids=["a program", "a copy, if it can be"])
def test_forks_and_predictions_see_by_cameras(world: World, monkeypatch: pytest.MonkeyPatch, largest_mb: float) -> None:
    monkeypatch.setattr(shadow, "MAX_COPIED_MB", largest_mb)
    (prediction,) = world.predict([[(5, "eye/pose", Pose((0.0, 0.0, 2.0), DOWN))]], AHEAD, cost="costs:farthest_tag")
    (fork,) = world.fork()
    with fork:
        assert fork.call(cameras) == cameras(world)
        samples = [one for one in fork.step(AHEAD) if isinstance(one, AprilTagsSample)]
    assert samples == run(world, AHEAD)
    assert (prediction.fault, prediction.cost > 1.0) == ("", True)


def test_poses_that_a_reset_keeps_are_saved(world: World) -> None:
    world.reset()
    known = cameras(world)
    assert set(known) == {"eye", "placed", "gone"} and known["eye"][1] == Pose((0.0, 0.1, 1.2), DOWN)
    elsewhere = World.from_state(world.save())
    assert cameras(elsewhere) == known
    elsewhere.close()


def test_descriptions_from_before_have_no_cameras(world: World) -> None:
    described = json.loads(world.describe())
    del described["cameras"]
    elsewhere = World.from_description(WorldDescription(json.dumps(described)))
    assert set(elsewhere.bodies) == set(world.bodies) and not elsewhere.cameras
    elsewhere.close()


def test_restore_forgets_a_pose_that_came_later(world: World) -> None:
    world.remove("eye")
    world.reset()
    state = world.save()
    assert world.cameras["eye"].pose is None
    world.put("eye/pose", Pose((0.0, 0.1, 1.2), DOWN))
    world.step()
    world.restore(state)
    assert world.cameras["eye"].pose is None


def test_an_input_that_waits_is_saved(world: World) -> None:
    world.put("eye/pose", Pose((0.0, 0.0, 1.0), DOWN))
    world.put("box/external_wrench", {"force": [5.0, 0.0, 0.0]})
    elsewhere = World.from_state(world.save())
    assert elsewhere.cameras["eye"].pose == Pose((0.0, 0.0, 1.0), DOWN)
    assert run(elsewhere, AHEAD) == run(world, AHEAD)
    assert elsewhere.state_hash() == world.state_hash()
    elsewhere.close()
