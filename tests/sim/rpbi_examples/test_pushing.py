"""The KUKA of the demo pushes its box to and fro, as its node has it do."""

import math
import sys
from itertools import cycle, islice
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from rpbi.samples import ContactsSample
from rpbi.world import World
from rpbi.world.loading import load_world
from rpbi_examples.motions import PlanarPose
from rpbi_examples.pushing import NEAR_M, PLACES, Pusher, ball_solver, next_push

sys.path.append(str(Path(__file__).resolve().parents[3] / "dev/pictures"))

from pushes import COMPLIANT, PLANE, pushed  # noqa: E402

WORLD = "{rpbi_examples}/configs/basic_example_kuka_lwr/config.yaml"
ROUNDS = 2


@pytest.fixture(scope="module")
def solver():
    return ball_solver()


@pytest.fixture(scope="module")
def session(solver):
    """Targets of the joints, sums of normal forces of the arm on the box, and where the box came to rest."""
    world, pusher = World.from_file(WORLD), Pusher(solver)
    ticks_a_target = round(1.0 / (50 * world.config.timeStep))
    positions = tuple(world.bodies["kuka_lwr"].joint_positions().values())
    targets, forces, boxes = [positions], [], []
    for goal in islice(cycle(PLACES), ROUNDS):
        while (push := next_push(box_of(world), goal)) is not None:
            assert len(boxes) < 2 * ROUNDS, "it does not get there"
            for move in pusher.moves(positions, push):
                count = round(move.duration_s * 50)
                for number in range(1, count + 1):
                    positions = move.at(number / count * move.duration_s)
                    targets.append(positions)
                    world.put("kuka_lwr/target", dict(zip(solver.joint_names, positions)))
                    samples = [sample for _ in range(ticks_a_target) for sample in world.step()]
                    forces += [force_of_arm(sample) for sample in samples if isinstance(sample, ContactsSample)]
            boxes.append((box_of(world), goal))
    world.close()
    return SimpleNamespace(targets=np.array(targets), forces=np.array(forces), boxes=boxes)


def box_of(world):
    """Returns where the box is in the frame of the arm's base."""
    base = world.bodies["kuka_lwr"].base_pose()
    (x, y, _), quat = base.inverse() @ world.bodies["box"].base_pose()
    return PlanarPose(x, y, 2.0 * math.atan2(quat[2], quat[3]))


def force_of_arm(sample):
    return sum(point.normal_force for point in sample.points if point.other_body == "kuka_lwr")


def test_the_demo_runs_at_1_khz_as_these_pushes_do():
    assert load_world(WORLD).config.timeStep == 0.001


def test_each_push_brings_the_box_to_its_goal_without_turning(session):
    assert len(session.boxes) == ROUNDS
    for box, goal in session.boxes:
        assert math.dist((box.x, box.y), goal) < NEAR_M
        assert abs(box.yaw) < 0.1


def test_pushing_force_is_friction_and_ends_with_the_push(session):
    touching = session.forces[session.forces > 0.0]
    assert 0.2 < len(touching) / len(session.forces) < 0.8
    assert touching.mean() == pytest.approx(0.8 * 9.81 * 0.7 * 1.0, rel=0.35)


@pytest.mark.parametrize(("objects", "most_std_n"), [({}, 0.5), ({"box": COMPLIANT}, 0.2)])
def test_force_at_constant_speed_is_friction_without_chatter(objects, most_std_n):
    force = pushed(objects=objects, length_m=0.2).steady()
    assert force.points.min() == 4.0
    assert force.push == pytest.approx(force.friction, rel=0.05)
    assert 0.9 < force.push.mean() / (0.8 * 9.81 * 0.7) < 1.5, "the ball rubs on the box, down or up"
    assert force.push.std() < most_std_n
    assert np.percentile(force.push, 99) < force.push.mean() + 3.0 * most_std_n


def test_on_a_plane_it_would_chatter():
    force = pushed(objects={"floor": PLANE}, length_m=0.2).steady()
    assert force.points.mean() < 3.5
    assert force.push.std() > 1.5 and force.push.max() > 12.0


def test_joints_stay_within_limits_and_speeds_without_jumps(session, solver):
    assert (np.ptp(session.targets, axis=0) > 0.2).all()
    assert (session.targets > solver.lower).all() and (session.targets < solver.upper).all()
    velocities = np.diff(session.targets, axis=0) * 50.0
    assert (np.abs(velocities) < (1.92, 1.92, 2.27, 2.27, 2.27, 3.14, 3.14)).all()
    assert np.abs(np.diff(velocities, axis=0)).max() * 50.0 < 20.0


def test_push_out_of_reach_is_reported(solver):
    push = next_push(PlanarPose(-1.5, 0.0, 0.0), PLACES[0])
    with pytest.raises(ValueError, match=r"\(-1\.6.*\) m is out of reach"):
        Pusher(solver).moves((0.0,) * 7, push)
