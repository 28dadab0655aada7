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
    """Weights of the cost, a sum of squares over the horizon.

    Attributes:
        position: Distance from the path [1/m^2].
        yaw: Difference between yaw and the direction of the path [1/rad^2].
        contact: Distance of the pusher from the middle of the face [1/m^2].
        force: Tangential force, and difference between the normal force and the force that moves the slider along the
            path [s^2/m^2].
        sliding: Speed of sliding along the face [s^2/m^2].
        change: Difference between the force in the first step and the previous force [s^2/m^2].
        final: Factor for the weights of the last state.
        complementarity: Penalty for inputs with which the contact neither sticks nor slides [s^2/m^2].
    """

    position: NonNegative = Field(30000.0, description="Weight of the distance from the path [1/m^2].")
    yaw: NonNegative = Field(10.0, description="Weight of the difference from its direction [1/rad^2].")
    contact: NonNegative = Field(1.0, description="Weight of the pusher's distance from the middle [1/m^2].")
    force: NonNegative = Field(10.0, description="Weight of deviations from the forces along the path [s^2/m^2].")
    sliding: NonNegative = Field(10.0, description="Weight of sliding along the face [s^2/m^2].")
    change: NonNegative = Field(10.0, description="Weight of a change of the force at the first step [s^2/m^2].")
    final: NonNegative = Field(5.0, description="Factor of the weights of the last state.")
    complementarity: Positive = Field(1000.0, description="Penalty of neither sticking nor sliding [s^2/m^2].")


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
    max_speed: Annotated[Positive, Unit("m/s")] = Field(0.15, description="Largest speed of the pusher.")
    weights: WeightsConfig = Field(WeightsConfig(), description="The cost.")
    solvers: Annotated[ListOf[Literal["fatrop", "ipopt"]], Field(min_length=1)] = Field(
        ("fatrop", "ipopt"), description="Solvers, tried in this order until one converges."
    )
    max_iterations: Annotated[int, Field(ge=1)] = Field(40, description="Largest number of iterations.")
    tolerance: Positive = Field(1e-3, description="Optimality at which it stops.")


class PushingConfig(ConfigModel):
    """Options of the controller that pushes a slider along a path.

    Attributes:
        slider: Size, friction and support of the slider.
        radius: Radius of the pusher [m].
        path: Shape, start and speed of the path.
        program: Horizon, cost and solver.
        estimator: Filter of measurements.
        approach: Motion of the pusher to the slider.
        gap_rate: Ratio of the additional speed towards the slider to the gap between pusher and slider while pushing
            [1/s].
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

    slider: SliderConfig = Field(SliderConfig(), description="The slider.")
    radius: PositiveMetres = Field(0.01, description="Radius of the pusher.")
    path: PathConfig = Field(PathConfig(), description="The path.")
    program: ProgramConfig = Field(ProgramConfig(), description="Horizon, cost and solver.")
    estimator: EstimatorConfig = Field(EstimatorConfig(), description="Filter of measurements.")
    approach: ApproachConfig = Field(ApproachConfig(), description="Motion of the pusher to the slider.")
    gap_rate: Annotated[NonNegative, Unit("1/s")] = Field(5.0, description="Rate at which a gap is closed in contact.")
    max_lag: PositiveMetres = Field(0.03, description="Distance ahead of the slider at which the reference waits.")
    max_off: PositiveMetres = Field(0.15, description="Distance of the slider from the path at which the loop stops.")
    tolerance: ToleranceConfig = Field(ToleranceConfig(), description="Largest errors of a successful push.")
    settle_s: Annotated[NonNegative, Unit("s")] = Field(1.0, description="Time at the last pose of the path.")
    cycle_s: Seconds = Field(0.04, description="Time of a cycle.")
    lag_s: Annotated[NonNegative, Unit("s")] = Field(0.0, description="Delay of the pusher's motion.")
    plan_cycles: Annotated[int, Field(ge=1)] = Field(6, description="Commands of a plan, one for each cycle.")
    max_command: Annotated[Positive, Unit("m/s")] = Field(0.2, description="Largest speed of the pusher.")
