"""Two arms in one description: they may not meet, wherever each of them may be alone."""

from __future__ import annotations

import pytest
from guarded_arm import decide, guard_of

from robot_model.model import RobotModel

TWO_ARMS = """<robot name="two_arms"><link name="table"/>
  <link name="left"><collision><geometry><box size="0.2 0.1 0.1"/></geometry></collision></link>
  <link name="right"><collision><geometry><box size="0.2 0.1 0.1"/></geometry></collision></link>
  <joint name="left_slide" type="prismatic"><parent link="table"/><child link="left"/><origin xyz="-0.5 0 0"/>
    <axis xyz="1 0 0"/><limit lower="0" upper="1" effort="1" velocity="2"/></joint>
  <joint name="right_slide" type="prismatic"><parent link="table"/><child link="right"/><origin xyz="0.5 0 0"/>
    <axis xyz="-1 0 0"/><limit lower="0" upper="1" effort="1" velocity="2"/></joint>
</robot>"""


def smooth(t: float) -> float:
    """Returns a share of a way, from rest to rest."""
    t = min(max(t, 0.0), 1.0)
    return t**3 * (10.0 - 15.0 * t + 6.0 * t**2)


@pytest.mark.parametrize("left_m, right_m, is_safe", [(0.7, 0.0, True), (0.0, 0.7, True), (0.5, 0.5, False)])
def test_arms_keep_away_from_each_other(tmp_path, left_m, right_m, is_safe):
    path = tmp_path / "two_arms.urdf"
    path.write_text(TWO_ARMS)
    guard = guard_of(RobotModel(str(path)), checks={"self_collision": {"margin_m": 0.05}})
    for k in range(301):
        share = smooth(k / 300.0)
        violation = decide(guard, (share * left_m, share * right_m)).violation
        if violation is not None:
            break
    assert (violation is None) == is_safe, violation
    if not is_safe:
        assert violation.check == "self_collision" and "'left' and 'right'" in str(violation)
        left, right = guard.last_command
        assert 1.0 - left - right - 0.2 >= 0.05
