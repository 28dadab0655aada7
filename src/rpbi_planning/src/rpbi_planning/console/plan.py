"""The command `plan`."""

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

from custom_ros_tools.console.argument import Argument, UsageError, number
from custom_ros_tools.transforms import quat_of
from robot_model.geometry import Pose


def plan(
    world: Annotated[Path, Argument("WORLD.yaml", parse=Path, files="*.yaml")],
    robot: Annotated[str, Argument("ROBOT")],
    *,
    to: Annotated[Sequence[str], Argument("WORD ...")] = (),
    planner: Annotated[str, Argument("NAME")] = "rrt_connect",
    upright: Annotated[str, Argument("LINK")] = "",
    time_limit: Annotated[float, Argument("S", parse=number)] = 5.0,
    shorten: Annotated[float, Argument("S", parse=number)] = 0.3,
    speed: Annotated[float, Argument("FACTOR", parse=number)] = 1.0,
    padding: Annotated[float, Argument("M", parse=number)] = 0.01,
    seed: Annotated[int, Argument("N", parse=int)] = 0,
    foresee: Annotated[bool, Argument("")] = False,
    out: Annotated[Path | None, Argument("FILE.csv", parse=Path, files="*.csv")] = None,
) -> int:
    """Plans a motion of a robot in a world, from its start posture to a goal, without contact.

    Prints the waypoints and the times of the steps. The exit code is 0 only if a motion was found. The goal is one of:

        --to JOINT=POSITION ...           joint positions [rad or m], or degrees, such as 30deg
        --to LINK X Y Z [ROLL PITCH YAW]  position [m] and orientation [rad or deg] of a link in the world
        --to NAME                         a named posture, such as start

    Args:
        WORLD.yaml: main file of the world
        ROBOT: name of the robot in the world
        to: the goal, see above
        planner: planner; default: rrt_connect
        upright: link whose z axis stays vertical, up to 0.1 rad
        time-limit: longest search [s]; default: 5
        shorten: longest time for shortening [s]; default: 0.3
        speed: factor of the velocities, at most 1; default: 1
        padding: least distance from bodies [m]; default: 0.01
        seed: seed of random numbers; default: 0
        foresee: also simulates the motion in the world, and prints contacts and the largest efforts of the joints
        out: file for times, positions, velocities and accelerations of the motion
    """
    import pybullet

    from rpbi.world import World
    from rpbi_planning import PlanningScene, Upright
    from rpbi_planning import plan as find_plan

    if not to:
        raise UsageError("--to: expected a goal, got none")
    goal = goal_of(list(to))
    simulated = World.from_file(str(world), connection_mode=pybullet.DIRECT)
    try:
        scene = PlanningScene.of_world(simulated, padding_m=padding)
        try:
            result = find_plan(
                scene,
                robot,
                goal,
                constraints=(Upright(upright),) if upright else (),
                planner=planner,
                time_limit_s=time_limit,
                shorten_s=shorten,
                speed=speed,
                seed=seed,
                foresee=simulated if foresee else None,
            )
        except ValueError as error:
            raise UsageError(str(error)) from None
    finally:
        simulated.close()
    print(f"{result.planner}: {result.message}" if result.success else f"no plan: {result.message}")
    if result.trajectory is None:
        return 1
    for q in result.path:
        print("  ".join(f"{name} {position:.3f}" for name, position in zip(result.joint_names, q)))
    print(", ".join(f"{step} {1e3 * seconds:.0f} ms" for step, seconds in result.times_s.items()))
    if result.foreseen is not None:
        _print_foreseen(result.foreseen)
    if out is not None:
        _write(out, result)
    return 0


def goal_of(words: list[str]) -> Any:
    """Returns the goal that words of the command line describe.

    Raises:
        UsageError: If the words are no goal.
    """
    from rpbi_planning import JointGoal, NamedGoal, PoseGoal

    try:
        if all("=" in word for word in words):
            return JointGoal({name: number(text) for name, _, text in (word.partition("=") for word in words)})
        if len(words) == 1:
            return NamedGoal(words[0])
        if len(words) in (4, 7):
            x, y, z, *angles = map(number, words[1:])
            quat = quat_of(angles).tolist() if angles else (0.0, 0.0, 0.0, 1.0)
            return PoseGoal(words[0], Pose((x, y, z), tuple(quat)), orientation_tolerance=0.0 if angles else 3.15)
    except ValueError as error:
        raise UsageError(f"--to: {error}") from None
    message = "expected JOINT=POSITION ..., LINK X Y Z [ROLL PITCH YAW] or NAME"
    raise UsageError(f"--to: {message}, got {' '.join(words)}")


def _print_foreseen(foreseen: Any) -> None:
    print(f"foreseen: {len(foreseen.contacts)} contacts, state {foreseen.state_hash} after {foreseen.ticks} ticks")
    for time_s, first, second, force in foreseen.contacts:
        print(f"  {time_s:.3f} s: '{first}' and '{second}', {force:.1f} N")
    loads = sorted(foreseen.joint_loads.items(), key=lambda each: -each[1])
    print("largest efforts: " + ", ".join(f"{name} {load:.1f}" for name, load in loads[:3]))


def _write(path: Path, result: Any) -> None:
    trajectory = result.trajectory
    with path.open("w", newline="") as file:
        rows = csv.writer(file)
        kinds = ("position", "velocity", "acceleration")
        rows.writerow(["time", *(f"{kind} {name}" for kind in kinds for name in result.joint_names)])
        for time_s, *values in zip(
            trajectory.times, trajectory.positions, trajectory.velocities, trajectory.accelerations
        ):
            rows.writerow([time_s, *(number for each in values for number in each)])
