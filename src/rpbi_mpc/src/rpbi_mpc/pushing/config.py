"""Options of the controller that pushes a slider along a path."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from custom_ros_tools.schema import ConfigModel, ListOf, NonNegative, Positive, PositiveMetres, Seconds, Unit
from rpbi_mpc.pushing.planar.model import SliderConfig

from .outcome import ToleranceConfig
from .planar.estimate import EstimatorConfig
from .planar.motion import ApproachConfig
from .planar.paths import PathConfig


class WeightsConfig(ConfigModel):
    """Weights of the terms of the cost, which is a sum over the horizon. Most terms are squares.

    Attributes:
        position: Distance from the reference position [1/m^2].
        yaw: Difference between yaw and the reference yaw, which is the direction of the path [1/rad^2].
        contact: Distance of the pusher from the middle of the face [1/m^2].
        force: Tangential force, and difference between the normal force and the force that moves the slider along the
            path [s^2/m^2].
        sliding: Speed of sliding along the face [s^2/m^2].
        change: Difference between the force in the first step and the previous force [s^2/m^2].
        final: Factor by which the weights of the last state are multiplied.
        complementarity: Violation that the function `complementarity` returns: the contact slides although the force
            is not at the edge of the friction cone [s^2/m^2].
    """

    position: NonNegative = Field(30000.0, description="Weight of the slider's distance from the path [1/m^2].")
    yaw: NonNegative = Field(
        10.0, description="Weight of the difference between the slider's yaw and the direction of the path [1/rad^2]."
    )
    contact: NonNegative = Field(
        1.0, description="Weight of the pusher's distance from the middle of the face [1/m^2]."
    )
    force: NonNegative = Field(
        10.0,
        description="Weight of the tangential force, and of the difference between the normal force and the force "
        "that moves the slider along the path [s^2/m^2].",
    )
    sliding: NonNegative = Field(10.0, description="Weight of the pusher's speed of sliding along the face [s^2/m^2].")
    change: NonNegative = Field(
        10.0,
        description="Weight of the difference between the force in the first step and the previous force [s^2/m^2].",
    )
    final: NonNegative = Field(5.0, description="Factor of the weights for the last state.")
    complementarity: Positive = Field(
        1000.0,
        description="Weight of forces and velocities with which the contact neither sticks nor slides [s^2/m^2].",
    )


class ProgramConfig(ConfigModel):
    """Horizon, limits and solver.

    Attributes:
        steps: Number of steps of the horizon.
        step_s: Duration of a step [s].
        max_speed: Largest speed of the pusher normal to the face, and largest speed of sliding along the face [m/s].
        weights: Weights of the cost.
        solvers: Solvers, which are tried in this order until one converges. `fatrop` (L. Vanroye et al., IROS 2023) is
            an interior-point method for optimal control. `ipopt` (A. Waechter and L. Biegler, Mathematical Programming
            106, 2006) is several times slower but converges more often.
        max_iterations: Number of iterations after which a solver gives up.
        tolerance: Optimality error at which a solver stops.
    """

    steps: Annotated[int, Field(ge=2, le=200)] = Field(20, description="Number of steps of the horizon.")
    step_s: Seconds = Field(0.08, description="Duration of a step.")
    max_speed: Annotated[Positive, Unit("m/s")] = Field(
        0.15, description="Largest speed of the pusher normal to the face, and largest speed of sliding along the face."
    )
    weights: WeightsConfig = Field(WeightsConfig(), description="Weights of the cost.")
    solvers: Annotated[ListOf[Literal["fatrop", "ipopt"]], Field(min_length=1)] = Field(
        ("fatrop", "ipopt"), description="Solvers, tried in this order until one converges."
    )
    max_iterations: Annotated[int, Field(ge=1)] = Field(
        40, description="Number of iterations after which a solver gives up."
    )
    tolerance: Positive = Field(1e-3, description="Optimality error below which a solver stops.")


class PushingConfig(ConfigModel):
    """Options of the controller that pushes a slider along a path.

    Attributes:
        slider: Size, friction and support of the slider.
        radius: Radius of the pusher [m].
        path: Shape, start and speed of the path.
        program: Horizon, cost and solver.
        estimator: Filter of measurements.
        approach: Motion of the pusher to the slider.
        gap_rate: While pushing, `gap_rate` times the gap between pusher and slider is added to the first command's
            speed towards the slider [1/s].
        max_lag: Largest lead of the reference over the slider, along the path [m]. With a larger lead, the reference
            waits.
        max_off: Distance of the slider from the path beyond which the task fails [m].
        tolerance: Limits on the errors of a successful push.
        settle_s: Time for which the reference stays at the end of the path before the task is done [s].
        cycle_s: Duration of a cycle, in which one command acts [s].
        lag_s: Delay from a command to the resulting motion of the pusher, in addition to the delay of the loop [s].
        plan_cycles: Number of commands in a plan, one for each cycle.
        max_command: Largest speed of the pusher [m/s].
    """

    slider: SliderConfig = Field(SliderConfig(), description="The pushed box.")
    radius: PositiveMetres = Field(0.01, description="Radius of the pusher.")
    path: PathConfig = Field(PathConfig(), description="Path of the slider.")
    program: ProgramConfig = Field(ProgramConfig(), description="Horizon, cost and solver of the nonlinear program.")
    estimator: EstimatorConfig = Field(EstimatorConfig(), description="Gains of the filter for measurements.")
    approach: ApproachConfig = Field(ApproachConfig(), description="Motion of the pusher to the slider before a push.")
    gap_rate: Annotated[NonNegative, Unit("1/s")] = Field(
        5.0, description="Ratio of the pusher's closing velocity to the gap between pusher and face during a push."
    )
    max_lag: PositiveMetres = Field(
        0.03,
        description="Largest lead of the reference over the slider, along the path. With a larger lead, the "
        "reference waits.",
    )
    max_off: PositiveMetres = Field(
        0.15, description="Distance of the slider from the path above which the task fails."
    )
    tolerance: ToleranceConfig = Field(ToleranceConfig(), description="Limits on the errors of a successful push.")
    settle_s: Annotated[NonNegative, Unit("s")] = Field(
        1.0, description="Time for which the reference stays at the end of the path before the task is done."
    )
    cycle_s: Seconds = Field(0.04, description="Duration of a cycle, in which one command acts.")
    lag_s: Annotated[NonNegative, Unit("s")] = Field(
        0.0,
        description="Delay from a command to the resulting motion of the pusher, in addition to the delay of the loop.",
    )
    plan_cycles: Annotated[int, Field(ge=1)] = Field(6, description="Number of commands in a plan, one for each cycle.")
    max_command: Annotated[Positive, Unit("m/s")] = Field(0.2, description="Largest speed of the pusher.")
