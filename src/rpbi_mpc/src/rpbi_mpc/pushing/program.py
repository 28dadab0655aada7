"""The optimal control problem of pushing, as a nonlinear program of CasADi."""

from __future__ import annotations

import time
from typing import Any, NamedTuple

import numpy as np

from custom_ros_tools.errors import MissingDependency
from rpbi_mpc.pushing.planar.model import SliderConfig

from .config import ProgramConfig
from .planar.model import advanced, complementarity, pusher_velocity

try:
    import casadi
except ImportError:
    raise MissingDependency("casadi", "./rpbi setup mpc") from None

NX, NU = 4, 4
"""Numbers of entries in a state and in an input; see the module `planar.model`."""


class Solved(NamedTuple):
    """Result of the program.

    Attributes:
        states: States of the solution, shape (steps + 1, 4).
        inputs: Inputs of the solution, shape (steps, 4).
        cost: Value of the cost.
        converged: Whether the solver converged to finite numbers.
        status: Name of the solver, and the status that it reports.
        iterations: Total number of iterations of all tried solvers.
        wall_s: Wall time of all tried solvers [s].
        processor_s: Processor time of all tried solvers [s].
    """

    states: np.ndarray
    inputs: np.ndarray
    cost: float
    converged: bool
    status: str
    iterations: int
    wall_s: float
    processor_s: float


class PushingProgram:
    """Nonlinear program that computes the optimal inputs of a push over a horizon.

    The constructor compiles the program, and `solve` solves the program in each cycle.

    Args:
        slider: The slider.
        config: Horizon, limits and solver.
    """

    def __init__(self, slider: SliderConfig, config: ProgramConfig) -> None:
        self._slider, self._config, self._steps = slider, config, config.steps
        self._solvers = self._compiled()
        self._set_bounds()

    def solve(
        self, state: np.ndarray, reference: np.ndarray, speed: float, force: np.ndarray, guess: np.ndarray
    ) -> Solved:
        """Solves the program. Tries one solver after the other until a solver converges.

        Args:
            state: First state, shape (4,).
            reference: Reference poses, shape (steps + 1, 3) [m, m, rad].
            speed: Speed along the path, which is the reference of the normal force [m/s].
            force: Normal and tangential force before the first step, shape (2,) [m/s].
            guess: Vector from `guess_of` with the states and inputs from which the solvers start.
        """
        parameters = np.concatenate([state, reference.ravel(), [speed], force])
        wall, processor, iterations = time.perf_counter(), time.thread_time(), 0
        for solver in self._solvers:
            solved = self._solved(solver, parameters, guess)
            iterations += solved.iterations
            if solved.converged:
                break
        return solved._replace(
            iterations=iterations,
            wall_s=time.perf_counter() - wall,
            processor_s=time.thread_time() - processor,
        )

    def _solved(self, solver: Any, parameters: np.ndarray, guess: np.ndarray) -> Solved:
        answer = solver(x0=guess, p=parameters, lbx=self._lower, ubx=self._upper, lbg=self._lower_g, ubg=self._upper_g)
        stats = solver.stats()
        states, inputs = self._split(np.asarray(answer["x"]).ravel())
        finite = bool(np.isfinite(states).all() and np.isfinite(inputs).all())
        converged, status = bool(stats["success"]) and finite, f"{solver.name()}: {stats['return_status']}"
        return Solved(states, inputs, float(answer["f"]), converged, status, int(stats["iter_count"]), 0.0, 0.0)

    def guess_of(self, states: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """Arranges states of shape (steps + 1, 4) and inputs of shape (steps, 4) as a vector of program variables."""
        return np.concatenate([np.hstack([states[:-1], inputs]).ravel(), states[-1]])

    def _split(self, vector: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        table = vector[: self._steps * (NX + NU)].reshape(self._steps, NX + NU)
        return np.vstack([table[:, :NX], vector[-NX:]]), table[:, NX:]

    def _compiled(self) -> list[Any]:
        """Compiles the program for each solver.

        The variables are x0, u0, x1 and so on. For each step, the constraints are the dynamics, followed by the limits.
        """
        states = [casadi.SX.sym(f"x{k}", NX) for k in range(self._steps + 1)]
        inputs = [casadi.SX.sym(f"u{k}", NU) for k in range(self._steps)]
        start = casadi.SX.sym("start", NX)
        reference = casadi.SX.sym("reference", 3, self._steps + 1)
        speed, force = casadi.SX.sym("speed"), casadi.SX.sym("force", 2)
        cost, rows, equal = 0, [], []
        for k, (state, control) in enumerate(zip(states, inputs)):
            after = casadi.vertcat(*advanced(state, control, self._config.step_s, self._slider))
            cost += self._step_cost(state, control, reference[:, k], speed)
            cost += self._config.weights.change * casadi.sumsqr(control[:2] - force) if k == 0 else 0
            rows += [states[k + 1] - after, *([state - start] if k == 0 else []), self._limited(state, control)]
            equal += [True] * NX * (2 if k == 0 else 1) + [False] * 3
        cost += self._config.weights.final * self._state_cost(states[-1], reference[:, self._steps])
        variables = casadi.vertcat(*[each for pair in zip(states, inputs) for each in pair], states[-1])
        self._equal = np.array(equal)
        problem = {
            "x": variables,
            "p": casadi.vertcat(start, casadi.vec(reference), speed, force),
            "f": cost,
            "g": casadi.vertcat(*rows),
        }
        return [casadi.nlpsol(name, name, problem, self._options(name, equal)) for name in self._config.solvers]

    def _state_cost(self, state: Any, reference: Any) -> Any:
        weights = self._config.weights
        difference = state[:3] - reference
        return (
            weights.position * casadi.sumsqr(difference[:2])
            + weights.yaw * difference[2] ** 2
            + weights.contact * state[3] ** 2
        )

    def _step_cost(self, state: Any, control: Any, reference: Any, speed: Any) -> Any:
        weights = self._config.weights
        return (
            self._state_cost(state, reference)
            + weights.force * ((control[0] - speed) ** 2 + control[1] ** 2)
            + weights.sliding * casadi.sumsqr(control[2:])
            + weights.complementarity * complementarity(control, self._slider)
        )

    def _limited(self, state: Any, control: Any) -> Any:
        """Returns the expressions that must not be negative in a step: the force's distances from both edges of the
        friction cone, and the margin to the pusher's largest normal speed.
        """
        normal, tangential = control[0], control[1]
        edge = self._slider.friction * normal
        return casadi.vertcat(
            edge - tangential,
            edge + tangential,
            self._config.max_speed - pusher_velocity(state, control, self._slider)[0],
        )

    def _set_bounds(self) -> None:
        fast, reach = self._config.max_speed, self._slider.reach
        lower, upper = np.array([-np.inf] * 3 + [-reach]), np.array([np.inf] * 3 + [reach])
        least, most = np.array([0.0, -fast, 0.0, 0.0]), np.array([fast, fast, fast, fast])
        self._lower = self.guess_of(np.tile(lower, (self._steps + 1, 1)), np.tile(least, (self._steps, 1)))
        self._upper = self.guess_of(np.tile(upper, (self._steps + 1, 1)), np.tile(most, (self._steps, 1)))
        free = slice(0, NX)  # the first state is given, and may be outside the limits
        self._lower[free], self._upper[free] = -np.inf, np.inf
        self._lower_g = np.zeros(len(self._equal))
        self._upper_g = np.where(self._equal, 0.0, np.inf)

    def _options(self, solver: str, equal: list[bool]) -> dict[str, Any]:
        config = self._config
        common = {"print_time": False, "error_on_fail": False, "record_time": False}
        if solver == "fatrop":
            limits = {"max_iter": config.max_iterations, "tol": config.tolerance, "print_level": 0}
            return {**common, "structure_detection": "auto", "equality": equal, "fatrop": limits}
        options: dict[str, Any] = {
            "max_iter": config.max_iterations,
            "tol": config.tolerance,
            "print_level": 0,
            "sb": "yes",
            "mu_init": 1e-2,
        }
        return {**common, "ipopt": options}
