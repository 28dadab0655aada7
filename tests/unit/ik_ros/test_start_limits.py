"""Starts outside limits are brought in, and told of once."""

from __future__ import annotations

import logging

from ik_ros.solver import StartLimits
from robot_model.limits import Limits


def test_each_joint_outside_limits_is_reported_once(caplog):
    starts = StartLimits(("a", "b"), Limits((-1.0, -1.0), (1.0, 1.0), (False, False)))
    with caplog.at_level(logging.WARNING, "ik_ros"):
        for start, inside in [
            ((2.0, 0.0), [1.0, 0.0]),
            ((0.5, 0.0), [0.5, 0.0]),
            ((3.0, 0.0), [1.0, 0.0]),
            ((0.0, -2.0), [0.0, -1.0]),
            ((2.0, -2.0), [1.0, -1.0]),
            ((2.0, 0.0), [1.0, 0.0]),
        ]:
            assert starts.wrap_to_limits(start) == inside
    told = "the start is outside limits and is moved within them: "
    assert [record.getMessage() for record in caplog.records] == [told + "'a' 2", told + "'b' -2"]
