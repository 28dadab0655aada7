"""The command `spawn`."""

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any

from cob_srvs.srv import SetString

from custom_ros_tools.config import config_to_str, load_config
from custom_ros_tools.console.argument import Argument, number
from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.schema import ConfigModel
from custom_ros_tools.transforms import quat_of
from robot_model.asset_files import find_file
from ros_pybullet_interface.msg import PybulletObject
from ros_pybullet_interface.srv import AddPybulletObject
from rpbi.config.object_entry import FILE

from .running_simulator import Namespace, RunningSimulator

CAMERA = "camera"
Numbers = list[float] | None


def kinds() -> Iterator[str]:
    """Yields the type names that can be added to a world: all object types, then `camera`."""
    from rpbi.bodies import BODY_TYPES  # slow to import, and rarely needed

    yield from BODY_TYPES
    yield CAMERA


def spawn(
    file: Annotated[str, Argument("FILE", files="*.@(yaml|urdf)")],
    *,
    name: Annotated[str | None, Argument("NAME")] = None,
    at: Annotated[Numbers, Argument("X Y Z", parse=number)] = None,
    rpy: Annotated[Numbers, Argument("ROLL PITCH YAW", parse=number)] = None,
    type: Annotated[str | None, Argument("TYPE", choices=kinds)] = None,
    ns: Namespace = None,
) -> str:
    """Adds an object, a robot or a camera to the running world.

    A URDF file alone makes a free-floating object without motors. With --type robot, it makes a robot with a fixed base
    and position-controlled joints. The simulator reads the files on its own computer.

        ./rpbi spawn box.yaml --name second_box --at 0.5 0 1
        ./rpbi spawn kuka_iiwa/model.urdf --type robot --name arm

    Args:
        FILE: YAML file of the object or camera, or a URDF file; may have the form {package}/PATH
        name: name of the object; default: the name in the YAML file, or the URDF's file name
        at: position in the world frame [m], instead of basePosition
        rpy: orientation as fixed-axis angles [rad], instead of baseOrientation
        type: {choices};
            default: the type whose keys fit the file best
        ns: namespace of the simulator; default: ROS_NAMESPACE
    """
    simulator = RunningSimulator(ns)
    try:
        path = find_file(file, str(Path.cwd() / FILE))
    except ValueError as error:
        raise InterfaceError(str(error)) from None
    is_urdf = Path(path).suffix == ".urdf"
    data = _urdf_object(path, type) if is_urdf else load_config(path)
    kind = type or kind_in(data)
    changes: dict[str, Any] = {} if name is None else {"name": name}
    changes |= _placement(data, at, rpy)
    if kind == CAMERA:
        if at or rpy:
            raise InterfaceError(f"{file}: a camera is where its object_tf says, not --at or --rpy")
        return str(simulator.call("rpbi/add_rgbd_sensor", SetString, config_to_str({FILE: path, **changes})).message)
    object_type = getattr(PybulletObject, kind.upper(), None)
    if object_type is None:  # `type` in the YAML data overrides this number
        object_type, changes["type"] = PybulletObject.VISUAL, kind
    asked = PybulletObject(object_type=object_type)
    if is_urdf:
        asked.config = config_to_str(
            {**data, **changes, "loadURDF": {**data["loadURDF"], **changes.get("loadURDF", {})}}
        )
    elif changes:
        asked.config = config_to_str({FILE: path, **changes})
    else:
        asked.filename = path
    return str(simulator.call("rpbi/add_pybullet_object", AddPybulletObject, asked).message)


def kind_in(data: Mapping[str, Any]) -> str:
    """Returns the object type, or `camera`, whose configuration model fits the keys of YAML data best.

    Models are compared by these criteria, in this order: whether all required keys are given, how many given keys the
    model knows, how many keys the model requires, and how few keys the model has in total.
    """
    from rpbi.bodies import BODY_TYPES
    from rpbi.config.sensors import RgbdSensorConfig

    def fit(model: type[ConfigModel]) -> tuple[bool, int, int, int]:
        fields = model.model_fields
        required = {key for key, field in fields.items() if field.is_required()} - {"name"}
        return required <= data.keys(), len(fields.keys() & data.keys()), len(required), -len(fields)

    models: dict[str, type[ConfigModel]] = {**BODY_TYPES.configs(), CAMERA: RgbdSensorConfig}
    return max(models, key=lambda kind: fit(models[kind]))


def _urdf_object(path: str, kind: str | None) -> dict[str, Any]:
    """Returns YAML data for an object that is described only by the URDF file `path`.

    For the kind `robot`, the base is fixed and the joints are position-controlled. For all other kinds, the base is
    free and there are no motors.
    """
    name = re.sub(r"\W", "_", Path(path).stem)
    if kind != "robot":
        return {"name": name, "loadURDF": {"fileName": path}}
    motors = {"controlMode": "POSITION_CONTROL"}
    return {"name": name, "loadURDF": {"fileName": path, "useFixedBase": True}, "setJointMotorControlArray": motors}


def _placement(data: Mapping[str, Any], at: Numbers, rpy: Numbers) -> dict[str, Any]:
    """Returns the YAML keys and values that place an object at position `at` [m] with angles `rpy` [rad]."""
    keys: dict[str, Any] = {} if at is None else {"basePosition": at}
    if rpy is not None:
        keys["baseOrientation"] = quat_of(rpy).tolist()
    inner = next((key for key in ("loadURDF", "loadSoftBody") if key in data), None)
    return {inner: keys} if inner and keys else keys
