"""What contact is for: pushing, grasping and wiping."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from rpbi.control.joint_command import JointCommand
from rpbi.samples import ContactsSample
from rpbi.world import World

from .friction import FRICTION, KINDS
from .scene import GRAVITY, MAXIMAL, Cell, Table, box, box_floor, quat_about_z, run, scene

GRIP_N = 10.0
PRESS_N = 20.0
TOLD = {"contacts": {"hz": 1000, "arrows_hz": 0}}


def _link(name: str, mass_kg: float, shape: str = "", friction: float = 1.0) -> str:
    inertia = " ".join(f'i{a}{b}="{mass_kg / 1e3 if a == b else 0}"' for a, b in ("xx", "xy", "xz", "yy", "yz", "zz"))
    collision = f"<collision>{shape}</collision>" if shape else ""
    contact = f'<contact><lateral_friction value="{friction}"/></contact>' if shape else ""
    inertial = f'<inertial><mass value="{mass_kg}"/><inertia {inertia}/></inertial>'
    return f'<link name="{name}">{contact}{inertial}{collision}</link>'


def _slide(parent: str, child: str, axis: str, effort_n: float = 1000.0, origin: str = "0 0 0") -> str:
    return f"""<joint name="{child}_joint" type="prismatic"><parent link="{parent}"/><child link="{child}"/>
      <origin xyz="{origin}"/><axis xyz="{axis}"/>
      <limit lower="-2" upper="2" effort="{effort_n}" velocity="10"/></joint>"""


FINGER = '<geometry><box size="0.02 0.04 0.04"/></geometry>'
GRIPPER = f"""<robot name="gripper">{_link("mount", 1.0)}{_link("lift", 1.0)}
{_link("left", 0.1, FINGER)}{_link("right", 0.1, FINGER)}
{_slide("mount", "lift", "0 0 1")}
{_slide("lift", "left", "1 0 0", GRIP_N, "-0.065 0 0")}{_slide("lift", "right", "-1 0 0", GRIP_N, "0.065 0 0")}
</robot>"""
"""Two fingers, each of which presses with 10 N at most."""
PUSHER = f"""<robot name="pusher">{_link("mount", 1.0)}
{_link("head", 1.0, '<geometry><box size="0.02 0.08 0.02"/></geometry>', 0.0)}
{_slide("mount", "head", "1 0 0")}
</robot>"""
TIP = '<geometry><sphere radius="0.01"/></geometry>'


FACE = '<geometry><box size="0.04 0.04 0.02"/></geometry>'


def _gantry(tool: str, friction: float) -> str:
    """Returns a tool that pushes down with 20 N at most; along x it feels 6 kg, along y 2 kg."""
    return f"""<robot name="gantry">{_link("mount", 1.0)}{_link("x", 4.0)}{_link("y", 1.0)}
{_link("z", 1.0, tool, friction)}
{_slide("mount", "x", "1 0 0")}{_slide("x", "y", "0 1 0")}{_slide("y", "z", "0 0 1", PRESS_N)}
</robot>"""


def _robot(name: str, urdf: str, position: list[float], yaw: float = 0.0, **more: Any) -> dict[str, Any]:
    return {
        "name": name,
        "urdf": urdf,
        "loadURDF": {"useFixedBase": True, "basePosition": position, "baseOrientation": quat_about_z(yaw)},
        "setJointMotorControlArray": {"controlMode": "POSITION_CONTROL"},
        **more,
    }


def _move(world: World, robot: str, seconds: float, target: Callable[[float], dict[str, float]]) -> list[Any]:
    """Moves a robot for a time [s] by joint positions, a function of the share of that time; returns all samples."""
    samples = []
    ticks = round(seconds / world.config.timeStep)
    for tick in range(ticks):
        positions = target((tick + 1) / ticks)
        world.put(f"{robot}/target", JointCommand(list(positions), list(positions.values())))
        samples += world.step()
    return samples


FIRM = {"contactStiffness": 10_000.0, "contactDamping": 200.0}
"""Contacts that share a load, since none is stiffer than the others."""
GRASPS: dict[str, tuple[float, dict[str, Any], dict[str, Any]]] = {
    "time step 1 ms": (0.001, {}, {}),
    "time step 1 ms, `numSolverIterations: 200`": (
        0.001,
        {"numSolverIterations": 200, "solverResidualThreshold": 0.0},
        {},
    ),
    "time step 1 ms, `frictionAnchor: true`": (0.001, {}, {"frictionAnchor": True}),
    "time step 1 ms, `spinningFriction: 0.01`, `rollingFriction: 1.0e-6`": (
        0.001,
        {},
        {"spinningFriction": 0.01, "rollingFriction": 1e-6},
    ),
    "**time step 1 ms, `contactStiffness: 1.0e+4`, `contactDamping: 200`**": (0.001, {}, FIRM),
    "time step 2 ms, the same contact keys": (0.002, {}, FIRM),
    "time step 4.17 ms, the same contact keys": (1 / 240, {}, FIRM),
}


def grasping() -> Table:
    """How far a box of 1 kg slips and turns in a grasp of two fingers that hold it with 10 N each at friction 1."""
    rows = []
    for name, (time_step_s, engine, dynamics) in GRASPS.items():
        cells: list[Cell] = []
        for keys in KINDS.values():
            cells += _grasp(time_step_s, engine, dynamics, keys)
        rows.append((name, tuple(cells)))
    names = (f"{what}, {kind}" for kind in KINDS for what in ("slip [mm]", "rotation [deg]"))
    return Table(("setting", *names), rows)


def _grasp(
    time_step_s: float, engine: dict[str, Any], dynamics: dict[str, Any], keys: dict[str, Any]
) -> tuple[float, float]:
    """Returns how far a box slips [mm] and turns [deg] once it has been lifted."""
    thing = box("box", (0.05, 0.03, 0.05), changeDynamics={"lateralFriction": 1.0, **dynamics}, **keys)
    robots = [_robot("gripper", GRIPPER, [0.0, 0.0, 0.05])]
    floors = [box_floor(**keys)]
    with scene(time_step_s, engine, collision_objects=floors, dynamic_objects=[thing], robots=robots) as world:
        grip = {"left_joint": 0.05, "right_joint": 0.05}
        _move(world, "gripper", 0.5, lambda share: grip)
        _move(world, "gripper", 1.0, lambda share: {"lift_joint": 0.2 * share})
        start = _in_fingers(world)
        run(world, 2.0)
        return 1000.0 * (start - _in_fingers(world)), _tilt_deg(world, "box")


def _in_fingers(world: World) -> float:
    """Returns how high the box is over the lift of the gripper [m]."""
    gripper = world.bodies["gripper"]
    lift = world.pb.getJointState(gripper.body_id, 0)[0]
    return world.bodies["box"].base_pose().position[2] - lift


def _tilt_deg(world: World, name: str) -> float:
    """Returns the angle by which a body is turned [deg]."""
    return math.degrees(2 * math.acos(min(1.0, abs(world.bodies[name].base_pose().quat_xyzw[3]))))


def pushing() -> Table:
    """How hard a box is to push for 0.3 m in a straight line, how far it goes astray, and how it turns."""
    rows = []
    for degrees in (0.0, 20.0, 45.0):
        cells: list[Cell] = []
        yaw = math.radians(degrees)
        x, y = math.cos(yaw), math.sin(yaw)
        for keys in KINDS.values():
            thing = box("box", (0.05, 0.05, 0.02), yaw=yaw, changeDynamics={"lateralFriction": FRICTION}, **keys)
            robots = [_robot("pusher", PUSHER, [-0.065 * x, -0.065 * y, 0.011], yaw, **TOLD)]
            with scene(collision_objects=[box_floor(**keys)], dynamic_objects=[thing], robots=robots) as world:
                samples = _move(world, "pusher", 3.0, lambda share: {"head_joint": 0.3 * share})
                at = world.bodies["box"].base_pose().position
                turned = 2 * math.asin(world.bodies["box"].base_pose().quat_xyzw[2]) - yaw
            forces = [each.force for each in samples if isinstance(each, ContactsSample)][1000:]
            force = -sum(x * each[0] + y * each[1] for each in forces) / len(forces) / (FRICTION * GRAVITY)
            cells += [force, 1000.0 * abs(x * at[1] - y * at[0]), abs(math.degrees(turned))]
        rows.append((f"{degrees:g} deg", tuple(cells)))
    measured = ("push force / (mu m g)", "lateral deviation [mm]", "rotation [deg]")
    return Table(("direction of the push", *(f"{what}, {kind}" for kind in KINDS for what in measured)), rows)


MANY = {"numSolverIterations": 500, "solverResidualThreshold": 0.0}
PREDICTED = "direction error predicted from the effective masses [deg]"
WIPES: dict[str, tuple[dict[str, Any], dict[str, Any] | None]] = {
    "tip on the table": ({}, None),
    "pad": ({}, FIRM),
    "pad, 500 iterations": (MANY, FIRM),
}


def wiping() -> Table:
    """Friction of an object dragged over a table, relative to Coulomb's law, and the error of its direction."""
    rows = []
    for degrees in (0.0, 20.0, 45.0, 70.0, 90.0):
        cells: list[Cell] = []
        x, y = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
        for engine, pad in WIPES.values():
            cells += _wipe(x, y, engine, pad)
        by_masses = abs(math.degrees(math.atan2(2.0 * y, 6.0 * x)) - degrees)
        rows.append((f"{degrees:g} deg", (*cells, by_masses)))
    names = (f"{what}, {how}" for how in WIPES for what in ("friction / (mu N)", "direction error [deg]"))
    return Table(("direction of motion", *names, PREDICTED), rows)


def _wipe(x: float, y: float, engine: dict[str, Any], pad: dict[str, Any] | None) -> tuple[float, float]:
    """Returns friction on the table over that of Coulomb's law, and how far it is off the motion [deg].

    Args:
        x: Direction of the motion.
        y: The same.
        engine: Keys of `setPhysicsEngineParameter`.
        pad: Keys of `changeDynamics` of a pad in maximal coordinates under the tool; without it, the tool is a tip on
            the table.
    """
    if pad is None:
        things, tool = [], _robot("gantry", _gantry(TIP, FRICTION), [0.0, 0.0, 0.011])
    else:
        dynamics = {"lateralFriction": FRICTION, **pad}
        things = [box("pad", (0.03, 0.03, 0.01), baseMass=0.1, changeDynamics=dynamics, **MAXIMAL)]
        tool = _robot("gantry", _gantry(FACE, 4.0), [0.0, 0.0, 0.0305])
    table = box_floor(**MAXIMAL, **TOLD)
    objects = {"collision_objects": [table], "dynamic_objects": things, "robots": [tool]}
    with scene(engine=engine, gravity=(0.0, 0.0, 0.0), **objects) as world:
        _move(world, "gantry", 0.2, lambda share: {"z_joint": -0.1})
        samples = _move(world, "gantry", 1.0, lambda share: {"x_joint": 0.1 * share * x, "y_joint": 0.1 * share * y})
    forces = [each.force for each in samples if isinstance(each, ContactsSample)][500:]
    force_x, force_y, force_z = (sum(each[axis] for each in forces) / len(forces) for axis in range(3))
    off = math.atan2(x * force_y - y * force_x, x * force_x + y * force_y)
    return math.hypot(force_x, force_y) / (FRICTION * abs(force_z)), abs(math.degrees(off))
