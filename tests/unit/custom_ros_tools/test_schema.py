"""Models are strict, tell all problems at once in the user's words, and never touch what they are given."""

from __future__ import annotations

import copy
import json
import pickle
from typing import Annotated, Any, Literal

import pytest
from pydantic import Field, ValidationError, model_validator

from custom_ros_tools.errors import ConfigError
from custom_ros_tools.schema import (
    ConfigModel,
    FrameId,
    Hz,
    KeyedError,
    ListOf,
    Name,
    Position,
    Positive,
    Quat,
    Switch,
    Text,
    Unit,
    Vec3,
)


class Lens(ConfigModel):
    """A lens."""

    fov: float = Field(40.0, gt=0, lt=180, description="Opening.", json_schema_extra={"unit": "deg"})
    range: Annotated[tuple[float, float], Field(strict=False), Unit("m")] = Field((0.1, 10.0), description="Range.")

    @model_validator(mode="after")
    def _in_order(self) -> Lens:
        if self.range[0] > self.range[1]:
            raise KeyedError("range", "near is beyond far")
        return self


class Camera(ConfigModel):
    """A camera."""

    name: Name = "camera"
    hz: Hz = Field(description="Rate.")
    lens: Lens = Lens()
    spares: ListOf[Lens] = ()
    mode: Literal["colour", "depth"] = "colour"
    count: int = 1
    on: Switch = True
    position: Position = (0.0, 0.0, 0.0)
    path: ListOf[Vec3] = ()
    quat: Quat = (0.0, 0.0, 0.0, 1.0)
    frame: FrameId | None = None
    offsets: dict[str, float] = {}
    gain: Positive | None = None
    file: Text = "x"


def problems(**data: Any) -> list[str]:
    """Returns the problems of a camera, each as `key: message`."""
    with pytest.raises(ConfigError) as caught:
        Camera.parse({"hz": 1, **data}, "f")
    return [f"{problem.key}: {problem.message}" for problem in caught.value.problems]


@pytest.mark.parametrize(
    ("key", "value", "expected"),
    [
        ("hz", 0, "hz: must be > 0 [Hz], got 0"),
        ("hz", "1e-3", "hz: expected a number [Hz], got text '1e-3': YAML reads 1e-3 as text: write 1.0e-3"),
        (
            "hz",
            "2.5E3",
            "hz: expected a number [Hz], got text '2.5E3': YAML reads 2.5E3 as text: write 2.5e+3",
        ),
        ("hz", "50", "hz: expected a number [Hz], got text '50': write it without quotes"),
        ("hz", "fast", "hz: expected a number [Hz], got text 'fast'"),
        ("hz", True, "hz: expected a number [Hz], got true"),
        ("hz", None, "hz: expected a number [Hz], got nothing"),
        ("hz", float("nan"), "hz: must be a finite number [Hz], got .nan"),
        ("hz", float("-inf"), "hz: must be a finite number [Hz], got -.inf"),
        ("hz", [1], "hz: expected a number [Hz], got [1]"),
        ("gain", 0, "gain: must be > 0, got 0"),
        ("count", 1.5, "count: expected a whole number, got 1.5"),
        ("count", True, "count: expected a whole number, got true"),
        ("on", 2, "on: expected true or false, got 2"),
        ("mode", "dept", "mode: must be 'colour' or 'depth', got text 'dept'"),
        ("file", "", "file: expected text, got text ''"),
        ("lens", 3, "lens: expected a mapping, got 3"),
        ("lens", {"fov": 180}, "lens.fov: must be < 180 [deg], got 180"),
        (
            "lens",
            {"range": [1, "2"]},
            "lens.range[1]: expected a number [m], got text '2': write it without quotes",
        ),
        ("lens", {"range": [1]}, "lens.range: expected a list of 2 numbers [m], got 1"),
        ("lens", {"range": 1}, "lens.range: expected a list of 2 numbers [m], got 1"),
        ("lens", {"range": [2, 1]}, "lens.range: near is beyond far"),
        ("lens", {"fv": 3}, "lens.fv: unknown key 'fv'; did you mean 'fov'?"),
        ("lens", {"zebra": 3}, "lens.zebra: unknown key 'zebra'; known are fov, range"),
        ("spares", [{}, {"fov": 0}], "spares[1].fov: must be > 0 [deg], got 0"),
        ("spares", [{"rnge": 0}], "spares[0].rnge: unknown key 'rnge'; did you mean 'range'?"),
        ("position", [1, 2, 3, 4], "position: expected a list of 3 numbers [m], got 4"),
        ("path", [[0, 0, 0], [1, 2]], "path[1]: expected a list of 3 numbers, got 2"),
        ("path", "x", "path: expected a list of lists of 3 numbers, got text 'x'"),
        ("quat", [0, 0, 0, 0], "quat: a quaternion cannot be all zeros; no rotation is [0, 0, 0, 1]"),
        ("offsets", {"a": True}, "offsets.a: expected a number, got true"),
        ("offsets", [1], "offsets: expected a mapping, got [1]"),
        (
            "name",
            "a b",
            "name: use letters, digits and '_' only (topics and frames are named after it), got 'a b'",
        ),
        ("frame", "/a", "frame: a TF frame has no spaces and neither starts nor ends with '/', got '/a'"),
    ],
)
def test_fault_is_reported_with_key_path_expected_and_given_value(key: str, value: Any, expected: str) -> None:
    assert problems(**{key: value}) == [expected]


def test_missing_key_is_reported_with_its_expected_value() -> None:
    with pytest.raises(ConfigError) as caught:
        Camera.parse({}, "camera.yaml")
    assert str(caught.value) == "camera.yaml: hz: missing, expected a number [Hz]"


def test_all_faults_are_reported_at_once() -> None:
    assert problems(hz=-1, lens={"fov": "wide", "rang": 1}, count="x", extra=1) == [
        "hz: must be > 0 [Hz], got -1",
        "lens.fov: expected a number [deg], got text 'wide'",
        "lens.rang: unknown key 'rang'; did you mean 'range'?",
        "count: expected a whole number, got text 'x'",
        "extra: unknown key 'extra'; known are count, file, frame, gain, hz, lens, mode, name, "
        "offsets, on, path, position, quat, spares",
    ]


def test_data_that_is_no_mapping_is_refused() -> None:
    with pytest.raises(ConfigError, match="f: expected a mapping of keys to values, got list"):
        Camera.parse([1], "f")  # type: ignore[arg-type]


@pytest.mark.parametrize("key", [7, None, True, (1, 2)])
def test_key_that_is_no_text_is_refused(key: Any) -> None:
    with pytest.raises(ConfigError, match="unknown key '"):
        Camera.parse({key: 1, "hz": 1}, "f")


def test_fault_stays_on_one_line_and_is_short() -> None:
    (told,) = problems(hz="one\ntwo " * 100)
    assert "\n" not in told
    assert len(told) < 150


def test_text_that_unfolds_without_end_is_shown_shortened() -> None:
    nested: list[Any] = ["lol"]
    for _ in range(60):
        nested = [nested] * 9
    (told,) = problems(hz=nested)
    assert len(told) < 150


def test_whole_number_too_large_for_a_float_is_refused() -> None:
    assert len(problems(hz=10**400)) == 1


def test_values_written_as_pybullet_users_do_are_accepted() -> None:
    camera = Camera.parse({"hz": 30, "on": 0, "position": [1, 2, 3], "quat": [0, 0, 2, 0]}, "f")
    assert (camera.hz, camera.on) == (30.0, False)
    assert isinstance(camera.hz, float)
    assert camera.position == (1.0, 2.0, 3.0)
    assert camera.quat == (0.0, 0.0, 1.0, 0.0)


def test_input_is_neither_changed_nor_kept() -> None:
    data = {"hz": 1, "offsets": {"a": 1}, "path": [[1, 2, 3]], "lens": {"range": [1, 2]}}
    before = copy.deepcopy(data)
    camera = Camera.parse(data, "f")
    assert data == before
    data["offsets"]["a"] = 5  # type: ignore[index]
    assert camera.offsets == {"a": 1.0}


def test_model_cannot_be_changed() -> None:
    camera = Camera.parse({"hz": 1}, "f")
    with pytest.raises(ValidationError, match="frozen"):
        camera.hz = 2.0


def test_model_survives_pickling_with_only_the_written_keys() -> None:
    camera = Camera.parse({"hz": 1, "lens": {"fov": 30}}, "f")
    again = pickle.loads(pickle.dumps(camera))
    assert again == camera
    assert again.model_dump(exclude_unset=True) == {"hz": 1.0, "lens": {"fov": 30.0}}


def test_json_schema_carries_units_and_descriptions() -> None:
    schema = json.loads(json.dumps(Camera.model_json_schema()))
    assert schema["properties"]["hz"] == {
        "description": "Rate.",
        "exclusiveMinimum": 0,
        "title": "Hz",
        "type": "number",
        "unit": "Hz",
    }
    assert schema["$defs"]["Lens"]["properties"]["fov"]["unit"] == "deg"
    assert schema["additionalProperties"] is False


def test_normalised_quaternion_is_bitwise_unchanged_by_another_normalisation():
    class Turned(ConfigModel):
        quat: Quat

    once = Turned(quat=(0.0, 0.0, 0.259, 0.966)).quat
    assert Turned(quat=once).quat == once
