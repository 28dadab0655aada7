"""Names of PyBullet constants become their numbers, and wrong ones are refused."""

from __future__ import annotations

from typing import Annotated, Any

import pybullet
import pytest

from custom_ros_tools.errors import ConfigError
from custom_ros_tools.schema import ConfigModel
from custom_ros_tools.schema.json_schema import json_schema
from rpbi.config import pybullet_args
from rpbi.config.pybullet_args import CONNECTION_MODES, SHAPE_TYPES, URDF_FLAGS, Constants

FAMILIES = [family for family in vars(pybullet_args).values() if isinstance(family, Constants)]


@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.kind)
def test_every_name_is_a_pybullet_constant(family: Constants) -> None:
    assert family.names
    for name in family.names:
        assert family.parse(name) == (family.own[name] if name in family.own else getattr(pybullet, name))


@pytest.mark.parametrize(
    ("given", "value"),
    [
        ("URDF_USE_SELF_COLLISION", 8),
        ("URDF_USE_SELF_COLLISION|URDF_USE_INERTIA_FROM_FILE", 10),
        (" URDF_USE_SELF_COLLISION | URDF_USE_INERTIA_FROM_FILE ", 10),
        (["URDF_USE_SELF_COLLISION", 2], 10),
        (["URDF_USE_SELF_COLLISION|URDF_USE_INERTIA_FROM_FILE", 8], 10),
        (10, 10),
        ([], 0),
    ],
)
def test_flags_are_names_numbers_or_lists_of_both(given: Any, value: int) -> None:
    assert URDF_FLAGS.parse(given) == value


def test_exclusive_constant_is_a_name_or_number_of_its_family() -> None:
    assert SHAPE_TYPES.parse("GEOM_BOX") == SHAPE_TYPES.parse(3) == pybullet.GEOM_BOX


@pytest.mark.parametrize(
    ("family", "given", "told"),
    [
        (SHAPE_TYPES, "GEOM_BX", "unknown shape type 'GEOM_BX'; did you mean 'GEOM_BOX'?"),
        (SHAPE_TYPES, "geom_box", "unknown shape type 'geom_box'; did you mean 'GEOM_BOX'?"),
        (SHAPE_TYPES, 77, "expected a shape type (GEOM_SPHERE, "),
        (SHAPE_TYPES, True, "got true"),
        (SHAPE_TYPES, ["GEOM_BOX"], "got ['GEOM_BOX']"),
        (CONNECTION_MODES, "GEOM_BOX", "unknown connection mode 'GEOM_BOX'; known are DIRECT, "),
        (URDF_FLAGS, "URDF_USE_SELF_COLLISION|URDF_X", "unknown URDF flag 'URDF_X'"),
        (URDF_FLAGS, -1, "expected URDF flags such as "),
        (URDF_FLAGS, 1.5, "got 1.5"),
        (URDF_FLAGS, [None], "got nothing"),
    ],
)
def test_values_outside_the_family_are_refused(family: Constants, given: Any, told: str) -> None:
    with pytest.raises(ValueError) as caught:
        family.parse(given)
    assert told in str(caught.value)


def test_field_holds_the_number_and_its_schema_lists_the_names() -> None:
    class Shape(ConfigModel):
        kind: Annotated[int, SHAPE_TYPES]

    assert Shape.parse({"kind": "GEOM_BOX"}, "f").kind == pybullet.GEOM_BOX
    assert "GEOM_BOX" in json_schema(Shape, "shape")["properties"]["kind"]["enum"]
    with pytest.raises(ConfigError, match="^f: kind: missing, expected a shape type"):
        Shape.parse({}, "f")
