"""Draws docs/images/guard.png: a simulated arm is driven at the table and into itself, without the guard and with it.

./rpbi shell -c "python3 dev/tools/guard_figure.py docs/images/guard.png"
"""

import random
import sys
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pybullet
import yaml

from robot_model.collision.distances import Pair
from robot_model.model import RobotModel
from rpbi.world import World
from safe_robot.check import CheckContext
from safe_robot.checks.environment import Environment
from safe_robot.checks.self_collision import SelfCollision
from safe_robot.config import GuardConfig
from safe_robot.guard import Guard

LWR = str(Path(__file__).resolve().parents[2] / "src/rpbi_examples/robots/kuka_lwr.urdf")
PERIOD_S, DURATION_S, SHOWN_S = 0.01, 4.0, 5.0
MARGIN_M = 0.02
TABLE_SIZE, TABLE_AT = (0.5, 0.8, 0.08), (-0.05, 0.0, 0.04)
HOME = np.radians((0.0, 30.0, 0.0, -90.0, 0.0, 60.0, 0.0))
AT_TABLE = HOME + np.radians((0.0, 25.0, 0.0, 0.0, 0.0, 0.0, 0.0))
CAMERA = {"cameraTargetPosition": (0.35, 0.0, 0.25), "distance": 1.6, "yaw": 20.0, "pitch": -20.0, "roll": 0.0}
WIDTH, HEIGHT = 480, 400


def write_world(folder: Path) -> str:
    """Writes an arm and a table, and returns the main file."""
    half = [size / 2.0 for size in TABLE_SIZE]
    table = {
        "name": "table",
        "createVisualShape": {"shapeType": "GEOM_BOX", "halfExtents": half, "rgbaColor": [0.7, 0.5, 0.3, 1.0]},
        "createCollisionShape": {"shapeType": "GEOM_BOX", "halfExtents": half},
        "basePosition": list(TABLE_AT),
    }
    (folder / "table.yaml").write_text(yaml.safe_dump(table))
    main = {
        "setGravity": {"gravZ": -9.81},
        "timeStep": 0.002,
        "collision_objects": [str(folder / "table.yaml")],
        "robots": ["{rpbi_examples}/configs/basic_example_kuka_lwr/kuka_lwr.yaml"],
    }
    (folder / "world.yaml").write_text(yaml.safe_dump(main))
    return str(folder / "world.yaml")


def new_guard(robot: RobotModel, world: str) -> Guard:
    """Returns a guard that knows the table."""
    options = {
        "period_s": PERIOD_S,
        "start_from": "target",
        "limits": {"acceleration": 10.0, "jerk": 1000.0},
        "checks": {"environment": {"world": world, "margin_m": MARGIN_M}, "self_collision": {"margin_m": MARGIN_M}},
    }
    guard = Guard(GuardConfig.parse(options, "figure"), robot, "figure")
    guard.start()
    return guard


def distances_m(guard: Guard, q: np.ndarray, kind: type) -> dict[Pair, float]:
    """Returns the distances of the pairs of a check [m]; negative if they penetrate."""
    (check,) = (each for each in guard.checks if isinstance(each, kind))
    return {pair: contact.distance for pair, contact in check.proximity.contacts(q, 2.0)}


def distance_m(guard: Guard, q: np.ndarray, kind: type) -> float:
    """Returns the smallest distance of the pairs of a check [m]."""
    return min(distances_m(guard, q, kind).values())


def folded(guard: Guard) -> np.ndarray:
    """Returns a configuration within limits in which the arm penetrates itself, far from the table."""
    choose = random.Random(0)
    low, high = guard.limits.lower, guard.limits.upper
    while True:
        q = np.array([choose.uniform(a, b) for a, b in zip(low, high)])
        if distance_m(guard, q, SelfCollision) < -0.02 and distance_m(guard, q, Environment) > 0.1:
            path = [HOME + s * (q - HOME) for s in np.linspace(0.0, 1.0, 30)]
            if min(distance_m(guard, each, Environment) for each in path) > 0.05:
                return q


def drive(world: World, guard: Guard | None, goal: np.ndarray, names: tuple[str, ...]) -> np.ndarray:
    """Moves the arm smoothly to a configuration, as far as the guard permits; returns all commands."""
    command, commands = HOME, []
    for k in range(round(SHOWN_S / PERIOD_S)):
        t = min(k * PERIOD_S / DURATION_S, 1.0)
        target = HOME + t**3 * (10.0 - 15.0 * t + 6.0 * t**2) * (goal - HOME)
        if guard is None:
            command = target
        else:
            decision = guard.decide(tuple(target.tolist()), CheckContext())
            if decision.violation is not None:
                print(decision.violation)
            command = command if decision.command is None else np.array(decision.command)
        world.put("kuka_lwr/target", dict(zip(names, command.tolist())))
        for _ in range(5):
            world.step()
        commands.append(command)
    return np.array(commands)


def picture(world: World) -> np.ndarray:
    """Returns the image of a camera."""
    pb = world.bodies["kuka_lwr"].pb
    view = pybullet.computeViewMatrixFromYawPitchRoll(**CAMERA, upAxisIndex=2)
    lens = pybullet.computeProjectionMatrixFOV(45.0, WIDTH / HEIGHT, 0.1, 5.0)
    image = pb.getCameraImage(WIDTH, HEIGHT, view, lens, renderer=pybullet.ER_TINY_RENDERER)[2]
    return np.reshape(np.array(image, dtype=np.uint8), (HEIGHT, WIDTH, 4))[:, :, :3]


def main() -> None:
    """Draws the figure into the file that the argument names."""
    figure, axes = plt.subplots(2, 3, figsize=(13.0, 7.0), layout="constrained")
    with tempfile.TemporaryDirectory() as folder:
        path = write_world(Path(folder))
        robot = RobotModel(LWR)
        judge = new_guard(robot, path)
        for row, (title, goal, kind) in enumerate(
            (("at the table", AT_TABLE, Environment), ("into itself", folded(judge), SelfCollision))
        ):
            for column, guard in enumerate((None, new_guard(robot, path))):
                world = World.from_file(path, connection_mode=pybullet.DIRECT)
                commands = drive(world, guard, goal, robot.joint_names)
                word = "with the guard" if guard else "without"
                axes[row, column].imshow(picture(world))
                axes[row, column].set(title=f"{title}, {word}", xticks=[], yticks=[])
                world.close()
                at_goal = distances_m(judge, goal, kind)
                met = [pair for pair, distance in at_goal.items() if distance < 0.0]  # others may always be near
                distances = [1e3 * min(distances_m(judge, q, kind)[pair] for pair in met) for q in commands]
                print(title, word, f"nearest command: {min(distances):.1f} mm")
                times = PERIOD_S * np.arange(len(commands))
                axes[row, 2].plot(times, distances, color="tab:green" if guard else "tab:red", label=word)
            axes[row, 2].axhline(1e3 * MARGIN_M, color="black", linestyle=":", label="margin")
            axes[row, 2].axhspan(-40.0, 0.0, color="tab:red", alpha=0.1)
            axes[row, 2].set(xlabel="time [s]", ylabel="distance by the commands [mm]", ylim=(-40.0, 120.0))
            axes[row, 2].legend()
    figure.savefig(sys.argv[1], dpi=80)


if __name__ == "__main__":
    main()
