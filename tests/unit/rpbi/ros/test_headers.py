"""Times and headers equal those that their constructors make."""

from __future__ import annotations

import genpy
import pytest
from std_msgs.msg import Header

from rpbi.ros.headers import stamped_header, to_ros_time


@pytest.mark.parametrize("stamp_ns", [0, 999_999_999, 1_000_000_000, 1_700_000_000_123_456_789])
def test_stamps_keep_all_nanoseconds(stamp_ns):
    time = to_ros_time(stamp_ns)
    assert type(time) is genpy.Time
    assert (time.secs, time.nsecs) == divmod(stamp_ns, 1_000_000_000)


def test_headers_equal_constructed_ones():
    assert stamped_header(3_000_000_005, "rpbi/world") == Header(0, genpy.Time(3, 5), "rpbi/world")
