"""What inverse kinematics is asked is checked field by field before anything is solved."""

import math

import pytest

from rpbi.kinematics import IKProblem

HERE = (0.4, 0.1, 0.6)
NULL_SPACE = {
    "lowerLimits": [-1.0, -1.0],
    "upperLimits": [1.0, 1.0],
    "jointRanges": [2.0, 2.0],
    "resetPoses": [0.0, 0.0],
}


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"targetPosition": (0.4, 0.1)}, "targetPosition: expected 3 values, got 2"),
        ({"targetPosition": (0.4, math.nan, 0.1)}, r"targetPosition: values must be finite, .* got \(0.4, nan, 0.1\)"),
        ({"targetPosition": (0.4, 1e200, 0.1)}, r"targetPosition: .* 1e\+09 at most; got .*1e\+200"),
        ({"targetOrientation": (0.0, 0.0, 1.0)}, "targetOrientation: expected 4 values or none, got 3"),
        ({"targetOrientation": (0.0, 0.0, 0.0, 0.0)}, "targetOrientation: must not be zero"),
        ({"targetOrientation": (0.0, 0.0, math.inf, 0.0)}, "targetOrientation: values must be finite"),
        ({"lowerLimits": [0.0]}, "upperLimits, jointRanges, resetPoses: missing; .* go together"),
        ({"jointDamping": [-0.1]}, "jointDamping: values must not be negative"),
        ({"currentPosition": [math.nan]}, "currentPosition: values must be finite"),
        ({"solver": 2}, "solver: expected 0 .* or 1 .*, got 2"),
        ({"maxNumIterations": -1}, "maxNumIterations: must not be negative, got -1"),
        ({"residualThreshold": -1e-3}, "residualThreshold: must not be negative"),
        ({"residualThreshold": math.nan}, "residualThreshold: must not be negative, got nan"),
    ],
)
def test_invalid_fields_are_refused_by_name(fields, message):
    with pytest.raises(ValueError, match=message):
        IKProblem("tool", **{"targetPosition": HERE, **fields})


@pytest.mark.parametrize("field", ["lowerLimits", "jointDamping", "currentPosition"])
def test_list_needs_one_value_for_each_named_joint(field):
    fields = NULL_SPACE if field in NULL_SPACE else {field: [0.1, 0.1]}
    problem = IKProblem("tool", HERE, **fields)
    problem.check_lengths(["a", "b"])
    with pytest.raises(ValueError, match=f"{field}: expected 3 values, one for each of a, b, c; got 2"):
        problem.check_lengths(["a", "b", "c"])
