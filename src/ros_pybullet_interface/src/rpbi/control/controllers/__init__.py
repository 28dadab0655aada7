"""Table of the controller types. To add a type, write a class in its own file, and add a line here."""

from custom_ros_tools.plugin_table import PluginTable

from .controller import Controller, ControllerConfig

CONTROLLERS: PluginTable[Controller] = PluginTable(
    "controller",
    "rpbi.control.controllers.controller:Controller",
    {
        "joint_impedance": "rpbi.control.controllers.joint_impedance:JointImpedanceController",
        "cartesian_impedance": "rpbi.control.controllers.cartesian_impedance:CartesianImpedanceController",
        "force": "rpbi.control.controllers.force:ForceController",
    },
    suggests=False,
)

__all__ = ["CONTROLLERS", "Controller", "ControllerConfig"]
