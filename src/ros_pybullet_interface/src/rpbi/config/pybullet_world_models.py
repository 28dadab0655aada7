"""Models of the YAML keys that set arguments of PyBullet's functions for the world.

Each model is named after a PyBullet function.
"""

from __future__ import annotations

from typing import Annotated, Any

import pybullet
from pydantic import BeforeValidator, Field, model_validator

from custom_ros_tools.schema import (
    AlsoTakes,
    Count,
    Degrees,
    KeyedError,
    ListOf,
    Metres,
    NonNegative,
    NonNegativeMetres,
    Position,
    PositiveMetres,
    Rgb,
    Switch,
    Text,
    Unit,
    optional,
)

from .pybullet_args import CONNECTION_MODES, JOINT_FEEDBACK_MODES, RESET_FLAGS, SOLVER_TYPES, VISUALIZER_FLAGS
from .pybullet_models import PybulletModel

Acceleration = Annotated[float, Field(ge=-1e6, le=1e6), Unit("m/s^2")]
Iterations = Annotated[int, Field(ge=1, le=100_000)]


class Connect(PybulletModel):
    """Connection to PyBullet."""

    connection_mode: Annotated[int, CONNECTION_MODES] = Field(
        pybullet.GUI,
        description="GUI opens PyBullet's window, DIRECT needs no screen.",
        json_schema_extra={"default": "GUI"},
    )
    options: Text | None = optional("Further options, such as `--mp4=FILE` to record the window.")
    key: Count | None = optional("Key of the shared memory.")
    hostName: Text | None = optional("Host of a server to connect to.")
    port: Annotated[int, Field(ge=1, le=65535)] | None = optional("Port of that server.")

    @model_validator(mode="after")
    def _one_way_to_connect(self) -> Connect:
        if self.key is not None and (self.hostName or self.port):
            raise KeyedError("key", "is for shared memory, hostName and port for a server: give one of both")
        return self

    def kwargs(self) -> dict[str, Any]:
        """Returns the keyword arguments that YAML sets, and always `connection_mode`."""
        return {"connection_mode": self.connection_mode, **super().kwargs()}


class ResetSimulation(PybulletModel):
    """Kind of world: with or without soft bodies."""

    flags: Annotated[int, RESET_FLAGS] | None = optional("RESET_USE_... flags.")


class SetGravity(PybulletModel):
    """Gravity; zero by default."""

    gravX: Acceleration = Field(0.0, description="Acceleration along x.")
    gravY: Acceleration = Field(0.0, description="Acceleration along y.")
    gravZ: Acceleration = Field(0.0, description="Acceleration along z, -9.81 on Earth.")

    def kwargs(self) -> dict[str, Any]:
        """Returns all three keyword arguments, which PyBullet requires."""
        return self.model_dump()


class SetPhysicsEngineParameter(PybulletModel):
    """Parameters of the solver, except `fixedTimeStep`, which the main file's key `timeStep` sets."""

    numSolverIterations: Iterations | None = optional("Most iterations of the solver.")
    useSplitImpulse: Switch | None = optional("Whether penetration is solved apart from velocity.")
    splitImpulsePenetrationThreshold: Metres | None = optional("Penetration from which it is solved apart.")
    numSubSteps: Annotated[Count, Field(le=1_000)] | None = optional("Parts that each step is divided into.")
    collisionFilterMode: Count | None = optional("0: both masks must match, 1: one of them.")
    contactBreakingThreshold: NonNegativeMetres | None = optional("Distance at which contacts end.")
    maxNumCmdPer1ms: Annotated[int, Field(ge=-1, lt=2**31)] | None = optional("Most commands in a millisecond.")
    enableFileCaching: Switch | None = optional("Whether files are read once only.")
    restitutionVelocityThreshold: Annotated[NonNegative, Unit("m/s")] | None = optional(
        "Velocity below which nothing bounces."
    )
    erp: NonNegative | None = optional("Share of a joint's error mended in a step.")
    contactERP: NonNegative | None = optional("Share of a contact's error mended in a step.")
    frictionERP: NonNegative | None = optional("The same for friction, if anchored.")
    enableConeFriction: Switch | None = optional("Whether friction is a cone, else a pyramid.")
    deterministicOverlappingPairs: Switch | None = optional("Whether contacts are sorted.")
    allowedCcdPenetration: NonNegativeMetres | None = optional("Penetration allowed to continuous collision detection.")
    jointFeedbackMode: Annotated[int, JOINT_FEEDBACK_MODES] | None = optional(
        "JOINT_FEEDBACK_... flags: frame of the force and torque of a joint."
    )
    solverResidualThreshold: NonNegative | None = optional("Residual at which the solver stops.")
    contactSlop: NonNegativeMetres | None = optional("Penetration left alone.")
    enableSAT: Switch | None = optional("Whether the separating axis test is used.")
    constraintSolverType: Annotated[int, SOLVER_TYPES] | None = optional("CONSTRAINT_SOLVER_LCP_... constant.")
    globalCFM: NonNegative | None = optional("Softness of all constraints.")
    minimumSolverIslandSize: Count | None = optional("Fewest constraints solved together.")
    reportSolverAnalytics: Switch | None = optional("Whether the solver reports its steps.")
    warmStartingFactor: NonNegative | None = optional("Share of the last step's solution reused.")
    sparseSdfVoxelSize: PositiveMetres | None = optional("Voxel size for soft bodies.")
    numNonContactInnerIterations: Iterations | None = optional("Iterations on joints in each of the solver's.")


PhysicsChange = SetGravity | SetPhysicsEngineParameter
"""Settings of the physics that can change while a world runs."""


def _as_list(given: Any) -> Any:
    """Converts one flag, or a text `A|B` of several flags, to a list; returns a list unchanged."""
    if isinstance(given, str):
        return given.split("|")
    return given if isinstance(given, (list, tuple)) else [given]


class ConfigureDebugVisualizer(PybulletModel):
    """Content of PyBullet's window."""

    flag: Annotated[
        ListOf[Annotated[int, VISUALIZER_FLAGS]],
        BeforeValidator(_as_list),
        AlsoTakes(VISUALIZER_FLAGS.one_or_several_schema()),
    ] = Field(
        (pybullet.COV_ENABLE_GUI,),
        description="COV_... constants to switch.",
        json_schema_extra={"default": "COV_ENABLE_GUI"},
    )
    enable: Switch = Field(False, description="Whether they are switched on.")
    lightPosition: Position | None = optional("Where the light is.")
    shadowMapResolution: Annotated[Count, Unit("px")] | None = optional("Resolution of shadows.")
    shadowMapWorldSize: Annotated[Count, Unit("m")] | None = optional("Extent of shadows.")
    remoteSyncTransformInterval: Annotated[NonNegative, Unit("s")] | None = optional(
        "Time between updates of a remote window."
    )
    shadowMapIntensity: NonNegative | None = optional("Darkness of shadows, 0 to 1.")
    rgbBackground: Rgb | None = optional("Colour of the background, each from 0 to 1.")

    def calls(self) -> list[dict[str, Any]]:
        """Returns one set of keyword arguments per flag, since PyBullet accepts only one flag in a call."""
        others = {"enable": self.enable, **self.kwargs()}
        return [{**others, "flag": flag} for flag in self.flag]


class ResetDebugVisualizerCamera(PybulletModel):
    """Camera of PyBullet's window."""

    cameraDistance: PositiveMetres = Field(1.0, description="Distance from the target.")
    cameraYaw: Degrees = Field(0.0, description="Angle about the vertical.")
    cameraPitch: Degrees = Field(1.0, description="Angle above the horizontal, negative looks down.")
    cameraTargetPosition: Position = Field((0.0, 0.0, 0.0), description="Point that it looks at.")

    def kwargs(self) -> dict[str, Any]:
        """Returns all four keyword arguments, which PyBullet requires."""
        return self.model_dump()
