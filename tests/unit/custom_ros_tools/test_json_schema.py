"""From configuration models to JSON Schemas that editors understand."""

from __future__ import annotations

import json
import threading
from typing import Annotated

import pytest
from jsonschema import Draft7Validator
from pydantic import BeforeValidator, ConfigDict, Field

from custom_ros_tools.errors import ConfigError
from custom_ros_tools.schema import AlsoTakes, ConfigModel, Hz, ListOf, Name, Position, PositiveMetres, Switch
from custom_ros_tools.schema.json_schema import (
    explained,
    json_schema,
    json_schemas,
    mapping_in,
    resolved,
    schema_text,
    unit_in,
    yaml_text,
)


class Inner(ConfigModel):
    """Something inside."""

    range: Annotated[tuple[PositiveMetres, PositiveMetres], Field(strict=False)] = Field(description="Near and far.")


class Outer(ConfigModel):
    """Something outside."""

    name: Name = Field(description="Its name.")
    hz: Hz = Field(50.0, description="How often.")
    is_on: Switch = Field(False, description="Whether it is on.")
    at: Position | None = Field(None, description="Where it is.")
    inner: Inner | None = Field(None, description="What is inside.")
    gains: Annotated[
        ListOf[float],
        BeforeValidator(lambda given: [given] if isinstance(given, float) else given),
        AlsoTakes({"type": "number"}),
    ] = Field((), description="Gains.")


SCHEMA = json_schema(Outer, "outer")


def problems(**data: object) -> list[str]:
    """Returns what the schema finds wrong."""
    return [each.message for each in Draft7Validator(SCHEMA).iter_errors({"name": "a", **data})]


@pytest.mark.parametrize(
    "data",
    [
        {},
        {"hz": 1, "is_on": 1, "at": [0, 0, 1.5], "inner": {"range": [0.1, 2]}, "gains": 1.0},
        {"is_on": True, "at": None, "inner": None, "gains": [1, 2.5]},
    ],
)
def test_schema_accepts_values_that_the_model_accepts(data: dict[str, object]) -> None:
    Outer.parse({"name": "a", **data}, "a.yaml")
    assert problems(**data) == []


@pytest.mark.parametrize(
    "data",
    [
        {"name": "a b"},
        {"hz": 0},
        {"is_on": 2},
        {"at": [0, 0]},
        {"inner": {}},
        {"inner": {"range": [0.1, 2, 3]}},
        {"gains": "1"},
        {"other": 1},
    ],
)
def test_schema_refuses_values_that_the_model_refuses(data: dict[str, object]) -> None:
    with pytest.raises(ConfigError, match=next(iter(data))):
        Outer.parse({"name": "a", **data}, "a.yaml")
    assert problems(**data)


def test_mapping_is_defined_once_and_each_key_keeps_its_description() -> None:
    inner = SCHEMA["properties"]["inner"]
    assert inner["description"] == "What is inside."
    assert mapping_in(inner, SCHEMA) == {"$ref": "#/$defs/Inner"}
    assert resolved({"$ref": "#/$defs/Inner"}, SCHEMA)["description"] == "Something inside."
    assert list(SCHEMA["$defs"]) == ["Inner"]


class Other(ConfigModel):
    """Something else with the same inside."""

    inners: ListOf[Inner] = Field((), description="Several.")


def test_schemas_of_several_files_share_mappings_without_unused_ones() -> None:
    both = json_schemas({"outer": Outer, "other": Other, "inner": Inner})
    assert both["outer"] == SCHEMA
    assert both["other"]["$defs"] == SCHEMA["$defs"]
    assert "$defs" not in both["inner"]


def test_equivalent_types_of_a_union_share_one_schema() -> None:
    assert SCHEMA["properties"]["hz"]["type"] == "number"
    assert SCHEMA["properties"]["at"]["type"] == ["array", "null"]
    assert [each["type"] for each in SCHEMA["properties"]["gains"]["anyOf"]] == ["array", "number"]


def test_types_without_a_schema_are_left_to_the_model() -> None:
    class Odd(ConfigModel):
        """A model of something that JSON does not have."""

        model_config = ConfigDict(arbitrary_types_allowed=True)
        thing: threading.Event = Field(description="Something.")

    assert json_schema(Odd, "odd")["properties"]["thing"] == {"description": "Something."}
    with pytest.raises(ConfigError, match="thing: missing, expected a value"):
        Odd.parse({}, "odd.yaml")


def test_meaningless_defaults_are_omitted_for_editors() -> None:
    assert "default" not in SCHEMA["properties"]["at"]
    assert SCHEMA["properties"]["hz"]["default"] == 50.0


def test_unit_applies_to_numbers_inside_a_value() -> None:
    properties = SCHEMA["properties"]
    assert [unit_in(properties[key]) for key in ("name", "hz", "at")] == [None, "Hz", "m"]
    assert unit_in(SCHEMA["$defs"]["Inner"]["properties"]["range"]) == "m"


def test_explanation_ends_with_unit_and_default_also_inside_of_mappings() -> None:
    schema = explained(SCHEMA)
    assert schema["properties"]["hz"]["description"] == "How often. [Hz] Default: 50."
    assert schema["$defs"]["Inner"]["properties"]["range"]["description"] == "Near and far. [m]"
    assert schema["properties"]["inner"]["anyOf"][0] == {"$ref": "#/$defs/Inner", "description": "What is inside."}
    assert SCHEMA["properties"]["hz"]["description"] == "How often."


def test_text_reads_back() -> None:
    assert json.loads(schema_text(SCHEMA)) == SCHEMA


@pytest.mark.parametrize(
    ("value", "text"),
    [(True, "true"), (50.0, "50"), (0.02, "0.02"), ([0.0, 1.0], "[0, 1]"), ("GUI", "GUI")],
)
def test_defaults_are_shown_as_one_would_write_them(value: object, text: str) -> None:
    assert yaml_text(value) == text
