"""The robot like Nextage as it is seen."""

from __future__ import annotations

import pytest

from custom_ros_tools.config import replace_package
from robot_model.urdf.document import UrdfDocument


@pytest.mark.parametrize("name", ["nextage", "nextage_gripper"])
def test_no_gap_is_seen_from_the_chest_to_the_head(name):
    document = UrdfDocument(replace_package(f"{{rpbi_examples}}/robots/{name}.urdf"))
    spans, height = [], 0.0
    for joint in ("CHEST_JOINT0", "HEAD_JOINT0", "HEAD_JOINT1"):
        height += document.joints[joint].xyz[2]
        for visual in document.root.iterfind(f"link[@name='{joint}_Link']/visual"):
            centre = height + float(visual.find("origin").get("xyz").split()[2])
            shape = visual.find("geometry")[0]
            is_lying = visual.find("origin").get("rpy", "0 0 0") != "0 0 0"
            length = 2.0 * float(shape.get("radius", 0)) if is_lying else float(shape.get("length", 0))
            half = (length or float(shape.get("size", "0 0 0").split()[2])) / 2.0
            spans.append((centre - half, centre + half))
    spans.sort()
    top = spans[0][1]
    for low, high in spans[1:]:
        assert low < top, f"nothing between {top:g} and {low:g} m"
        top = max(top, high)
