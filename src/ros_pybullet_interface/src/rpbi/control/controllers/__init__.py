"""The types of controllers that live in the tick; a new one is a class in a file of its own and a line here."""

from custom_ros_tools.plugins import ClassTable, find_class

from .controller import Controller, ControllerConfig

CONTROLLERS = ClassTable(
    {
        "joint_impedance": "rpbi.control.controllers.joint_impedance:JointImpedanceController",
        "cartesian_impedance": "rpbi.control.controllers.cartesian_impedance:CartesianImpedanceController",
        "force": "rpbi.control.controllers.force:ForceController",
    }
)


def controller_class(kind: str) -> type[Controller]:
    """Returns the class of controllers that YAML asks for by a key of CONTROLLERS or by `module:Class`.

    Raises:
        ValueError: If there is none.
    """
    found: type[Controller] = CONTROLLERS[kind] if kind in CONTROLLERS else find_class(kind, Controller)
    return found


__all__ = ["CONTROLLERS", "Controller", "ControllerConfig", "controller_class"]
