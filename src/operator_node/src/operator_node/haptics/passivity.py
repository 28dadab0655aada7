"""Time-domain passivity: the device never gives out more energy than the person has put in."""

import math

from rpbi.geometry import Vector, dot, minus, scaled

from .vectors import ZERO, norm

MOST_DAMPING = 30.0
"""Largest gain of the controller's damper [N s/m]."""


class PassivityController:
    """Watches the energy at the handle, and takes from forces what would make it negative.

    Observer: between two samples the device holds the last force, so that the energy which went into it is exactly
    minus the sum of force held times displacement (J.-H. Ryu, Y. S. Kim and B. Hannaford, "Sampled- and
    continuous-time passivity and stability of virtual environments", IEEE Trans. Robotics 20(4), 2004).

    Controller: a damper in series, whose gain is what brings the energy that is expected after the next sample back to
    zero (B. Hannaford and J.-H. Ryu, "Time-domain passivity control of haptic interfaces", IEEE Trans. Robotics and
    Automation 18(1), 2002). Expected is a displacement of v dt. The gain has a limit, since a stronger damper that is
    sampled would make a light handle chatter.

    Leak: the displacement is another than v dt, by a dt^2 at most if no hand accelerates the handle by more than a. So
    one sample may take the energy below zero by F a dt^2, with a largest force F: that is the leak. Every force is
    shortened to what keeps the energy above minus the leak, whatever such a hand does; it is never below `floor_j`.

    Resolution: each measured position is off by up to e, the half diagonal of a cube of the device's steps. A measured
    displacement may differ by 4 e more from the v dt before it. Forces times displacements are off by e times the last
    force, once, and by e times each change of the force (summation by parts): changes are taken from the energy, and
    what is needed to let go of the force is kept. So the leak is F (a dt^2 + 5 e).

    Allowance: energy that may be given out beside what was put in, once. Without it a hand at rest cannot be pushed by
    a tool that something else pushes, and a simulator that lags at the first touch is felt weaker until the next.
    A refill gives it back at a power, so that over a time t no more than floor and refill times t is given out.

    Energy beyond a reserve is forgotten: else a person who stirs against a damper for long could be given it all back
    at once. What is watched is then less than what there is, so the bound holds all the same.

    Args:
        max_force_n: The largest force F that is held [N].
        max_acceleration: a [m/s^2].
        reserve_j: The largest energy that is remembered [J].
        period_s: dt, the time between two samples [s].
        allowance_j: Energy that may be given out without having been put in [J].
        refill_w: How fast what was given out beyond what was put in is forgotten [W]; 0 is strictly passive.
        resolution_m: Steps in which the device measures each axis [m].

    Attributes:
        energy_j: What the person has put in, less what was given back [J].
        interventions: At how many samples a force was changed.
        is_on: Whether forces are changed; the observer works in any case.
        floor_j: The least that the energy can be: minus allowance and leak [J].
    """

    def __init__(
        self,
        max_force_n: float,
        max_acceleration: float,
        reserve_j: float,
        period_s: float,
        allowance_j: float = 0.0,
        refill_w: float = 0.0,
        resolution_m: float = 0.0,
    ) -> None:
        self.energy_j = 0.0
        self.interventions = 0
        self.is_on = True
        self._error_m = 0.5 * math.sqrt(3.0) * resolution_m
        self._unforeseen_m = max_acceleration * period_s**2 + 4.0 * self._error_m
        self.floor_j = -allowance_j - max_force_n * (self._unforeseen_m + self._error_m)
        self._allowance_j, self._refill_j = allowance_j, refill_w * period_s
        self._reserve_j = reserve_j
        self._period_s = period_s
        self._held, self._before, self._was_cut = ZERO, ZERO, False

    def reset(self) -> None:
        """Forgets what the person has put in, but not what was given out: they take hold of the tool anew."""
        self.energy_j = min(self.energy_j, 0.0)

    def observe(self, displacement: Vector) -> None:
        """Takes what the handle has moved since the last sample [m]."""
        given_j = dot(self._held, displacement)
        changed_j = self._error_m * norm(minus(self._held, self._before))
        self._before = self._held
        if self._was_cut:  # nobody knows at which part of the way
            given_j = max(given_j, 0.0)
        self.energy_j = min(self.energy_j - given_j - changed_j, self._reserve_j)
        if self.energy_j < 0.0:
            self.energy_j = min(self.energy_j + self._refill_j, 0.0)
        if self._was_cut:
            self._held, self._was_cut = ZERO, False

    def cut(self) -> None:
        """Notes that the force was made zero before the next sample."""
        self._was_cut = True

    def damped(self, force: Vector, velocity: Vector) -> Vector:
        """Returns a force with the damper that it needs [N], at a velocity [m/s]."""
        if not self.is_on:
            return force
        expected_j = self.energy_j + self._allowance_j - dot(force, velocity) * self._period_s
        speed = norm(velocity)
        if expected_j >= 0.0 or speed == 0.0:
            return force
        self.interventions += 1
        brake = min(-expected_j / (speed * speed * self._period_s), MOST_DAMPING)
        return force[0] - velocity[0] * brake, force[1] - velocity[1] * brake, force[2] - velocity[2] * brake

    def hold(self, force: Vector, velocity: Vector) -> Vector:
        """Returns the force that is held until the next sample: that one, or less of it.

        Args:
            force: What limits made of a damped force [N]: the same direction, and not longer.
            velocity: Of the handle [m/s].
        """
        if self.is_on:
            left_j = max(self.energy_j - self._error_m * norm(self._before) - self.floor_j, 0.0)
            unforeseen_m = self._unforeseen_m + 2.0 * self._error_m
            worst_j = dot(force, velocity) * self._period_s + norm(force) * unforeseen_m
            if worst_j > left_j:
                self.interventions += 1
                force = scaled(left_j / worst_j, force)
        self._held, self._was_cut = force, False
        return force
