"""How often a fast hand is stopped: `teleop.launch real_robot:=true` with emulated devices, and the stand-in's arm.

One guard checks the commands of the simulated arm, another one those of the stand-in. The control is the same
hand without guards. The targets are then judged once more by a guard that refuses, with and without smoothing.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
from result import Result, Target
from session import Session
from virtual_screen import virtual_screen

from robot_model.model import RobotModel
from safe_robot.check import CheckContext
from safe_robot.config import GuardConfig
from safe_robot.guard import Guard

LWR = Path(__file__).resolve().parents[2] / "src/rpbi_examples/robots/kuka_lwr.urdf"
DEVICES = ("spacenav", "keyboard", "mouse")
SEEDS, SECONDS = 5, 240.0
"""An hour together."""
QUICK_SEEDS, QUICK_SECONDS = 1, 20.0
CONTROL_SECONDS = 60.0
REFUSING = {"period_s": 0.009, "start_from": "target", "limits": {"acceleration": 10.0, "jerk": 1000.0}}
REFUSING |= {"start_tolerance": 10.0}  # it is started again wherever the target is
TARGETS = {True: "/guarded/joint_states/target", False: "/rpbi/kuka_lwr/joint_states/target"}
"""Topics of inverse kinematics, with and without guards."""
LOAD_REASONS = ("staleness", "source", "master", "command_rate", "command_timeout", "following_error", "torque")
"""Beginnings of reasons that also depend on the load of the machine; others follow from the commands alone."""
ROW = "{:<9} {:>4}  {:<5} {:>7} {:>7}  {}"
HEADING = ROW.format("device", "seed", "guard", "time", "targets", "stopped by")


def run(quick: bool) -> list[Result]:
    """Returns counts of stops and reflexes; each run ends with its first one."""
    seeds, seconds = (QUICK_SEEDS, QUICK_SECONDS) if quick else (SEEDS, SECONDS)
    print(HEADING, file=sys.stderr)
    runs, rough, smooth, targets = [], 0, 0, 0
    for device in DEVICES:
        for seed in range(seeds):
            found, recorded = teleoperate(device, seed, seconds, True)
            runs.append(found)
            targets += len(recorded)
            rough += stops_at(recorded)
            smooth += stops_at(recorded, shape={})
    control = [teleoperate(device, 0, min(seconds, CONTROL_SECONDS), False)[0] for device in DEVICES]
    minutes = sum(found["seconds"] for found in runs) / 60.0
    decisions = sum(found["decisions"] for found in runs)
    reasons = [reason for found in runs for reason in (*found["unsafe"], found["reflex"]) if reason]
    late = sum(reason.startswith(LOAD_REASONS) for reason in reasons)
    unsafe = sum(not reason.startswith(LOAD_REASONS) for found in runs for reason in found["unsafe"])
    stops = sum(bool(found["reflex"]) and not found["reflex"].startswith(LOAD_REASONS) for found in runs)
    peaks = {each: max(found[f"peak_{each}"] for found in runs) for each in ("velocity", "acceleration", "jerk")}
    reflexes = sum(bool(found["reflex"]) for found in control)
    return [
        Result("teleop", f"decisions not safe, in {minutes:.0f} min", 100 * unsafe / decisions, "%", None, Target(0.1)),
        Result("teleop", "reflexes of the stand-in at commands", stops, "", None, Target(0)),
        Result("teleop", "stops that depend on how busy the machine is", late, ""),
        *(Result("teleop", f"largest {name}, share of the driver's limit", each, "") for name, each in peaks.items()),
        Result("teleop", "guard `reject`: targets that halt it", 100 * rough / targets, "%"),
        Result("teleop", "guard `reject` with `shape`", 100 * smooth / targets, "%", None, Target(0.1)),
        Result("teleop", f"no guard: reflexes in {len(control)} runs", reflexes, "", None, Target(1, at_least=True)),
    ]


def teleoperate(device: str, seed: int, seconds: float, guard: bool) -> tuple[dict[str, Any], np.ndarray]:
    """Returns the result of one run (see `programs/hand.py`), and its targets [rad], k x 7."""
    with virtual_screen(1280, 1024) as screen, Session(use_sim_time=False) as ros:
        display = f"DISPLAY={screen}"
        socket, file = str(ros.folder / "spnav.sock"), ros.folder / "targets.npy"
        ros.set_parameters("/spacenav/socket", socket)
        options = [f"device:={device}", f"guard:={str(guard).lower()}", "real_robot:=true", "headless:=true"]
        example = ros.start(["env", display, "roslaunch", "rpbi_examples", "teleop.launch", *options])
        program = str(Path(__file__).parent / "programs/hand.py")
        arguments = [device, str(seconds), str(seed), TARGETS[guard], str(file), "--socket", socket]
        hand = ros.start(["env", display, sys.executable, "-u", program, *arguments])
        try:
            found = ros.result_of(hand, seconds + 300.0)
        except RuntimeError as error:
            raise RuntimeError(f"{error}\n{ros.output(example)}") from None
        recorded = np.load(file)
    why = "; ".join(reason for reason in (*found["unsafe"][:1], found["reflex"]) if reason)
    row = ROW.format(device, seed, "on" if guard else "off", f"{found['seconds']:.0f} s", found["targets"], why)
    print(row, file=sys.stderr, flush=True)
    return found, recorded


def stops_at(targets: np.ndarray, **options: Any) -> int:
    """Returns how many of the targets a guard halts at, which is started again each time."""
    config = GuardConfig.parse({**REFUSING, **options}, "benchmark")
    guard = Guard(config, RobotModel(str(LWR)), "benchmark")
    stops = 0
    for target in targets.tolist():
        if guard.is_halted:
            guard.start()
        stops += guard.decide(target, CheckContext()).is_halted
    return stops
