"""Costs of predictions: some that are good, and some that fail."""

import builtins
import os
import pickle
import resource
import signal

from rpbi.samples import AprilTagsSample


def height(world):
    """Returns how high the box is [m]."""
    return world.bodies["box"].base_pose().position[2]


def turned(world):
    """Returns how far the second joint of the arm is from 0.6 rad, squared."""
    return (list(world.bodies["iiwa"].joint_positions().values())[1] - 0.6) ** 2


def farthest_tag(world):
    """Returns how far the farthest tag is that the cameras see [m]."""
    samples = [one for one in world.read_rest() if isinstance(one, AprilTagsSample)]
    return max((tag.pose.position[2] for one in samples for tag in one.tags), default=0.0)


def cameras(world):
    """Returns all that is known of the cameras."""
    return {
        name: (each.config.model_dump(), each.pose, each.hz, each.topic_name) for name, each in world.cameras.items()
    }


def broken(world):
    """Raises."""
    raise RuntimeError("no such thing")


def endless(world):
    """Returns what is no number."""
    return float("nan")


def killed(world):
    """Has its process killed, as the kernel does when memory runs out."""
    os.kill(os.getpid(), signal.SIGKILL)


def hungry(world):
    """Takes more memory than its process may have, if the first joint moves."""
    if moves(world):
        resource.setrlimit(resource.RLIMIT_AS, (1 << 28, 1 << 28))
        return len(bytearray(1 << 30))
    return 0.0


def unwritten(world):
    """Has no memory left when the answer is written."""
    opened = open

    def fail_once(*_):
        builtins.open = opened
        raise MemoryError

    builtins.open = fail_once
    return 0.0


def cut(world):
    """Has its answer cut short, if the first joint moves."""
    if moves(world):
        dumps = pickle.dumps
        pickle.dumps = lambda answer: dumps(answer)[:-20]
    return 0.0


def kills_the_follower(world):
    """Kills the process that it was forked from."""
    os.kill(os.getppid(), signal.SIGKILL)
    return 0.0


def moves(world):
    """Returns whether the first joint of the arm moves."""
    return abs(next(iter(world.bodies["iiwa"].joint_positions().values()))) > 0.001
