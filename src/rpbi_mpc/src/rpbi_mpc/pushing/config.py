"""Options of the controller that pushes a slider along a path."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from custom_ros_tools.schema import ConfigModel, NonNegative, Positive, PositiveMetres, Seconds, Unit
from rpbi_mpc.pushing.planar.model import SliderConfig

from .outcome import ToleranceConfig
from .planar.estimate import EstimatorConfig
from .planar.motion import ApproachConfig
from .planar.paths import PathConfig
from .program import ProgramConfig


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
