"""The loop in lock-step: its order, its delay, and what it does without a plan or a measurement."""

from __future__ import annotations

import json

import numpy as np
import pytest

from custom_ros_tools.errors import ConfigError, InterfaceError
from rpbi_mpc import ControlPlan, LockStep, LoopConfig, MpcController, Plant, Sensed, write_records


class Cart(Plant):
    """A cart whose velocity is commanded; it notes what happens."""

    def __init__(self):
        self.time_s, self.place, self.velocity = 0.0, 1.0, 0.0
        self.happened = []
        self.hidden = range(0)

    def sense(self):
        self.happened.append("sense")
        hidden = len([each for each in self.happened if each == "sense"]) - 1 in self.hidden
        return Sensed(self.time_s, None if hidden else np.array([self.place]), "eye: no pose" if hidden else "")

    def act(self, command):
        self.happened.append("act")
        self.velocity = float(command[0])

    def stand(self):
        self.happened.append("stand")
        self.velocity = 0.0

    def advance(self, duration_s):
        self.happened.append(f"{duration_s:g}")
        self.time_s += duration_s
        self.place += duration_s * self.velocity


class Regulator(MpcController):
    """Plans to go to 0 with a time constant of 0.2 s; some plans fail."""

    measured_names, command_names, state_names = ("place",), ("velocity",), ("place",)
    failure = ""

    def __init__(self, failing=(), wall_s=0.0, commands=4):
        self.failing, self.wall_s, self.count, self.commands = failing, wall_s, -1, commands

    def plan(self, sensed, delay_s):
        self.count += 1
        places = sensed.values[0] * 0.8 ** np.arange(self.commands + 1)
        converged = self.count not in self.failing
        commands = -5.0 * places[:-1, None]
        return ControlPlan(commands, places[:, None], 0.04, 1.0, converged, "limit", 7, self.wall_s, 0.001)


def test_measurement_comes_first_and_its_command_acts_after_the_delay():
    plant = Cart()
    cycle = LockStep(plant, Regulator(), LoopConfig(hz=25, delay_s=0.01)).cycle()
    assert plant.happened == ["sense", "0.01", "act", "0.03"]
    assert cycle.status == "solved" and cycle.command == [-5.0]
    assert plant.place == pytest.approx(1.0 - 0.03 * 5.0)


def test_last_plan_is_continued_then_the_loop_stops_with_reason():
    plant = Cart()
    loop = LockStep(plant, Regulator(failing=range(2, 99)), LoopConfig(delay_s=0.0, max_missed=2))
    cycles = loop.run(1.0)
    assert [str(each.status) for each in cycles] == ["solved", "solved", "last plan", "last plan", "stopped"]
    assert cycles[2].command == pytest.approx(cycles[1].plan.commands[1])
    assert cycles[3].command == pytest.approx(cycles[1].plan.commands[2])
    expected = "the solver did not converge: limit after 7 iterations; 3 cycles without a new plan"
    assert cycles[4].reason == expected and cycles[4].command is None and plant.velocity == 0.0
    loop.restart()
    loop.controller.failing = ()
    assert loop.run(0.1)[-1].status == "solved"


def test_a_plan_that_fails_once_does_not_stop_it():
    cycles = LockStep(Cart(), Regulator(failing=(1, 3)), LoopConfig(delay_s=0.0)).run(0.2)
    assert [str(each.status) for each in cycles] == ["solved", "last plan", "solved", "last plan", "solved"]


def test_failed_task_stops_the_loop_until_restarted():
    plant, controller = Cart(), Regulator()
    loop = LockStep(plant, controller, LoopConfig(delay_s=0.0))
    assert loop.run(0.1)[-1].status == "solved"
    controller.failure = "the cart is off the rails"
    cycles = loop.run(1.0)
    assert [(str(each.status), each.reason) for each in cycles] == [("stopped", "the cart is off the rails")]
    assert cycles[0].command is None and plant.velocity == 0.0
    controller.failure = ""
    loop.restart()
    assert loop.run(0.1)[-1].status == "solved"


def test_loop_waits_without_a_measurement_and_continues_with_the_next():
    plant = Cart()
    plant.hidden = range(2, 4)
    cycles = LockStep(plant, Regulator(), LoopConfig(delay_s=0.0)).run(0.2)
    assert [str(each.status) for each in cycles] == ["solved", "solved", "waiting", "waiting", "solved"]
    assert cycles[2].reason == "eye: no pose" and cycles[2].command is None


def test_slow_solver_counts_on_hardware_alone():
    simulated, real = Cart(), Cart()
    real.is_timed = True
    assert LockStep(simulated, Regulator(wall_s=9.0)).cycle().status == "solved"
    cycle = LockStep(real, Regulator(wall_s=9.0)).cycle()
    assert cycle.status == "stopped" and "the solver took 9000.0 ms, expected at most 20.0 ms" in cycle.reason


def test_wrong_number_of_values_and_non_finite_commands_are_refused():
    plant, controller = Cart(), Regulator()
    controller.command_names = ("velocity", "force")
    with pytest.raises(InterfaceError, match=r"command: expected 2 numbers \(velocity, force\), got \[-5.\]"):
        LockStep(plant, controller).cycle()
    plant.place = float("nan")
    cycle = LockStep(plant, Regulator()).cycle()
    assert cycle.status == "stopped" and "no finite number" in cycle.reason and "act" not in plant.happened


def test_delay_longer_than_a_cycle_is_refused():
    with pytest.raises(ConfigError, match=r"loop.yaml: delay_s: expected at most the 0.04 s of a cycle, got 0.05"):
        LoopConfig.parse({"hz": 25, "delay_s": 0.05}, "loop.yaml")


def test_cycles_are_written_as_a_table_with_their_figures(tmp_path):
    import pandas

    loop = LockStep(Cart(), Regulator(failing=(1,)), LoopConfig(delay_s=0.0))
    loop.run(0.2)
    summary = write_records(tmp_path / "out", loop.cycles, loop.controller)
    table = pandas.read_csv(tmp_path / "out/cycles.csv")
    assert list(table["status"]) == ["solved", "last plan", "solved", "solved", "solved"]
    assert table["measured.place"][1] == pytest.approx(0.8) and table["command.velocity"][0] == -5.0
    assert summary["by_status"]["last plan"] == 1 and summary["processor_p99_ms"] == pytest.approx(1.0)
    assert json.loads((tmp_path / "out/summary.json").read_text()) == summary
