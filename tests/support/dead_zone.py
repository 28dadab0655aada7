"""What users write: a mapping of their own, and an operator node in the manner of the release."""

import math

from sensor_msgs.msg import Joy

from operator_node.mappings.mapping import AxesConfig, Mapping
from operator_node.node import OperatorNode


class DeadZone(Mapping):
    """One axis, which is 0 near its middle."""

    Config = AxesConfig
    size = 1

    def __init__(self, config: AxesConfig) -> None:
        self._config = config

    def map(self, axes):
        """Returns the signal."""
        (axis,) = self._config.pick(axes)
        return (axis if abs(axis) > 0.1 else 0.0,)


class Polar(OperatorNode):
    """Publishes length and angle of two axes; a button divides by zero."""

    def post_init(self) -> None:
        """Reads the configuration."""
        self.gain = self.config["gain"]

    def callback(self, joy: Joy) -> None:
        """Publishes the signal."""
        x, y = joy.axes
        self.publish([self.gain * math.hypot(x, y) / (not any(joy.buttons)), math.atan2(y, x)])


if __name__ == "__main__":
    Polar().spin()
