"""docs/devices.md, or a page of its own, tells of every option of every device, with its default."""

from __future__ import annotations

from pathlib import Path

import pytest

from custom_ros_tools.schema.json_schema import yaml_text
from operator_node.devices import DEVICES
from operator_node.devices.device_feed import FeedConfig

DOCS = Path(__file__).resolve().parents[3] / "docs"
PAGES = {"mvn": "motion_capture.md"}
"""Of devices that have a page of their own."""
MODELS = {"feed": FeedConfig, **{name: DEVICES.find(name).Config for name in DEVICES}}


@pytest.mark.parametrize("model", MODELS)
def test_page_has_every_option_with_its_default(model):
    page = (DOCS / PAGES.get(model, "devices.md")).read_text()
    for key, field in MODELS[model].model_fields.items():
        (row,) = (line for line in page.splitlines() if line.startswith((f"| `{key}` |", f"| `~{key}` |")))
        told = row.split("|")[2].strip().strip("`")
        assert field.default is None or told == yaml_text(field.default), row
