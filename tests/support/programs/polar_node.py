"""What users write: an operator node in the manner of the release."""

import math

from sensor_msgs.msg import Joy

from operator_node.node import OperatorNode


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
