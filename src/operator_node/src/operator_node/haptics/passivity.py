"""Time-domain passivity control: keeps the device from returning more energy than the user has put in."""

import math

from robot_model.geometry import ZERO, Vector, dot, minus, norm, scaled

MAX_DAMPING = 30.0
"""Largest gain of the controller's damper [N s/m]; higher gains are limited to this value."""


class PassivityController:
    """Observes the energy that the user puts into the device, and reduces forces that would make the energy negative.

    Observer: Between two samples, the device holds the last force. The energy that enters the device is therefore
    exactly minus the sum of the held forces times the displacements (J.-H. Ryu, Y. S. Kim and B. Hannaford, "Sampled-
    and continuous-time passivity and stability of virtual environments", IEEE Trans. Robotics 20(4), 2004).

    Controller: A damper is added to the force. Its gain brings the expected energy after the next sample back to zero
    (B. Hannaford and J.-H. Ryu, "Time-domain passivity control of haptic interfaces", IEEE Trans. Robotics and
    Automation 18(1), 2002). The expected displacement is v dt. The gain is limited, because a stronger sampled damper
    would make a light handle chatter.

    Leak: If the hand's acceleration is at most a, the displacement differs from v dt by at most a dt^2. One sample may
    therefore take the energy below zero by F a dt^2, with the largest force F. This amount is the leak. Every force is
    shortened such that the energy stays above `floor_j`.

    Resolution: Each measured position has an error of up to e, half the diagonal of a cube with edge `resolution_m`. A
    measured displacement has an error of up to 2 e, and so has v dt, which is the previous measured displacement. Both
    may therefore differ by another 4 e. Summation by parts shows two errors of the energy: e times the last force, and
    e times each change of the force. The controller subtracts the second error from the energy, and reserves the energy
    needed to release the force. The leak is then F (a dt^2 + 5 e).

    Allowance: The allowance is energy that the device may return beyond the energy that was put in. Without it, a tool
    pushed by another object cannot push a hand at rest, and a first touch feels weaker if the simulator lags. A refill
    power restores the allowance. Over a time t, the device returns at most minus `floor_j` plus refill power times t.

    Reserve: The observer drops energy beyond the reserve. Otherwise, a user who stirs against a damper for long could
    get all of this energy back at once. The observed energy is then less than the real energy, so the bound holds.

    Args:
        max_force_n: Largest force F that the device holds [N].
        max_acceleration: Largest acceleration a of the hand [m/s^2].
        reserve_j: Largest energy that the observer stores [J].
        period_s: Time dt between two samples [s].
        allowance_j: Energy that may be returned without having been put in [J].
        refill_w: Power at which the allowance is restored [W]; 0 is strictly passive.
        resolution_m: Step width of the measured position along each axis [m].

    Attributes:
        energy_j: Energy that the user has put in, minus the energy that the device has returned [J].
        interventions: Number of samples at which a force was changed.
        is_on: Whether forces are changed. The observer always runs.
        floor_j: Lower bound of `energy_j`: minus allowance and leak [J].
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
        """Sets `energy_j` to zero if positive, but keeps a negative value. Called when the handle is engaged."""
        self.energy_j = min(self.energy_j, 0.0)

    def observe(self, displacement: Vector) -> None:
        """Updates the energy with the displacement of the handle since the last sample [m]."""
        given_j = dot(self._held, displacement)
        changed_j = self._error_m * norm(minus(self._held, self._before))
        self._before = self._held
        if self._was_cut:  # the force ended at an unknown part of the displacement: assume the worse case
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
        """Returns a force [N] with the damping that passivity requires at the velocity of the handle [m/s]."""
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
        """Shortens a force if passivity requires it, records the force as held until the next sample, and returns it.

        Args:
            force: Result of `damped` [N], after the limits of force and slew rate.
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
