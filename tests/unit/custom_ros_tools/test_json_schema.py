"""From configuration models to JSON Schemas that editors understand."""

from __future__ import annotations

import json
from typing import Annotated

import pytest
from jsonschema import Draft7Validator
from pydantic import BeforeValidator, Field

from custom_ros_tools.schema import AlsoTakes, ConfigModel, Hz, ListOf, Name, Position, PositiveMetres, Switch
from custom_ros_tools.schema.json_schema import (
    explained,
    json_schema,
    schema_text,
    unit_in,
    without_required,
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
def test_schema_takes_what_the_model_takes(data: dict[str, object]) -> None:
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
def test_schema_refuses_what_the_model_refuses(data: dict[str, object]) -> None:
    with pytest.raises(Exception, match=next(iter(data))):
        Outer.parse({"name": "a", **data}, "a.yaml")
    assert problems(**data)


def test_schema_has_no_references_so_that_each_key_has_its_explanation() -> None:
    assert "$ref" not in json.dumps(SCHEMA)
    assert SCHEMA["properties"]["inner"]["description"] == "What is inside."


def test_editors_are_not_told_to_type_in_defaults_that_say_nothing() -> None:
    assert "default" not in SCHEMA["properties"]["at"]
    assert SCHEMA["properties"]["hz"]["default"] == 50.0


def test_unit_is_that_of_the_numbers_in_a_value() -> None:
    properties = SCHEMA["properties"]
    assert [unit_in(properties[key]) for key in ("name", "hz", "at")] == [None, "Hz", "m"]
    assert unit_in(properties["inner"]["properties"]["range"]) == "m"


def test_explanation_ends_with_unit_and_default_also_inside_of_mappings() -> None:
    properties = explained(SCHEMA)["properties"]
    assert properties["hz"]["description"] == "How often. [Hz] Default: 50."
    assert properties["inner"]["properties"]["range"]["description"] == "Near and far. [m]"
    assert SCHEMA["properties"]["hz"]["description"] == "How often."


def test_without_required_keys_nothing_has_to_be_there() -> None:
    partial = without_required(SCHEMA)
    assert list(Draft7Validator(partial).iter_errors({"inner": {}})) == []
    assert list(Draft7Validator(partial).iter_errors({"inner": {"range": 1}}))


def test_text_reads_back_and_has_short_things_in_one_line() -> None:
    text = schema_text(SCHEMA)
    assert json.loads(text) == SCHEMA
    assert max(map(len, text.splitlines())) <= 120
    assert '"required": ["name"]' in text


@pytest.mark.parametrize(
    ("value", "text"),
    [(True, "true"), (50.0, "50"), (0.02, "0.02"), ([0.0, 1.0], "[0, 1]"), ("GUI", "GUI")],
)
def test_defaults_are_shown_as_one_would_write_them(value: object, text: str) -> None:
    assert yaml_text(value) == text
