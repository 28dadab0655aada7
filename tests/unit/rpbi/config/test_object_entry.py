"""Several objects of one file."""

from __future__ import annotations

import pytest
import yaml
from worlds import box, iiwa, write_world

from custom_ros_tools.errors import ConfigError
from rpbi.config.object_entry import parse_object_entry
from rpbi.world import World


def test_changes_replace_values_and_merge_mappings_and_alter_neither():
    data = {"name": "a", "loadURDF": {"fileName": "x.urdf", "useFixedBase": True}, "list": [1, 2]}
    entry = {"file": "a.yaml", "name": "b", "loadURDF": {"basePosition": [1, 0, 0]}, "list": [3]}
    instance = parse_object_entry(entry)
    assert instance.file == "a.yaml"
    assert instance.apply_overrides(data) == {
        "name": "b",
        "loadURDF": {"fileName": "x.urdf", "useFixedBase": True, "basePosition": [1, 0, 0]},
        "list": [3],
    }
    assert data["name"] == "a" and data["loadURDF"] == {"fileName": "x.urdf", "useFixedBase": True}
    assert entry["file"] == "a.yaml"


def test_null_removes_a_key():
    data = {"name": "a", "controllers": {"push": {"type": "force"}, "hold": {"type": "force"}}}
    kept = parse_object_entry({"file": "a.yaml", "controllers": {"push": None}}).apply_overrides(data)
    assert kept == {"name": "a", "controllers": {"hold": {"type": "force"}}}
    assert parse_object_entry({"file": "a.yaml", "controllers": None, "hz": None}).apply_overrides(data) == {
        "name": "a"
    }


@pytest.mark.parametrize("entry", [3, None, "", {}, {"name": "b"}, {"file": 3}, ["a.yaml"]])
def test_an_entry_without_a_file_is_refused(entry):
    with pytest.raises(ValueError, match="expected a file name, or a mapping with 'file'"):
        parse_object_entry(entry)


def _world(tmp_path, **lists):
    path = write_world(tmp_path, robots=(iiwa(),), dynamic=(box(),))
    main = yaml.safe_load(open(path).read())
    for section, entries in lists.items():
        (file,) = main[section]
        main[section] = [{"file": file, **entry} for entry in entries]
    open(path, "w").write(yaml.safe_dump(main))
    return path


def test_entry_overrides_name_pose_and_colour_and_keeps_the_rest(tmp_path):
    red = {"name": "red", "basePosition": [1, 0, 1], "createVisualShape": {"rgbaColor": [1, 0, 0, 1]}}
    world = World.from_file(
        _world(
            tmp_path,
            dynamic_objects=[red, {"name": "plain"}],
            robots=[{"name": "left"}, {"name": "right", "loadURDF": {"basePosition": [0, 2, 0]}}],
        )
    )
    try:
        assert list(world.bodies) == ["red", "plain", "left", "right"]
        assert world.bodies["red"].base_pose().position == pytest.approx((1.0, 0.0, 1.0))
        assert world.bodies["right"].base_pose().position == pytest.approx((0.0, 2.0, 0.0), abs=1e-6)
        (shape,) = world.pb.getVisualShapeData(world.bodies["red"].body_id)
        assert shape[7] == (1.0, 0.0, 0.0, 1.0)
    finally:
        world.close()


def test_faults_in_the_changes_name_file_entry_and_key(tmp_path):
    with pytest.raises(ConfigError) as caught:
        World.from_file(_world(tmp_path, dynamic_objects=[{"name": "a", "baseMas": 2.0}, {"baseMass": -1.0}]))
    first, second = caught.value.problems
    assert "changed by dynamic_objects[0]" in str(first) and "unknown key 'baseMas'; did you mean" in str(first)
    assert "changed by dynamic_objects[1]" in str(second) and "baseMass: must be > 0" in str(second)
