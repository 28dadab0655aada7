"""The command `attach`."""

from typing import Annotated

from custom_ros_tools.console.argument import Argument, number
from ros_pybullet_interface.msg import Attachment
from ros_pybullet_interface.srv import Attach

from .running_simulator import OBJECTS, Namespace, RunningSimulator


def attach(
    child: Annotated[str, Argument("CHILD", offers=OBJECTS)],
    parent: Annotated[str, Argument("PARENT", offers=OBJECTS)],
    *,
    name: Annotated[str | None, Argument("NAME")] = None,
    ball: Annotated[bool, Argument("")] = False,
    max_force: Annotated[float, Argument("N", parse=number)] = 0.0,
    ns: Namespace = None,
) -> str:
    """Attaches an object to another object at their present relative pose.

        ./rpbi attach box panda/panda_hand --max-force 20
        ./rpbi detach box

    Args:
        CHILD, PARENT: objects, or links written as OBJECT/LINK
        name: name of the attachment, as used by `detach`; default: name of the child object
        ball: holds only the position; the child may rotate freely
        max_force: force above which the attachment breaks [N]; without this option, it never breaks
        ns: namespace of the simulator; default: ROS_NAMESPACE
    """
    attachment = Attachment(
        name=name or child.partition("/")[0],
        parent=parent,
        child=child,
        kind="ball" if ball else "fixed",
        max_force=max_force,
    )
    return str(RunningSimulator(ns).call("rpbi/attach", Attach, attachment).message)
