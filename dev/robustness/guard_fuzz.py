"""Hostile targets for the guard, judged by an independent oracle.

    ./rpbi shell -c 'python3 dev/robustness/guard_fuzz.py --robot seven --targets 1000000 --seed 0'
    ./rpbi shell -c 'python3 dev/robustness/guard_fuzz.py --robot lwr --geometry exact --targets 0 --climbs 30'

Not one of the benchmarks that `./rpbi bench` runs. Each line that it prints ends with numbers that can be added up over
several runs with other seeds. It ends with 1 if a command was not safe.
"""

from __future__ import annotations

import argparse
import sys
import time

import numpy as np
from fuzz.climbing import TOLERANCE_M, Climber
from fuzz.hostile import fuzz
from fuzz.leaving import leave_margin
from fuzz.oracle import Oracle
from fuzz.scenes import MARGIN_M, SCENES

SHOWN = 20
"""Largest number of printed faults."""


def main() -> int:
    """Runs from the command line; returns its exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robot", choices=SCENES, default="two", help="by how many joints it has (two)")
    parser.add_argument("--policy", nargs="*", choices=("reject", "limit"), default=("reject", "limit"))
    parser.add_argument("--shape", action="store_true", help="targets are smoothed")
    parser.add_argument("--geometry", choices=("hulls", "exact"), default="hulls", help="of the guard (hulls)")
    parser.add_argument("--targets", type=int, default=100_000, help="for each policy")
    parser.add_argument("--states", type=int, default=0, help="states inside the margin; only of two joints")
    parser.add_argument("--climbs", type=int, default=0, help="hill climbs on the smallest distance; policy limit only")
    parser.add_argument("--steps", type=int, default=100, help="of each climb (100)")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    if options.states and options.robot != "two":
        parser.error("--states: expected --robot two")
    if options.targets and not options.policy:
        parser.error("--policy: expected reject, limit or both")
    scene, is_safe = SCENES[options.robot], True
    of = f"robot={options.robot} seed={options.seed}"
    for policy in options.policy if options.targets else ():
        began_s = time.process_time()
        guard = scene.guard(policy, shape=options.shape, geometry=options.geometry)
        report = fuzz(scene, guard, Oracle(scene), options.targets, np.random.default_rng(options.seed))
        spent_s = time.process_time() - began_s
        shares = " ".join(f"{key}={share:.6f}" for key, share in report.worst.items())
        refused = " ".join(f"{check}={count}" for check, count in sorted(report.refused.items()))
        print(*report.faults[:SHOWN], sep="\n", end="\n" if report.faults else "")
        print(
            f"{of} policy={policy} shape={int(options.shape)} geometry={options.geometry} "
            f"{shares} nearest_mm={1e3 * report.nearest_m:.2f} per_second={report.targets / spent_s:.0f} "
            f"refused: {refused} sums: targets={report.targets} commands={report.commands} "
            f"not_safe={report.refused.total()} brakings={report.brakings} "
            f"seconds={spent_s:.0f} faults={len(report.faults)}",
            flush=True,
        )
        is_safe &= not report.faults
    if options.states:
        began_s = time.process_time()
        left = leave_margin(scene, Oracle(scene), options.states, np.random.default_rng(options.seed))
        print(*left.stuck, sep="\n", end="\n" if left.stuck else "")
        print(
            f"{of} slowest={left.slowest:.4f} nearer_um={1e6 * left.nearer_m:.1f} sums: states={options.states} "
            f"straight={left.straight} curved={left.curved} locked={left.locked} narrow={left.narrow} "
            f"stuck={len(left.stuck)} "
            f"seconds={time.process_time() - began_s:.0f}"
        )
        is_safe &= not left.stuck
    if options.climbs:
        guard = scene.guard("limit", geometry=options.geometry)
        for seed in range(options.seed, options.seed + options.climbs):
            climber = Climber(scene, guard, np.random.default_rng(seed), options.geometry)
            found_m, course = climber.climb(options.steps)
            print(f"climb robot={options.robot} seed={seed} geometry={options.geometry} nearest_mm={1e3 * found_m:.5f}")
            if found_m < MARGIN_M - TOLERANCE_M:
                print(f"inside the margin: {course}", flush=True)
                is_safe = False
    return 0 if is_safe else 1


if __name__ == "__main__":
    sys.exit(main())
