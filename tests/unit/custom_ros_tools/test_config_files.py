"""YAML files are read safely and strictly, and paths may name ROS packages."""

from __future__ import annotations

from pathlib import Path

import pytest

from custom_ros_tools.config import config_to_str, load_config, load_configs, replace_package, ros_package_path
from custom_ros_tools.errors import ConfigError


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A ROS package named `my_robot` on ROS_PACKAGE_PATH."""
    folder = tmp_path / "workspace" / "my_robot"
    folder.mkdir(parents=True)
    (folder / "package.xml").write_text(
        "<package><name>my_robot</name><version>1.0.0</version><description>x</description>"
        "<maintainer email='a@b.c'>a</maintainer><license>x</license></package>"
    )
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(folder.parent))
    return folder


def test_package_is_found_on_ros_package_path(package: Path) -> None:
    assert ros_package_path("my_robot") == str(package)


def test_packages_of_this_workspace_are_found_where_nothing_is_sourced(monkeypatch: pytest.MonkeyPatch) -> None:
    sources = Path(__file__).resolve().parents[3] / "src"
    monkeypatch.delenv("ROS_PACKAGE_PATH")
    assert ros_package_path("rpbi_examples") == str(sources / "rpbi_examples")


def test_ros_package_path_precedes_packages_of_this_workspace(package: Path) -> None:
    other = package.parent / "rpbi_examples"
    other.mkdir()
    (other / "package.xml").write_text((package / "package.xml").read_text().replace("my_robot", "rpbi_examples"))
    assert ros_package_path("rpbi_examples") == str(other)


@pytest.mark.parametrize("path", ["{my_robot}/a/b.yaml", "package://my_robot/a/b.yaml"])
def test_package_in_a_path_is_resolved(package: Path, path: str) -> None:
    assert replace_package(path) == f"{package}/a/b.yaml"


def test_only_the_first_package_is_resolved(package: Path) -> None:
    assert replace_package("{my_robot}/{x}.yaml") == f"{package}/{{x}}.yaml"


def test_path_without_package_stays(package: Path) -> None:
    assert replace_package("/a/b.yaml") == "/a/b.yaml"


def test_unknown_package_is_named_with_a_suggestion(package: Path) -> None:
    with pytest.raises(ConfigError, match=r"^unknown ROS package 'my_robt'; did you mean 'my_robot'\?$"):
        replace_package("{my_robt}/a.yaml")


def test_unknown_package_without_similar_name_reports_the_searched_path(package: Path) -> None:
    with pytest.raises(ConfigError, match=f"unknown ROS package 'zebra' .ROS_PACKAGE_PATH is {package.parent}"):
        replace_package("package://zebra/a.yaml")


def test_file_in_a_package_is_read(package: Path) -> None:
    (package / "a.yaml").write_text("hz: 1.0e-3\nnames: [a, b]\n")
    assert load_config("{my_robot}/a.yaml") == {"hz": 0.001, "names": ["a", "b"]}


def test_empty_text_is_an_empty_mapping() -> None:
    assert load_configs("# nothing\n") == {}


LONG = f"1{':59' * 60}"[:57]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("a: 1\nb: [1, 2\nc: 3\n", "w.yaml: line 3, column 2: expected ',' or ']', but got ':'"),
        ("a: 1\n\tb: 2\n", "w.yaml: line 2, column 1: found character '\\\\t' that cannot start any token"),
        (
            "hz: 1\nlens:\n  fov: 1\n  fov: 2\n",
            "w.yaml: line 4, column 3: key 'fov' is given twice (first in line 3)",
        ),
        ("a: 1\nb: 2\na: 3\n", "w.yaml: line 3, column 1: key 'a' is given twice (first in line 1)"),
        ("- 1\n- 2\n", "w.yaml: expected a mapping of keys to values, got list"),
        ("just text", "w.yaml: expected a mapping of keys to values, got str"),
        ("a: *nobody\n", "w.yaml: line 1, column 4: found undefined alias 'nobody'"),
        ("a: 1\n---\nb: 2\n", "w.yaml: line 2, column 1: but found another document"),
        ("a: !!bool 3\n", "w.yaml: line 1, column 4: expected a value of the type bool, got '3'"),
        ('a: !!int ""\n', "w.yaml: line 1, column 4: expected a value of the type int, got ''"),
        ("a: [!!timestamp x]\n", "w.yaml: line 1, column 5: expected a value of the type timestamp, got 'x'"),
        ("a: !!set [b]\n", "w.yaml: line 1, column 4: expected a mapping node, but found sequence"),
        ("a: !!set b\n", "w.yaml: line 1, column 4: expected a mapping node, but found scalar"),
        ("!!seq a: 1\n", "w.yaml: line 1, column 1: found unhashable key"),
        ("a: 2001-14-01\n", "w.yaml: line 1, column 4: expected a value of the type timestamp, got '2001-14-01'"),
        pytest.param(
            f"a: 1{':59' * 300}.0\n",
            f"w.yaml: line 1, column 4: expected a value of the type float, got '{LONG}...'",
            id="a float of many minutes",
        ),
        pytest.param(
            f"a: !!int 1{':59' * 1000}\n",
            f"w.yaml: line 1, column 4: expected a value of the type int, got '{LONG}...'",
            id="an integer of many minutes",
        ),
        ("a: \x00", "w.yaml: is not YAML: unacceptable character #x0000: special characters are not allowed"),
    ],
)
def test_faulty_yaml_is_reported_with_line_and_column(text: str, told: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load_configs(text, "w.yaml")
    assert str(caught.value).replace("\\t", "\\\\t") == told


@pytest.mark.parametrize("text", [f"1{':59' * 1000}", "1" * 1001, f"2001-01-01 {' ' * 1000}01:01:01"])
def test_longer_values_than_any_number_are_texts(text: str) -> None:
    assert load_configs(f"a: {text}\n") == {"a": text}


def test_yaml_cannot_run_code(tmp_path: Path) -> None:
    trap = tmp_path / "trap"
    text = f"a: !!python/object/apply:pathlib.Path.touch [!!python/object/apply:pathlib.Path ['{trap}']]"
    with pytest.raises(ConfigError, match="line 1, column 4: could not determine a constructor"):
        load_configs(text)
    assert not trap.exists()


def test_merged_key_may_be_overridden() -> None:
    assert load_configs("a: &a {x: 1, y: 2}\nb: {<<: *a, x: 3}\n")["b"] == {"x": 3, "y": 2}


@pytest.mark.parametrize(("name", "told"), [("none.yaml", "no such file or directory"), ("folder", "is a directory")])
def test_unreadable_file_is_reported(tmp_path: Path, name: str, told: str) -> None:
    (tmp_path / "folder").mkdir()
    with pytest.raises(ConfigError, match=f"^{tmp_path / name}: {told}$"):
        load_config(str(tmp_path / name))


def test_file_that_is_not_text_is_reported(tmp_path: Path) -> None:
    (tmp_path / "image.yaml").write_bytes(b"\x89PNG\xff\xfe")
    with pytest.raises(ConfigError, match="is not UTF-8 text"):
        load_config(str(tmp_path / "image.yaml"))


def test_text_of_a_mapping_reads_back_in_order() -> None:
    config = {"z": 1.0e-3, "a": {"names": ["x", "y"], "on": True, "none": None, "text": "1e-3"}}
    again = load_configs(config_to_str(config))
    assert again == config
    assert list(again) == ["z", "a"]
