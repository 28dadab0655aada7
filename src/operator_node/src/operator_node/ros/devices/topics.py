"""What a device publishes beside `joy`, and takes."""

from collections.abc import Callable

import rospy

from operator_node.device import Device, Reading


class DeviceTopics:
    """Publishes what is native to a device, and takes what it is sent; derive from it.

    Args:
        device: The device.
        post: Has the device's thread do something with it; whatever is done to the device goes by this.
    """

    def __init__(self, device: Device, post: Callable[[Callable[[], None]], None]) -> None:
        self.device, self.post = device, post

    def publish(self, reading: Reading, stamp: rospy.Time) -> None:
        """Publishes what a reading has beside axes and buttons."""
