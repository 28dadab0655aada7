"""The command `list`."""

from custom_ros_tools.foreign import printable

from .running_simulator import Namespace, RunningSimulator


def list(*, ns: Namespace = None) -> str:
    """Lists the names and types of the objects in the running world.

    Args:
        ns: namespace of the simulator; default: ROS_NAMESPACE
    """
    objects = {printable(name): printable(kind) for name, kind in RunningSimulator(ns).objects().items()}
    width = max(map(len, objects), default=0)
    return "\n".join(f"{name:<{width}}  {kind}" for name, kind in objects.items()) or "nothing"
