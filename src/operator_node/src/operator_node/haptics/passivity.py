"""Time-domain passivity: the device never gives out more energy than the user has put in."""

import math

from robot_model.geometry import ZERO, Vector, dot, minus, norm, scaled

MAX_DAMPING = 30.0
"""Largest gain of the controller's damper [N s/m]; higher gains are cut off."""


class PassivityController:
    """Observes the energy at the handle, and reduces forces that would make it negative.

    Observer: between two samples the device holds the last force, so that the energy which went into it is exactly
    minus the sum of force held times displacement (J.-H. Ryu, Y. S. Kim and B. Hannaford, "Sampled- and
    continuous-time passivity and stability of virtual environments", IEEE Trans. Robotics 20(4), 2004).

    Controller: a damper in series. Its gain brings the energy that is expected after the next sample back to zero (B.
    Hannaford and J.-H. Ryu, "Time-domain passivity control of haptic interfaces", IEEE Trans. Robotics and Automation
    18(1), 2002). The expected displacement is v dt. The gain has a limit, since a stronger sampled damper would make a
    light handle chatter.

    Leak: the displacement differs from v dt by at most a dt^2 if no hand accelerates the handle by more than a. One
    sample may therefore take the energy below zero by F a dt^2, with the largest force F: that is the leak. Every force
    is shortened such that the energy stays above minus the leak, whatever such a hand does; it is never below
    `floor_j`.

    Resolution: each measured position is off by up to e, the half diagonal of a cube of the device's steps. A measured
    displacement may differ by 4 e more from the v dt before it. Forces times displacements are off by e times the last
    force, once, and by e times each change of the force (summation by parts): changes are subtracted from the energy,
    and the amount needed to release the force is reserved. The leak is then F (a dt^2 + 5 e).

    Allowance: energy that may be given out once beyond what was put in. Without it, a tool that something else pushes
    cannot push a hand at rest, and the first touch feels weaker if the simulator lags. A refill restores the allowance
    at a power, so that over a time t no more than floor and refill times t is given out.

    Energy beyond a reserve is dropped: otherwise a user who stirs against a damper for long could get all of it back at
    once. The observed energy is then less than the real one, so that the bound still holds.

    Args:
        max_force_n: Largest force F that is held [N].
        max_acceleration: a [m/s^2].
        reserve_j: Largest energy that is stored [J].
        period_s: dt, the time between two samples [s].
        allowance_j: Energy that may be given out without having been put in [J].
        refill_w: Power at which the allowance is restored [W]; 0 is strictly passive.
        resolution_m: Steps in which the device measures each axis [m].

    Attributes:
        energy_j: Energy that the user has put in, less the energy given back [J].
        interventions: Number of samples at which a force was changed.
        is_on: Whether forces are changed; the observer runs in any case.
        floor_j: Least value of the energy: minus allowance and leak [J].
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
        """Drops the energy that the user has put in, but not a deficit; called when the handle is engaged anew."""
        self.energy_j = min(self.energy_j, 0.0)

    def observe(self, displacement: Vector) -> None:
        """Accounts for the displacement of the handle since the last sample [m]."""
        given_j = dot(self._held, displacement)
        changed_j = self._error_m * norm(minus(self._held, self._before))
        self._before = self._held
        if self._was_cut:  # it is not known at which part of the displacement
            given_j = max(given_j, 0.0)
        self.energy_j = min(self.energy_j - given_j - changed_j, self._reserve_j)
        if self.energy_j < 0.0:
            self.energy_j = min(self.energy_j + self._refill_j, 0.0)
        if self._was_cut:
            self._held, self._was_cut = ZERO, False

    def cut(self) -> None:
        """Records that the force was set to zero before the next sample."""
        self._was_cut = True

    def damped(self, force: Vector, velocity: Vector) -> Vector:
        """Returns a force with the necessary damper added [N], at a velocity [m/s]."""
        if not self.is_on:
            return force
        expected_j = self.energy_j + self._allowance_j - dot(force, velocity) * self._period_s
        speed = norm(velocity)
        if expected_j >= 0.0 or speed == 0.0:
            return force
        self.interventions += 1
        brake = min(-expected_j / (speed * speed * self._period_s), MAX_DAMPING)
        return force[0] - velocity[0] * brake, force[1] - velocity[1] * brake, force[2] - velocity[2] * brake

    def hold(self, force: Vector, velocity: Vector) -> Vector:
        """Returns the force to hold until the next sample: the given one, possibly shortened.

        Args:
            force: Damped force after the limits [N]: the same direction, and not longer.
            velocity: Velocity of the handle [m/s].
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
