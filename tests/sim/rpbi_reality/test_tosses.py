"""Tosses in worlds from YAML, and the command `reality`."""

from __future__ import annotations

import json

import numpy as np
import pytest
from numpy.polynomial.polynomial import polyfit, polyval
from real_contacts import push_arrays, toss_arrays, write

from rpbi.world.loading import load_world
from rpbi_reality.console.reality import reality
from rpbi_reality.evaluation import world_file
from rpbi_reality.pose_errors import rotated
from rpbi_reality.tosses.toss_data import Start, TossData
from rpbi_reality.tosses.toss_world import TossWorld, toss_errors

START = Start(
    np.array([0.0, 0.0, 0.15]),
    np.array([0.3, 0.1, 0.2, np.sqrt(0.86)]),
    np.array([1.0, 0.2, 0.0]),
    np.array([2.0, -3.0, 1.0]),
)


def _simulated(world: TossWorld, tmp_path) -> TossData:
    """Returns a toss whose measurement is what the world simulates."""
    position, quaternion = world(START, 60)
    arrays = toss_arrays(1, 60) | {"position": position, "quaternion": quaternion}
    arrays |= {f"start_{key}": value[None] for key, value in START._asdict().items()}
    return TossData.read(write(tmp_path / "cube_tosses.npz", arrays))


def test_a_toss_repeats_exactly_and_differs_with_another_friction(tmp_path):
    world = TossWorld(load_world(world_file("tosses/world.yaml")), 148.0)
    other = TossWorld(load_world(world_file("tosses/published.yaml")), 148.0)
    try:
        data = _simulated(world, tmp_path)
        world(START._replace(linear_velocity=np.array([0.0, 1.0, 0.0])), 40)  # leaves nothing behind
        assert toss_errors(world, data).position.max() < 1e-9
        assert toss_errors(other, data).final_position.max() > 1.0
    finally:
        world.close()
        other.close()


def _distance_from_parabola(time: np.ndarray, position: np.ndarray) -> float:
    return float(abs(position - polyval(time, polyfit(time, position, 2)).T).max())


def test_free_flight_is_that_of_the_centre_of_mass():
    world = TossWorld(load_world(world_file("tosses/world.yaml")), 148.0)
    try:
        start = START._replace(position=np.array([0.0, 0.0, 2.0]))
        position, quaternion = world(start, 60)
        centre = np.array(world._cube.baseInertialFramePosition)
        mass = position + rotated(quaternion, np.tile(centre, (60, 1)))
        time = np.arange(60) / 148.0
        assert polyfit(time, mass, 2)[2] == pytest.approx([0.0, 0.0, -9.605 / 2.0], abs=0.02)
        assert _distance_from_parabola(time, mass) < 1e-5 < _distance_from_parabola(time, position)
    finally:
        world.close()


def test_the_command_prints_tables_and_writes_results(tmp_path, capsys):
    write(tmp_path / "cube_tosses_blind.npz", toss_arrays(2, 40))
    write(tmp_path / "arm_pushes.npz", push_arrays())
    assert reality(data=tmp_path, out=tmp_path / "out") == 1
    printed = capsys.readouterr()
    assert (
        "| PyBullet, preset `impact` |" in printed.out and "| real runs, each against the others | 1.0 [" in printed.out
    )
    assert "m1n6s300.urdf is missing" in printed.err
    results = json.loads((tmp_path / "out/reality.json").read_text())
    rows = results["tosses"]["rows"]
    assert results["tosses"]["tosses"] == 2 and set(rows["PyBullet, published facts"]["position"]) == {
        "mean",
        "low",
        "high",
    }
    assert results["pushes"]["1"]["rows"]["real runs, each against the others"]["hand_mm"]["mean"] == pytest.approx(1.0)
    assert (tmp_path / "out/tosses.png").stat().st_size > 10_000
    page = (tmp_path / "out/reality.html").read_text()
    assert "const scenes" in page and "http" not in page.replace("http-equiv", "")


def test_a_faulty_file_does_not_stop_the_other_experiment(tmp_path, capsys):
    (tmp_path / "cube_tosses.npz").write_text("broken")
    write(tmp_path / "arm_pushes.npz", push_arrays())
    assert reality(data=tmp_path, out=tmp_path / "out", no_pictures=True) == 1
    printed = capsys.readouterr()
    assert "cube_tosses.npz" in printed.err and "experiment 1, 3 runs" in printed.out
