"""A transform is read from the arguments of a command, and all that is wrong with them is told."""

from __future__ import annotations

import pytest

from custom_ros_tools.errors import ConfigError
from custom_ros_tools.transforms import StaticTransform


def test_roll_pitch_yaw_and_quaternion_say_the_same() -> None:
    by_angles = StaticTransform.from_arguments("1 -2 3e-1 0 0 1.5707963267948966 world box".split())
    by_quat = StaticTransform.from_arguments("1 -2 0.3 0 0 2 2 world box".split())
    assert by_angles.position == (1.0, -2.0, 0.3)
    assert (by_angles.parent, by_angles.child) == ("world", "box")
    assert by_angles.quat_xyzw == pytest.approx(by_quat.quat_xyzw)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ("", "expected 'x y z roll pitch yaw PARENT CHILD' or 'x y z qx qy qz qw PARENT CHILD', got none"),
        ("1 2 3 world box", "got 5 arguments"),
        ("1 2 up 0 0 left world box", "arguments: z: expected a number, got 'up'\narguments: yaw: expected a number"),
        ("nan 0 0 0 0 0 world box", "arguments: position[0]: must be a finite number [m], got .nan"),
        ("0 0 0 0 inf 0 world box", "arguments: roll, pitch, yaw: must be finite, got 0, inf, 0"),
        ("0 0 0 0 0 0 0 world box", "arguments: quaternion: must not be zero"),
        ("0 0 0 0 0 0 world world", "arguments: child: must be another frame than the parent, got 'world'"),
        ("0 0 0 0 0 0 /world box", "arguments: parent: a TF frame has no spaces"),
    ],
)
def test_faulty_arguments_are_reported(arguments: str, told: str) -> None:
    with pytest.raises(ConfigError) as caught:
        StaticTransform.from_arguments(arguments.split())
    assert told in str(caught.value)


def test_faults_of_numbers_and_frames_are_reported_together() -> None:
    with pytest.raises(ConfigError) as caught:
        StaticTransform.from_arguments("1 up nan 0 0 0 0 /world box".split())
    assert [problem.key for problem in caught.value.problems] == ["y", "", "parent", "position[2]"]
    with pytest.raises(ConfigError) as caught:
        StaticTransform.from_arguments("0 0 0 left 0 0 0 world world".split())
    assert [problem.key for problem in caught.value.problems] == ["qx", "child"], "a zero quaternion it need not be"
