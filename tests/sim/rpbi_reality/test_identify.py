"""Identification of parameters of a world: known values are found, and bad input is named."""

from __future__ import annotations

import json
from pathlib import Path

import genpy
import numpy as np
import pytest
import rosbag
import yaml
from geometry_msgs.msg import Point, Quaternion
from nav_msgs.msg import Odometry
from real_contacts import toss_arrays, write

from custom_ros_tools.errors import ConfigError, InterfaceError
from rpbi.gym.randomization import Randomization
from rpbi.world.loading import load_world
from rpbi_reality.evaluation import world_file
from rpbi_reality.identification.candidate import CandidateWorld, WorldTemplate
from rpbi_reality.identification.evaluator import Evaluator
from rpbi_reality.identification.fit_config import FitConfig
from rpbi_reality.identification.identify import identify_world, read_recordings, write_results
from rpbi_reality.identification.recordings import MeasuredRun, PoseTrack
from rpbi_reality.identification.search import search

TABLE = {
    "name": "table",
    "createVisualShape": {"shapeType": "GEOM_BOX", "halfExtents": [3.0, 3.0, 0.5]},
    "createCollisionShape": {
        "shapeType": "GEOM_BOX",
        "halfExtents": [3.0, 3.0, 0.5],
        "collisionFramePosition": [0.0, 0.0, -0.5],
    },
    "changeDynamics": {"lateralFriction": 1.0},
}
SHAPE = {"shapeType": "GEOM_BOX", "halfExtents": [0.05, 0.05, 0.02]}
BOX = {
    "name": "box",
    "createVisualShape": SHAPE,
    "createCollisionShape": SHAPE,
    "baseMass": 0.5,
    "basePosition": [0.0, 0.0, 0.02],
    "changeDynamics": {"lateralFriction": 0.2, "linearDamping": 0.0, "angularDamping": 0.0},
    "resetBaseVelocity": {"linearVelocity": [1.0, 0.0, 0.0]},
}
MAIN = {
    "timeStep": 0.004,
    "setGravity": {"gravZ": -9.81},
    "connect": {"connection_mode": "DIRECT"},
    "collision_objects": ["table.yaml"],
    "dynamic_objects": ["box.yaml"],
}
FIT = {
    "runs": {"count": 2},
    "evaluations": 60,
    "measured": {"box": {"object": "box", "rotation_sigma": 0.01}},
    "parameters": {
        "friction": {"set": "box.changeDynamics.lateralFriction", "bounds": [0.1, 0.8]},
        "delay": {"set": "measured.box.delay_s", "bounds": [0.0, 0.05]},
    },
}


@pytest.fixture
def world(tmp_path) -> str:
    for name, content in (("world", MAIN), ("table", TABLE), ("box", BOX)):
        (tmp_path / f"{name}.yaml").write_text(yaml.safe_dump(content))
    return str(tmp_path / "world.yaml")


def fit(**changes) -> FitConfig:
    return FitConfig.parse({**FIT, **changes}, "fit.yaml")


@pytest.fixture
def motion(world, tmp_path) -> Path:
    """Three runs of 0.6 s with friction 0.35 and a delay of 10 ms, with noise."""
    time, random = np.arange(0.0, 0.6, 0.01), np.random.default_rng(3)
    track = PoseTrack(time, np.zeros((60, 3)), np.tile([0.0, 0.0, 0.0, 1.0], (60, 1)))
    candidate = CandidateWorld(WorldTemplate(world, fit()), {"friction": 0.35, "delay": 0.01})
    rows = candidate.simulate(MeasuredRun("0", {"box": track}), 1.0).signals["box"]
    candidate.close()
    poses = np.concatenate([rows] * 3)
    poses[:, :3] += random.normal(0.0, 0.001, (180, 3))
    return write(tmp_path / "motion.npz", {"time": np.tile(time, 3), "offset": np.arange(4) * 60, "box/pose": poses})


def test_known_values_are_within_five_percent_and_within_their_intervals(world, motion):
    result = identify_world(world, motion, fit(), 1)
    for name, true, tolerance in (("friction", 0.35, 0.0175), ("delay", 0.01, 0.001)):
        low, high = result.uncertainty.intervals[name]
        assert result.values[name] == pytest.approx(true, abs=tolerance)
        assert low <= true <= high and high - low < 4.0 * tolerance
    assert result.after.mean < 0.1 * result.before.mean
    assert len(result.held_out) == 1


@pytest.mark.parametrize("evaluations", [10, 25, 60])
def test_a_search_stays_within_its_evaluations(world, motion, evaluations):
    config = fit(evaluations=evaluations)
    evaluator = Evaluator(world, config, read_recordings(motion, config), None, 1)
    with evaluator.running() as evaluate:
        search(config, evaluate, range(3))
    check_of_effects = 3
    assert evaluator.simulated <= 3 * (evaluations + check_of_effects)


def test_one_seed_leads_to_equal_files_with_any_processes(world, motion, tmp_path):
    config = fit(method="cmaes", objective="mean_error", evaluations=30)
    for jobs in (1, 2):
        write_results(tmp_path / f"out{jobs}", world, config, identify_world(world, motion, config, jobs))
    names = sorted(path.name for path in (tmp_path / "out1").iterdir())
    assert names == ["parameters.png", "randomization.yaml", "report.json", "world.yaml"]
    for name in names:
        assert (tmp_path / "out1" / name).read_bytes() == (tmp_path / "out2" / name).read_bytes(), name
    other = config.model_copy(update={"seed": 5})
    write_results(tmp_path / "other", world, other, identify_world(world, motion, other, 1))
    assert (tmp_path / "other/report.json").read_bytes() != (tmp_path / "out1/report.json").read_bytes()


def test_results_can_be_used_as_world_and_as_random_variation(world, motion, tmp_path):
    config = fit()
    result = identify_world(world, motion, config, 1)
    write_results(Path(world).parent / "found", world, config, result)
    patched = load_world(str(Path(world).parent / "found/world.yaml"))
    (box,) = (each.config for each in patched.objects if each.config.name == "box")
    assert box.changeDynamics.lateralFriction == result.values["friction"]
    assert box.changeDynamics.linearDamping == 0.0  # keys of the file stay
    variation = Randomization.read(str(Path(world).parent / "found/randomization.yaml"))
    assert variation.dynamics[0].object == "box" and variation.dynamics[0].lateralFriction is not None
    report = json.loads((Path(world).parent / "found/report.json").read_text())
    assert report["parameters"]["friction"]["value"] == result.values["friction"]


def test_parameter_without_effect_is_named(world, motion):
    idle = {**FIT["parameters"], "bounce": {"set": "table.changeDynamics.restitution", "bounds": [0.0, 1.0]}}
    with pytest.raises(InterfaceError, match="nothing measured depends on bounce"):
        identify_world(world, motion, fit(parameters=idle), 1)


def test_parameters_that_only_act_together_are_reported(world, motion):
    twice = {
        "friction": FIT["parameters"]["friction"],
        "table": {"set": "table.changeDynamics.lateralFriction", "bounds": [0.5, 2.0], "start": 1.0},
    }
    result = identify_world(world, motion, fit(parameters=twice), 1)
    assert ("friction", "table") in result.uncertainty.alike
    product = result.values["friction"] * result.values["table"]
    assert product == pytest.approx(0.35, rel=0.05)


def test_candidates_that_cannot_be_simulated_do_not_end_the_search(world, motion):
    wide = {"friction": {**FIT["parameters"]["friction"], "bounds": [-0.5, 0.8], "start": 0.2}}
    config = fit(parameters=wide, method="cmaes", objective="mean_error", evaluations=50, step=0.4)
    result = identify_world(world, motion, config, 1)
    assert any("lateralFriction" in problem for problem in result.problems)
    assert result.values["friction"] == pytest.approx(0.35, rel=0.1)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"parameters": {"x": {"set": "box.baseMass", "bounds": [2.0, 1.0]}}},
            r"bounds: expected \[smallest, largest\]",
        ),
        ({"parameters": {"x": {"set": "nothing", "bounds": [0.0, 1.0]}}}, "expected OBJECT.KEY"),
        ({"objective": "mean_error"}, "mean_error is not smooth"),
        ({"parameters": {}}, "parameters: expected at least one"),
    ],
)
def test_faulty_fit_files_are_refused(change, message):
    with pytest.raises(ConfigError, match=message):
        fit(**change)


@pytest.mark.parametrize(
    ("parameter", "message"),
    [
        ("bax.baseMass", "unknown object 'bax'|bax"),
        ("measured.bix.delay_s", "there is no measured signal 'bix'"),
        ("inputs.arm/target.gain", "expected inputs.SLOT.delay_s"),
    ],
)
def test_parameters_of_unknown_objects_are_refused(world, motion, parameter, message):
    config = fit(parameters={"x": {"set": parameter, "bounds": [0.0, 1.0]}})
    with pytest.raises(ConfigError, match=message):
        identify_world(world, motion, config, 1)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda a: a.update({"box/pose": a["box/pose"] * [1e6, 1, 1, 1, 1, 1, 1]}), "these look like millimetres"),
        (lambda a: a["time"].__setitem__(7, 0.0), "time does not increase after"),
        (lambda a: a.update(time=a["time"] + 100.0 * (np.arange(180) % 60 > 30)), "stamps, but they jump by 100 s"),
        (lambda a: a.pop("box/pose"), "has no measured signal"),
        (lambda a: a.update({"bax/pose": a.pop("box/pose")}), "run 0 lacks this signal; it has bax"),
    ],
)
def test_faulty_motion_is_refused(world, tmp_path, motion, spoil, message):
    arrays = dict(np.load(motion))
    spoil(arrays)
    with pytest.raises(ConfigError, match=message):
        identify_world(world, write(tmp_path / "spoilt.npz", arrays), fit(), 1)


def test_degrees_are_recognised(world, tmp_path):
    arrays = {"time": np.arange(9.0), "box/joints": np.full((9, 1), 90.0), "box/names": np.array(["j"])}
    with pytest.raises(ConfigError, match="these look like degrees"):
        identify_world(world, write(tmp_path / "joints.npz", arrays), fit(), 1)


def test_tables_are_read_from_csv(world, tmp_path, motion):
    arrays = dict(np.load(motion))
    names = [f"box.{part}" for part in ("x", "y", "z", "qx", "qy", "qz", "qw")]
    rows = np.column_stack([arrays["time"], arrays["box/pose"]])[:60]
    text = "\n".join([",".join(["time", *names]), *(",".join(map(repr, row)) for row in rows.tolist())])
    (tmp_path / "motion.csv").write_text(text)
    result = identify_world(world, tmp_path / "motion.csv", fit(runs={"count": 1}), 1)
    assert result.values["friction"] == pytest.approx(0.35, rel=0.05)


def test_a_bag_leads_to_the_same_values_as_a_table(world, tmp_path, motion):
    with rosbag.Bag(str(tmp_path / "motion.bag"), "w") as bag:
        arrays = dict(np.load(motion))
        for time_s, pose in zip((1.7e9 + arrays["time"][:60]).tolist(), arrays["box/pose"][:60].tolist()):
            message = Odometry()
            message.header.stamp = genpy.Time.from_sec(time_s)
            message.pose.pose.position = Point(*pose[:3])
            message.pose.pose.orientation = Quaternion(*pose[3:])
            bag.write("/rpbi/box/base_state", message, message.header.stamp)
    write(tmp_path / "first.npz", {key: arrays[key][:60] for key in ("time", "box/pose")})
    each = [identify_world(world, tmp_path / name, fit(runs={"count": 1}), 1) for name in ("motion.bag", "first.npz")]
    assert each[0].values == pytest.approx(each[1].values, rel=1e-3)
    assert each[0].values["friction"] == pytest.approx(0.35, rel=0.05)


def test_tosses_start_with_the_measured_state(tmp_path):
    config = FitConfig.parse(
        {
            "method": "cmaes",
            "objective": "mean_error",
            "evaluations": 12,
            "runs": {"count": 1},
            "measured": {"cube": {"object": "cube"}},
            "parameters": {"gravity": {"set": "world.setGravity.gravZ", "bounds": [-11.0, -8.0], "start": -9.605}},
        },
        "fit.yaml",
    )
    path = write(tmp_path / "cube_tosses.npz", toss_arrays(2, 20))
    result = identify_world(world_file("tosses/world.yaml"), path, config, 1)
    assert result.before.mean < 0.6  # a free fall from the measured state, integrated in ticks of 1 ms
