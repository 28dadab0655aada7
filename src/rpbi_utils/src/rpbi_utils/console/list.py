"""The command `list`."""

from custom_ros_tools.foreign import printable

from .running_simulator import Namespace, RunningSimulator


def list(*, ns: Namespace = None) -> str:
    """Lists the objects in the running world, with types.

    Args:
        ns: of the simulator, if it was started in one
    """
    objects = {printable(name): printable(kind) for name, kind in RunningSimulator(ns).objects().items()}
    width = max(map(len, objects), default=0)
    return "\n".join(f"{name:<{width}}  {kind}" for name, kind in objects.items()) or "nothing"
