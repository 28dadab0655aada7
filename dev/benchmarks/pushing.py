"""Accuracy of pushing a box along paths by model predictive control, and time of the solver.

The plant is PyBullet: a ball on two slides, a robot whose velocities are commanded, pushes a box. Bullet's friction by
yaw (docs/physics.md) is one of the disturbances: maximal coordinates do not avoid it while a robot touches the box. The
pose of the box is that of the emulated Vicon.
"""

from __future__ import annotations

import numpy as np
from result import Result, Target

from rpbi_mpc.pushing.config import ProgramConfig, PushingConfig
from rpbi_mpc.pushing.controller import PushingController
from rpbi_mpc.pushing.planar.paths import PathConfig
from rpbi_mpc.pushing.sampling_planner import PushSamplingConfig, SamplingPlanner
from rpbi_mpc.pushing.simulated import PushingWorld
from rpbi_mpc.pushing.trials import PushingTrial, Variation, run_trial

PATHS = {
    "line": PathConfig(shape="line", size=0.5),
    "arc": PathConfig(shape="arc", size=0.35, angle=1.5),
    "S": PathConfig(shape="s", size=0.35, angle=0.8),
}
EIGHT = PathConfig(shape="eight", size=0.3)
SEEDS, QUICK_SEEDS = 30, 2
FIRST_SEED = 11000
"""Seeds from here on were not used for tuning, which used 1001 to 1020."""
NOMINAL_M, DISTURBED_M, SHARE = 0.005, 0.015, 0.95
RECOVERED_M, RECOVERED_S, SHOVE_AT_S = 0.015, 5.0, 3.0
"""A shoved box has recovered if its error is below this limit from this time on."""
SOLVE_S = 0.02


def run(quick: bool) -> list[Result]:
    """Pushes along line, arc, S and figure eight: nominal, disturbed, and shoved."""
    seeds = range(FIRST_SEED, FIRST_SEED + (QUICK_SEEDS if quick else SEEDS))
    trials: list[PushingTrial] = []
    results = [*_nominal(trials), *_disturbed(seeds, trials), *_shoved(seeds, trials)]
    results += _times("fatrop, then ipopt", trials)
    if not quick:
        ipopt = ProgramConfig(solvers=("ipopt",))
        trials = [run_trial(PushingConfig(path=path, program=ipopt), Variation()) for path in PATHS.values()]
        results += [*_times("ipopt alone", trials), *_sampled()]
    return results


def _nominal(trials: list[PushingTrial]) -> list[Result]:
    results = []
    for name, path in {**PATHS, "eight": EIGHT}.items():
        trial = run_trial(PushingConfig(path=path), Variation())
        trials.append(trial)
        target = None if path is EIGHT else Target(1e3 * NOMINAL_M)
        error = 1e3 * float(trial.errors.mean()) if trial.finished else float("inf")
        results.append(Result("pushing", f"{name}, nominal: mean error", error, "mm", None, target))
    noisy = run_trial(PushingConfig(path=EIGHT), Variation.random(FIRST_SEED))
    results.append(Result("pushing", "eight, disturbed: mean error", 1e3 * float(noisy.errors.mean()), "mm"))
    return results


def _disturbed(seeds: range, trials: list[PushingTrial]) -> list[Result]:
    results, errors = [], []
    for name, path in PATHS.items():
        done = [run_trial(PushingConfig(path=path), Variation.random(seed)) for seed in seeds]
        trials += done
        errors += (means := [float(trial.errors.mean()) if trial.finished else np.inf for trial in done])
        results.append(
            Result("pushing", f"{name}, disturbed: median of mean errors", 1e3 * float(np.median(means)), "mm")
        )
        results.append(Result("pushing", f"{name}, disturbed: largest mean error", 1e3 * max(means), "mm"))
    share = float(np.mean(np.array(errors) < DISTURBED_M))
    figure = f"{len(errors)} disturbed: share below {1e3 * DISTURBED_M:g} mm"
    return [*results, Result("pushing", figure, share, "", None, Target(SHARE, at_least=True))]


def _shoved(seeds: range, trials: list[PushingTrial]) -> list[Result]:
    times = []
    for path in PATHS.values():
        for seed in seeds:
            trial = run_trial(
                PushingConfig(path=path),
                Variation.random(seed),
                shove_at_s=SHOVE_AT_S,
                recovered_below=RECOVERED_M,
                max_s=path.size / path.speed * 4,
            )
            trials.append(trial)
            times.append(trial.recovered_s if trial.finished else np.inf)
    share = float(np.mean(np.array(times) <= RECOVERED_S))
    what = f"{len(times)} shoved by 3 cm and 30 deg"
    return [
        Result("pushing", f"{what}: back within {RECOVERED_S:g} s", share, "", None, Target(SHARE, at_least=True)),
        Result("pushing", f"{what}: median time", float(np.median(times)), "s"),
    ]


def _sampled() -> list[Result]:
    """Pushes by sampling in forks of the world, whose model is the plant itself."""
    results = []
    for name, path in PATHS.items():
        config = PushingConfig(path=path)

        def make(plant: PushingWorld, config: PushingConfig = config) -> PushingController:
            return PushingController(config, SamplingPlanner(plant, config, PushSamplingConfig()))

        trial = run_trial(config, Variation(), make_controller=make)
        error = 1e3 * float(trial.errors.mean()) if trial.finished else float("inf")
        results.append(Result("pushing", f"{name}, nominal, by sampling: mean error", error, "mm"))
        plans = [cycle.plan for cycle in trial.cycles if cycle.plan and cycle.plan.iterations]
        mean_s = float(np.mean([plan.wall_s for plan in plans]))
        results.append(Result("pushing", f"{name}, by sampling: plan, wall clock, mean", 1e3 * mean_s, "ms"))
    return results


def _times(what: str, trials: list[PushingTrial]) -> list[Result]:
    """Returns solve times; processor times do not depend on the load of the machine."""
    plans = [cycle.plan for trial in trials for cycle in trial.cycles if cycle.plan and cycle.plan.iterations]
    processor, wall = (np.array([getattr(plan, name) for plan in plans]) for name in ("processor_s", "wall_s"))
    failed = float(np.mean([not plan.converged for plan in plans]))
    quantile = float(np.quantile(processor, 0.99))
    return [
        Result("pushing", f"{what}: solve, processor, mean of {len(plans)}", 1e3 * float(processor.mean()), "ms"),
        Result("pushing", f"{what}: solve, processor, p99", 1e3 * quantile, "ms", None, Target(1e3 * SOLVE_S)),
        Result("pushing", f"{what}: solve, processor, max", 1e3 * float(processor.max()), "ms"),
        Result("pushing", f"{what}: solve, wall clock, p99", 1e3 * float(np.quantile(wall, 0.99)), "ms"),
        Result("pushing", f"{what}: share that did not converge", failed, ""),
    ]
