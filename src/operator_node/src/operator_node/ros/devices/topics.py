"""Topics of a device other than `joy`."""

from collections.abc import Callable

import rospy

from operator_node.device import Device, Reading


class DeviceTopics:
    """Publishes the events of a device, and subscribes to its inputs; base class.

    Args:
        device: The device.
        post: Schedules an action in the thread of the device; every access to the device has to use it.
    """

    def __init__(self, device: Device, post: Callable[[Callable[[], None]], None]) -> None:
        self.device, self.post = device, post

    def publish(self, reading: Reading, stamp: rospy.Time) -> None:
        """Publishes the parts of a reading other than axes and buttons."""
