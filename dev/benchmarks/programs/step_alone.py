"""Steps a world in a bare loop: the PyBullet calls that the simulator makes, and nothing else."""

from __future__ import annotations

import argparse
import time

import pybullet

from rpbi.bodies.robots.robot import Robot
from rpbi.world import World


def main() -> None:
    """Prints the mean processor time of a step [s]."""
    parser = argparse.ArgumentParser()
    parser.add_argument("world", help="main YAML file")
    parser.add_argument("seconds", type=float)
    parser.add_argument("joint_states_hz", type=float, help="how often joint states are read [Hz] of simulated time")
    arguments = parser.parse_args()
    world = World.from_file(arguments.world)
    client = world.pb.client_id
    robots = [(body.body_id, body.joint_indices) for body in world.bodies.values() if isinstance(body, Robot)]
    steps_a_read = round(1.0 / (world.config.timeStep * arguments.joint_states_hz))
    steps = 0
    start_s, began_s = time.monotonic(), time.process_time()
    while time.monotonic() - start_s < arguments.seconds:
        for _ in range(steps_a_read):
            pybullet.stepSimulation(physicsClientId=client)
        for body_id, joint_indices in robots:
            pybullet.getJointStates(body_id, joint_indices, physicsClientId=client)
        steps += steps_a_read
    print("result:", (time.process_time() - began_s) / steps)


if __name__ == "__main__":
    main()
