"""Services of the node for time, objects, cameras, sensors and dynamics.

Only the simulation thread calls PyBullet; the handlers send requests to that thread.
"""

import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import genpy
from cob_srvs.srv import SetString, SetStringRequest
from std_srvs.srv import Trigger

from custom_ros_tools.config import load_config, load_configs
from custom_ros_tools.errors import InterfaceError, UnknownNameError
from custom_ros_tools.schema.type_names import shown
from robot_model.asset_files import find_file
from ros_pybullet_interface.msg import ObjectDynamics, PybulletObject
from ros_pybullet_interface.srv import (
    AddPybulletObject,
    AddPybulletObjectRequest,
    ApplyWrench,
    Attach,
    ChangeDynamicsRequest,
    ChangeObjectDynamics,
    ChangeObjectDynamicsRequest,
    GetObjectDynamics,
    GetObjectDynamicsRequest,
    GetStateHash,
    ListObjects,
    Predict,
    SetGravityRequest,
    SetRealTimeFactor,
    SetRealTimeFactorRequest,
    SetSensorRate,
    SetSensorRateRequest,
    StepN,
    StepNRequest,
    StepWithInputs,
    StepWithInputsRequest,
)
from ros_pybullet_interface.srv import ChangeDynamics as ChangeDynamicsService
from ros_pybullet_interface.srv import SetGravity as SetGravityService
from rpbi.bodies import BODY_TYPES
from rpbi.bodies.collision import CollisionObject
from rpbi.bodies.dynamic import DynamicObject
from rpbi.bodies.dynamics import LinkDynamics, difference
from rpbi.bodies.robots.robot import Robot
from rpbi.bodies.soft import SoftObject
from rpbi.bodies.urdf_object import UrdfObject
from rpbi.bodies.visual import VisualObject
from rpbi.config.object_entry import FILE, parse_object_entry
from rpbi.config.pybullet_models import ChangeDynamics
from rpbi.config.pybullet_world_models import SetGravity, SetPhysicsEngineParameter
from rpbi.config.sensors import RgbdSensorConfig
from rpbi.engine.clock import NS_PER_S
from rpbi.ros.attachments import apply_wrench, attach, detach
from rpbi.ros.endpoints import MAX_BYTES, Answer, Service
from rpbi.ros.headers import to_ros_time
from rpbi.ros.publishers.sample_topics import address
from rpbi.ros.requests import Requests
from rpbi.ros.simulation import Simulation
from rpbi.world.keyframes.maker import KeyframeMaker
from rpbi.world.loading import load_object, type_of

from .object_lifecycle import ObjectLifecycle
from .prediction import Predictor, cancel_prediction, planned_input, predict
from .states import restore, save, save_keyframe

log = logging.getLogger(__name__)

MAX_STEPS = 1_000_000
"""Largest number of ticks in one request."""
YAML_SUFFIXES = (".yaml", ".yml")
NO_FOLDER = "~config"
"""Stands for the path of the YAML file if the YAML was given as text."""
OBJECT_TYPES = {
    PybulletObject.VISUAL: VisualObject.section,
    PybulletObject.COLLISION: CollisionObject.section,
    PybulletObject.DYNAMIC: DynamicObject.section,
    PybulletObject.ROBOT: Robot.section,
    PybulletObject.SOFT: SoftObject.section,
    PybulletObject.URDF: UrdfObject.section,
}
"""Section of the main YAML file for each object type of the message PybulletObject."""


class NodeContext(NamedTuple):
    """Objects that the handlers of the node's services use.

    Attributes:
        simulation: The loop that runs the world.
        ask: Makes the simulation thread call a function.
        objects: Adds and removes objects, and resets the world.
        predictor: Predicts motion from the present state.
        loading: Context for loading the files of objects, see `load_object`.
        state_folder: Folder in which states are saved.
        keyframes: Makes keyframes between ticks.
    """

    simulation: Simulation
    ask: Requests
    objects: ObjectLifecycle
    predictor: Predictor
    loading: Mapping[str, Any]
    state_folder: Path
    keyframes: KeyframeMaker


def _start(node: NodeContext, _: Any) -> Answer:
    """Starts the world; `success` is false if it runs already."""
    has_started = node.ask(node.simulation.start)
    return Answer(has_started, "started" if has_started else "already running")


def _stop(node: NodeContext, _: Any) -> Answer:
    """Stops the world; `success` is false if it is stopped already."""
    has_stopped = node.ask(node.simulation.stop, even_if_busy=True)
    return Answer(has_stopped, "stopped" if has_stopped else "already stopped")


def _step(node: NodeContext, _: Any) -> Answer:
    """Advances a stopped world by one tick; the message is `tick N, stamp S`, with the stamp in seconds."""
    tick, stamp_ns = node.ask(node.simulation.step)
    seconds, nanoseconds = divmod(stamp_ns, NS_PER_S)
    return Answer(True, f"tick {tick}, stamp {seconds}.{nanoseconds:09d}")


def _step_n(node: NodeContext, request: StepNRequest) -> tuple[bool, str, int, genpy.Time]:
    """Advances a stopped world by up to a million ticks, as fast as possible."""
    try:
        if request.steps > MAX_STEPS:
            raise InterfaceError(f"steps: expected at most {MAX_STEPS}, got {request.steps}; ask again for more")
        tick, stamp_ns = node.ask.wait_for(node.ask(lambda: node.simulation.step_n(request.steps)))
        return True, f"{request.steps} ticks done", tick, to_ros_time(stamp_ns)
    except InterfaceError as error:
        clock = node.simulation.world.clock
        return False, str(error), clock.tick, to_ros_time(clock.stamp_ns)


def _step_with_inputs(node: NodeContext, request: StepWithInputsRequest) -> tuple[bool, str, int, genpy.Time]:
    """Advances the world by several ticks, as `rpbi/step_n` does, and applies each input of the request before the tick
    that the request gives for it.
    """
    waiting = sorted(map(planned_input, request.inputs), key=lambda each: each.tick)
    if waiting and waiting[-1].tick >= max(request.steps, 1):
        raise InterfaceError(f"{waiting[-1].slot}: expected a tick below {request.steps}, got {waiting[-1].tick}")
    done = 0
    while True:
        while waiting and waiting[0].tick <= done:
            _, slot, value = waiting.pop(0)
            node.simulation.world.put(slot, value)
        until = waiting[0].tick if waiting else request.steps
        answer = _step_n(node, StepNRequest(until - done))
        done = until
        if done == request.steps or not answer[0]:
            return answer


def _reset(node: NodeContext, _: Any) -> Answer:
    """Restores the initial state of the world, bit for bit; stamps continue."""
    node.objects.reset()
    return Answer(True, "the world is as configured")


def _state_hash(node: NodeContext, _: Any) -> tuple[bool, str, int, genpy.Time, int, str]:
    """Returns a hash of the world's state; worlds in the same state at the same tick have the same hash."""
    world, clock = node.simulation.world, node.simulation.world.clock
    return node.ask(
        lambda: (True, "", clock.tick, to_ros_time(clock.stamp_ns), world.resets, world.state_hash()), even_if_busy=True
    )


def _add_object(node: NodeContext, request: AddPybulletObjectRequest) -> Answer:
    """Adds an object from a YAML file or text; if the YAML is wrong, the message lists all its problems."""
    asked = request.pybullet_object
    try:
        section = OBJECT_TYPES.get(asked.object_type)
        if section is None:
            known = ", ".join(f"{number} ({name})" for number, name in OBJECT_TYPES.items())
            raise InterfaceError(f"object_type: expected one of {known}; got {asked.object_type}")
        data, file, path = _read_object(node, asked)
        kind = type_of(section, data)
        config = load_object(kind, data, file, {**node.loading, "file": path})
        node.objects.add(kind, config, file)
    except InterfaceError:
        raise
    except Exception as error:  # the caller must get an answer for any error in an object
        log.exception("adding an object failed with an unexpected error")
        return Answer(False, f"{type(error).__name__}: {error}")
    return Answer(True, f"added '{config.name}'")


def _read_object(node: NodeContext, asked: PybulletObject) -> tuple[dict[str, Any], str, str]:
    """Reads the YAML of an object from the file or text of a request.

    Returns:
        The YAML's content, the file's name for error messages, and the path of the file. Relative paths in the content
        are relative to the folder of the file. For text, the path is NO_FOLDER, and relative paths are searched only in
        the world's search paths and PyBullet's data, since the caller's working directory is unknown.
    """
    if asked.filename:
        path = _find(node, asked.filename, "filename")
        return load_config(path, MAX_BYTES), asked.filename, path
    if asked.config:
        return _read_text(node, asked.config, "config")
    raise InterfaceError("expected a filename or a config; got neither")


def _read_text(node: NodeContext, text: str, key: str) -> tuple[dict[str, Any], str, str]:
    """Reads YAML text: the keys of an object, or the key `file` and keys that override keys in that file.

    Returns the same values as `_read_object`. `key` is the request's field that contains the text, for error messages.
    """
    data = load_configs(text, key, MAX_BYTES)
    if FILE not in data:
        return data, key, NO_FOLDER
    try:
        entry = parse_object_entry(data)
    except ValueError as error:
        raise InterfaceError(f"{FILE}: {error}") from None
    path = _find(node, entry.file, FILE)
    return entry.apply_overrides(load_config(path, MAX_BYTES)), entry.file, path


def _add_camera(node: NodeContext, request: SetStringRequest) -> Answer:
    """Adds a camera from YAML text: the keys of `rgbd_sensor`, or `file` and keys that override keys in that file."""
    data, file, _ = _read_text(node, request.data, "data")
    config = RgbdSensorConfig.parse(data, file)
    node.objects.add_camera(config, file)
    return Answer(True, f"added '{config.name}'")


def _find(node: NodeContext, name: str, key: str) -> str:
    """Finds a YAML file and returns its path; refuses other files, so that clients cannot read them through services.

    `key` is the request's field that contains the file's name, for error messages.
    """
    if not name.lower().endswith(YAML_SUFFIXES):
        raise InterfaceError(f"{key}: expected the name of a YAML file ({', '.join(YAML_SUFFIXES)}), got {shown(name)}")
    try:
        return find_file(name, NO_FOLDER, node.loading["search_paths"])
    except ValueError as error:
        raise InterfaceError(f"{key}: {error}") from None


def _remove_object(node: NodeContext, request: SetStringRequest) -> Answer:
    """Removes the object or camera with a given name."""
    node.objects.remove(request.data)
    return Answer(True, f"removed '{request.data}'")


def _list_objects(node: NodeContext, _: Any) -> tuple[list[str], list[str]]:
    """Returns names and types of all objects and cameras."""
    world = node.simulation.world
    bodies, cameras = node.ask(lambda: (dict(world.bodies), list(world.cameras)), even_if_busy=True)
    types = [BODY_TYPES.name_of(body) for body in bodies.values()] + ["rgbd_sensor"] * len(cameras)
    return [*bodies, *cameras], types


def _get_dynamics(node: NodeContext, request: GetObjectDynamicsRequest) -> tuple[bool, str, ObjectDynamics]:
    """Returns the dynamics of an object or a link, such as mass and friction."""
    present = node.ask(lambda: node.simulation.world.dynamics(request.object_name))
    return True, "", ObjectDynamics(**present._asdict())


def _change_object_dynamics(node: NodeContext, request: ChangeObjectDynamicsRequest) -> Answer:
    """Changes those dynamics of an object or a link whose requested values differ from the present values."""
    world, asked = node.simulation.world, request.object_dynamics
    wanted = LinkDynamics(*(getattr(asked, field) for field in LinkDynamics._fields))

    def change() -> str:
        changed = difference(world.dynamics(request.object_name), wanted)
        if not changed:
            return "nothing differs"
        world.change_dynamics(request.object_name, ChangeDynamics(**changed))
        return f"changed {', '.join(changed)}"

    return Answer(True, node.ask(change))


def _change_dynamics(node: NodeContext, request: ChangeDynamicsRequest) -> Answer:
    """Changes the dynamics of an object or a link; the request has keys of `changeDynamics` as YAML text."""
    change = ChangeDynamics.parse(load_configs(request.config, "config", MAX_BYTES), "config")
    keys = ", ".join(change.kwargs())
    if not keys:
        raise InterfaceError("config: expected keys of changeDynamics, such as lateralFriction; got none")
    node.ask(lambda: node.simulation.world.change_dynamics(request.object_name, change))
    return Answer(True, f"changed {keys}")


def _set_real_time_factor(node: NodeContext, request: SetRealTimeFactorRequest) -> Answer:
    """Sets the real-time factor, which a reset does not change."""
    before = node.simulation.real_time_factor
    node.ask(lambda: node.simulation.set_real_time_factor(request.real_time_factor))
    stamps = "" if node.simulation.world.clock.simulated else "; stamps are wall time and do not show it"
    return Answer(True, f"{request.real_time_factor:g}, was {before:g}{stamps}")


def _set_gravity(node: NodeContext, request: SetGravityRequest) -> Answer:
    """Changes gravity, until the next reset."""
    asked = request.gravity
    change = SetGravity.parse({"gravX": asked.x, "gravY": asked.y, "gravZ": asked.z}, "gravity")
    node.ask(lambda: node.simulation.world.change_physics(change))
    return Answer(True, f"gravity is {asked.x:g}, {asked.y:g}, {asked.z:g} [m/s^2]")


def _set_engine_parameter(node: NodeContext, request: SetStringRequest) -> Answer:
    """Changes physics parameters until a reset; the request has keys of `setPhysicsEngineParameter` as YAML text."""
    data = load_configs(request.data, "data", MAX_BYTES)
    if "fixedTimeStep" in data:
        raise InterfaceError("data: fixedTimeStep: cannot change while the world runs; write timeStep in the main file")
    change = SetPhysicsEngineParameter.parse(data, "data")
    keys = ", ".join(change.kwargs())
    if not keys:
        raise InterfaceError("data: expected keys of setPhysicsEngineParameter, such as numSolverIterations; got none")
    node.ask(lambda: node.simulation.world.change_physics(change))
    return Answer(True, f"changed {keys}")


def _set_sensor_rate(node: NodeContext, request: SetSensorRateRequest) -> Answer:
    """Changes the rate [Hz] of a sensor until the next reset; 0 turns the sensor off."""
    world, wanted = node.simulation.world, request.sensor.removeprefix("/").removeprefix("rpbi/")

    def change() -> float:
        known = {
            address(sensor): (name, number)
            for name in (*world.bodies, *world.cameras)
            for number, sensor in enumerate(world.sensors_of(name))
        }
        if wanted not in known:
            raise UnknownNameError("sensor", wanted, list(known))
        name, number = known[wanted]
        before = world.sensors_of(name)[number].hz
        world.set_sensor_rate(name, number, request.hz)
        return before

    before = node.ask(change)
    return Answer(True, f"'{wanted}': {request.hz:g} Hz, was {before:g}")


NODE_SERVICES = (
    Service("rpbi/start", Trigger, _start),
    Service("rpbi/stop", Trigger, _stop),
    Service("rpbi/step", Trigger, _step),
    Service("rpbi/step_n", StepN, _step_n),
    Service("rpbi/step_with_inputs", StepWithInputs, _step_with_inputs),
    Service("rpbi/reset", Trigger, _reset),
    Service("rpbi/save", SetString, save),
    Service("rpbi/save_keyframe", SetString, save_keyframe),
    Service("rpbi/restore", SetString, restore),
    Service("rpbi/predict", Predict, predict),
    Service("rpbi/cancel_prediction", Trigger, cancel_prediction),
    Service("rpbi/add_pybullet_object", AddPybulletObject, _add_object),
    Service("rpbi/add_rgbd_sensor", SetString, _add_camera),
    Service("rpbi/remove_pybullet_object", SetString, _remove_object),
    Service("rpbi/list_objects", ListObjects, _list_objects),
    Service("rpbi/get_pybullet_object_dynamics", GetObjectDynamics, _get_dynamics),
    Service("rpbi/change_pybullet_object_dynamics", ChangeObjectDynamics, _change_object_dynamics),
    Service("rpbi/change_dynamics", ChangeDynamicsService, _change_dynamics),
    Service("rpbi/attach", Attach, attach),
    Service("rpbi/detach", SetString, detach),
    Service("rpbi/apply_wrench", ApplyWrench, apply_wrench),
    Service("rpbi/set_gravity", SetGravityService, _set_gravity),
    Service("rpbi/set_physics_engine_parameter", SetString, _set_engine_parameter),
    Service("rpbi/set_real_time_factor", SetRealTimeFactor, _set_real_time_factor),
    Service("rpbi/set_sensor_rate", SetSensorRate, _set_sensor_rate),
    Service("rpbi/get_state_hash", GetStateHash, _state_hash),
)
