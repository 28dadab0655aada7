"""Writes numbers of the library movement_primitives, against which a test checks the primitives of this workspace.

    python3 -m venv --system-site-packages oracle
    oracle/bin/pip install movement_primitives==0.9.1 pytransform3d==3.17.0 tqdm "numpy<2"
    oracle/bin/python dev/tools/primitives/oracle.py tests/unit/motion_primitives/oracle.json

The library is no requirement of the tests, since it is compiled when it is installed. Its equations are right, but not
all of its numbers; these are left out, and the file has by how much they differ:

- `rk4`, its default, evaluates the forcing term of positions one time step late in the phase: it uses phases at
  `t`, `t + dt / 2` and `t + dt` for the step that ends at `t`. Orientations, by `euler`, use the right phase. The two
  drift apart by a time step. Here its equations are integrated by SciPy, or by its own `euler` with extrapolation.
- `mean_velocities` of its ProMP are derivatives by the share of the duration, not by time; the duration here is 1 s.
"""

import json
import sys
from importlib.metadata import version

import numpy as np
from movement_primitives.dmp import DMP, CartesianDMP, DMPWithFinalVelocity
from movement_primitives.dmp._cartesian_dmp import dmp_step_quaternion_python
from movement_primitives.dmp._dmp import _dmp_acc
from movement_primitives.dmp._dmp_with_final_velocity import apply_constraints, solve_constraints
from movement_primitives.promp import ProMP
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

BASES, DURATION_S, SAMPLES = 10, 1.0, 101
TIMES = np.linspace(0.0, DURATION_S, SAMPLES)
LOOKS = np.linspace(0.0, DURATION_S, 11)
"""Times of the results [s]."""


def demonstration():
    """A motion that rests for its last samples: the library assumes that it ends at rest."""
    u = np.clip(TIMES / 0.9, 0.0, 1.0)
    share = 10 * u**3 - 15 * u**4 + 6 * u**5
    bump = np.sin(np.pi * share) ** 2
    positions = np.outer(share, [0.3, -0.2, 0.1]) + np.outer(bump, [0.05, 0.1, 0.2]) + [0.4, 0.0, 0.3]
    turns = Rotation.from_rotvec(np.outer(share, [0.5, 1.0, -0.3])) * Rotation.from_rotvec(
        np.outer(bump, [0.4, 0, 0.6])
    )
    return positions, turns.as_quat()


def integrated(acceleration, start):
    """Returns positions at `LOOKS`, from rest."""
    n = len(start)
    rate = lambda t, y: np.concatenate([y[n:], acceleration(t, y[:n], y[n:])])  # noqa: E731
    found = solve_ivp(rate, (0, DURATION_S), [*start, *np.zeros(n)], t_eval=LOOKS, rtol=1e-12, atol=1e-13)
    return found.y[:n].T


def discrete(positions):
    """Returns weights and positions of a DMP with a fixed goal, and how far its own integration is off."""
    dmp = DMP(3, DURATION_S, n_weights_per_dim=BASES, smooth_scaling=True)
    dmp.imitate(TIMES, positions)
    start, goal = positions[0] + [0.1, 0.0, -0.1], positions[-1] + [0.0, 0.2, 0.1]
    zero = np.zeros(3)

    def acceleration(t, y, v):
        z, f = dmp.forcing_term.phase(t), dmp.forcing_term(t).ravel()
        args = (dmp.alpha_y, dmp.beta_y, goal, zero, zero, start, z, DURATION_S, f, None, zero, True)
        return _dmp_acc(y, v, zero, *args)

    exact = integrated(acceleration, start)
    off = {}
    for dt in (0.01, 0.005):
        dmp.dt_ = dt
        dmp.configure(start_y=start, goal_y=goal)
        own = dmp.open_loop(step_function="rk4")[1]
        off[str(dt)] = float(np.abs(own[:: round(0.1 / dt)] - exact).max())
    return {
        "weights": dmp.forcing_term.weights_.tolist(),
        "start": start.tolist(),
        "goal": goal.tolist(),
        "positions": exact.tolist(),
        "own_rk4_is_off_by_m_at_dt": off,
    }


def moving(positions):
    """Returns positions of a DMP with a moving goal, for weights of another DMP."""
    dmp = DMPWithFinalVelocity(3, DURATION_S, n_weights_per_dim=BASES)
    rng = np.random.default_rng(0)
    dmp.forcing_term.weights_ = rng.normal(0.0, 100.0, (3, BASES))
    start, goal, zero = positions[0], positions[-1] + [0.0, 0.2, 0.1], np.zeros(3)
    coefficients = solve_constraints(0.0, DURATION_S, start, zero, zero, goal, zero, zero)

    def acceleration(t, y, v):
        g, gd, gdd = apply_constraints(t, goal, DURATION_S, coefficients)
        pull = dmp.alpha_y * (dmp.beta_y * (g - y) + DURATION_S * (gd - v))
        return (pull + dmp.forcing_term(t).ravel()) / DURATION_S**2 + gdd

    return {
        "weights": dmp.forcing_term.weights_.tolist(),
        "start": start.tolist(),
        "goal": goal.tolist(),
        "positions": integrated(acceleration, start).tolist(),
    }


def orientations(positions, quats_xyzw):
    """Returns weights and quaternions w, x, y, z of the orientation of a Cartesian DMP."""
    dmp = CartesianDMP(DURATION_S, n_weights_per_dim=BASES, smooth_scaling=True)
    dmp.imitate(TIMES, np.hstack([positions, quats_xyzw[:, [3, 0, 1, 2]]]))
    start = quats_xyzw[0][[3, 0, 1, 2]]
    goal = (Rotation.from_rotvec([0.2, -0.3, 0.1]) * Rotation.from_quat(quats_xyzw[-1])).as_quat()[[3, 0, 1, 2]]
    zero = np.zeros(3)

    def by_euler(steps):
        y, v, found = start.copy(), np.zeros(3), [start.copy()]
        for last, now in zip(LOOKS, LOOKS[1:]):
            dmp_step_quaternion_python(
                last, now, y, v, goal, zero, zero, start, zero, zero, DURATION_S, 0.0, dmp.alpha_y[3:], dmp.beta_y[3:],
                dmp.forcing_term_rot, int_dt=0.1 / steps, smooth_scaling=True,
            )  # fmt: skip
            found.append(y.copy())
        return np.array(found)

    coarse, middle, fine = by_euler(500), by_euler(1000), by_euler(2000)
    first, second = 2 * middle - coarse, 2 * fine - middle  # the error of first order cancels, then that of second
    exact = (4 * second - first) / 3
    return {
        "weights": dmp.forcing_term_rot.weights_.tolist(),
        "start": start.tolist(),
        "goal": goal.tolist(),
        "quats_wxyz": (exact / np.linalg.norm(exact, axis=1, keepdims=True)).tolist(),
        "extrapolation_changed_it_by": float(np.abs(exact - second).max()),
    }


def probabilistic():
    """Returns mean, variance and velocities of a ProMP, and of one that passes two points."""
    rng = np.random.default_rng(1)
    root = rng.normal(0.0, 0.3, (3 * BASES, 3 * BASES))
    promp = ProMP(3, BASES).from_weight_distribution(rng.normal(0.0, 1.0, 3 * BASES), root @ root.T / 10)
    points = rng.normal(0.0, 0.5, (2, 3))
    given = promp.condition_position(points[0], 1e-4 * np.eye(3), 0.3).condition_position(
        points[1], 1e-4 * np.eye(3), 1.0
    )
    return {
        "weight_mean": promp.weight_mean.tolist(),
        "weight_covariance": promp.weight_cov.tolist(),
        "mean": promp.mean_trajectory(LOOKS.copy()).tolist(),  # it scales its argument in place
        "variance": promp.var_trajectory(LOOKS.copy()).tolist(),
        "velocities": promp.mean_velocities(LOOKS.copy()).tolist(),
        "points": points.tolist(),
        "given_mean": given.mean_trajectory(LOOKS.copy()).tolist(),
        "given_variance": given.var_trajectory(LOOKS.copy()).tolist(),
    }


def main(path):
    positions, quats_xyzw = demonstration()
    content = {
        "written_by": "dev/tools/primitives/oracle.py",
        "versions": {name: version(name) for name in ("movement_primitives", "pytransform3d", "numpy", "scipy")},
        "demonstration": {"times": TIMES.tolist(), "positions": positions.tolist(), "quats_xyzw": quats_xyzw.tolist()},
        "looks": LOOKS.tolist(),
        "fixed": discrete(positions),
        "moving": moving(positions),
        "orientations": orientations(positions, quats_xyzw),
        "promp": probabilistic(),
    }
    with open(path, "w") as file:
        json.dump(content, file)
        file.write("\n")


if __name__ == "__main__":
    main(sys.argv[1])
