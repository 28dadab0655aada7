"""Policies of farms: one that is good, and some that fail in the first episodes."""

import os
import signal
import sys
import time

import numpy as np

from rpbi_data.farm import Policy

FAULTY = 2
"""Number of the first episodes in which a policy fails."""
DELAY_S = "FARM_DELAY_S"
"""Variable with the time that 50 ticks take longer [s], so that somebody may disturb them."""


class Slide(Policy):
    """Throws a box from a random place, pushes it at random, and succeeds where it has slid far enough."""

    def __init__(self, world, rng):
        super().__init__(world, rng)
        world.act("box", "teleport", ((rng.uniform(-0.2, 0.2), 0.0, 0.2), (0.0, 0.0, 0.0, 1.0)))
        self.number = rng.bit_generator.seed_seq.entropy[1]
        self.fails = self.number < FAULTY

    def act(self):
        if self.world.clock.tick % 50 == 0:
            time.sleep(float(os.environ.get(DELAY_S, 0.0)))
            force = {"force": tuple(self.rng.uniform(-30.0, 30.0, 3)), "torque": (0.0, 0.0, 0.0), "duration_s": 0.03}
            self.world.put("box/external_wrench", force)
        return "success" if self.world.bodies["box"].base_pose().position[0] > 0.25 else None


class Raises(Slide):
    """Fails at tick 7."""

    def act(self):
        if self.fails and self.world.clock.tick == 7:
            raise KeyError("gripper")
        return super().act()


class RaisesAtOnce(Slide):
    """Fails while it is made."""

    def __init__(self, world, rng):
        super().__init__(world, rng)
        if self.fails:
            sys.exit("no such file")


class NoWord(Slide):
    """Returns what is no label."""

    def act(self):
        return 1.0 if self.fails else super().act()


class TooEarly(Slide):
    """Ends before the first tick."""

    def act(self):
        return "success" if self.fails else super().act()


class NotFinite(Slide):
    """Pushes with what is no number."""

    def act(self):
        if self.fails:
            self.world.put("box/external_wrench", {"force": (np.nan, 0.0, 0.0), "torque": (0.0, 0.0, 0.0)})
        return super().act()


class Steps(Slide):
    """Steps the world itself."""

    def act(self):
        if self.fails:
            self.world.step()
        return super().act()


class Kills(Slide):
    """Kills its process in one episode."""

    def act(self):
        if self.number == 1 and self.world.clock.tick == 20:
            os.kill(os.getpid(), signal.SIGKILL)
        return super().act()
