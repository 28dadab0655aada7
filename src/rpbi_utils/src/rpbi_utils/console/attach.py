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
    """Attaches one thing to another at their present poses, until it is detached or breaks off.

        ./rpbi attach box panda/panda_hand --max-force 20
        ./rpbi detach box

    Args:
        CHILD, PARENT: objects, or links as OBJECT/LINK
        name: by which it is detached; without it, the child's
        ball: the position alone is held, it may turn
        max_force: breaks off beyond it [N]; without it, it never does
        ns: of the simulator, if it was started in one
    """
    attachment = Attachment(
        name=name or child.partition("/")[0],
        parent=parent,
        child=child,
        kind="ball" if ball else "fixed",
        max_force=max_force,
    )
    return str(RunningSimulator(ns).call("rpbi/attach", Attach, attachment).message)
