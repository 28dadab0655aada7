"""Named contact settings that were identified from measured motion, see docs/reality.md."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from pydantic import Field, ValidationInfo, model_validator

from custom_ros_tools.errors import hint
from custom_ros_tools.schema import ConfigModel, KeyedError, Text


class ContactPreset(NamedTuple):
    """Contact settings of a named preset.

    Attributes:
        body: Keys of the moving body. The other body has friction and restitution 1.
        world: Keys of the main file.
    """

    body: Mapping[str, Any]
    world: Mapping[str, Any]


CONTACT_PRESETS: dict[str, ContactPreset] = {
    "impact": ContactPreset(
        {
            "changeDynamics": {
                "lateralFriction": 0.173,
                "restitution": 0.0675,
                "contactStiffness": 10350.0,
                "contactDamping": 48.5,
                "linearDamping": 0.0,
                "angularDamping": 0.0,
            },
            "contactFriction": {"edge": 0.173, "face": 0.191},
        },
        {"timeStep": 0.00168918919},
    ),
    "bounce": ContactPreset(
        {"changeDynamics": {"linearDamping": 0.0, "angularDamping": 0.0}},
        {"timeStep": 0.001, "setPhysicsEngineParameter": {"contactERP": 0.0}},
    ),
    "pushing": ContactPreset({"changeDynamics": {"lateralFriction": 0.19, "restitution": 0.0}}, {"timeStep": 0.004}),
}
"""Presets, indexed by name. A body's own keys, and those of a main file, replace the preset's keys."""


class WithContactPreset(ConfigModel):
    """Base class of models with the key `contact_preset`; the preset's values are defaults of other keys."""

    contact_preset: Text | None = Field(
        None,
        description="Named contact settings that were identified from measured motion: "
        f"{', '.join(f'`{name}`' for name in CONTACT_PRESETS)}; see docs/reality.md. Other keys of this file replace "
        "values of the preset. By default, no preset.",
    )

    @model_validator(mode="before")
    @classmethod
    def _with_preset(cls, data: Any, info: ValidationInfo) -> Any:
        name = data.get("contact_preset") if isinstance(data, Mapping) else None
        if not isinstance(name, str) or not name:
            return data
        if name not in CONTACT_PRESETS:
            raise KeyedError("contact_preset", f"there is no preset '{name}'{hint(name, CONTACT_PRESETS)}")
        preset = CONTACT_PRESETS[name]
        if "changeDynamics" not in cls.model_fields:
            return _completed(data, preset.world)
        return _completed(data, preset.body)


def _completed(data: Mapping[str, Any], defaults: Mapping[str, Any]) -> dict[str, Any]:
    """Adds missing keys, also to inner mappings; null counts as missing."""
    result = dict(data)
    for key, default in defaults.items():
        given = result.get(key)
        if given is None:
            result[key] = dict(default) if isinstance(default, Mapping) else default
        elif isinstance(given, Mapping) and isinstance(default, Mapping):
            result[key] = _completed(given, default)
    return result
