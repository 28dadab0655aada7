"""Topics of another package, one of which does its part wrong, for tests."""

from __future__ import annotations

from std_msgs.msg import Float64

from rpbi.ros.endpoints import Topic

PUSH = Topic("rpbi/{name}/push", Float64, lambda message: message.data)
PUSH_X = Topic("rpbi/{name}/push", Float64, lambda message: message.data.x)
