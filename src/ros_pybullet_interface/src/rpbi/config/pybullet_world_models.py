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
        description="GUI opens PyBullet's window; DIRECT does not need a screen.",
        json_schema_extra={"default": "GUI"},
    )
    options: Text | None = optional("Further options of the connection, such as `--mp4=FILE` to record the window.")
    key: Count | None = optional("Key of the shared memory, for the connection mode SHARED_MEMORY.")
    hostName: Text | None = optional("Host of the PyBullet server to connect to.")
    port: Annotated[int, Field(ge=1, le=65535)] | None = optional("Port of the PyBullet server.")

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

    flags: Annotated[int, RESET_FLAGS] | None = optional("One or more RESET_USE_... constants.")


class SetGravity(PybulletModel):
    """Gravity; zero by default."""

    gravX: Acceleration = Field(0.0, description="Acceleration along the world's x axis.")
    gravY: Acceleration = Field(0.0, description="Acceleration along the world's y axis.")
    gravZ: Acceleration = Field(0.0, description="Acceleration along the world's z axis; -9.81 on Earth.")

    def kwargs(self) -> dict[str, Any]:
        """Returns all three keyword arguments, which PyBullet requires."""
        return self.model_dump()


class SetPhysicsEngineParameter(PybulletModel):
    """Parameters of the solver, except `fixedTimeStep`, which the main file's key `timeStep` sets."""

    numSolverIterations: Iterations | None = optional("Largest number of solver iterations in a step.")
    useSplitImpulse: Switch | None = optional(
        "Whether penetration is corrected separately, without effect on velocities."
    )
    splitImpulsePenetrationThreshold: Metres | None = optional(
        "Penetration depth above which `useSplitImpulse` has an effect."
    )
    numSubSteps: Annotated[Count, Field(le=1_000)] | None = optional("Number of parts into which each step is divided.")
    collisionFilterMode: Count | None = optional(
        "Rule for collision filters: 0 if the masks of both bodies must match, 1 if one match is enough."
    )
    contactBreakingThreshold: NonNegativeMetres | None = optional("Distance above which a contact ends.")
    maxNumCmdPer1ms: Annotated[int, Field(ge=-1, lt=2**31)] | None = optional(
        "Largest number of commands per millisecond."
    )
    enableFileCaching: Switch | None = optional("Whether each file is read only once.")
    restitutionVelocityThreshold: Annotated[NonNegative, Unit("m/s")] | None = optional(
        "Velocity below which bodies do not bounce."
    )
    erp: NonNegative | None = optional("Fraction of a joint's error that is corrected in a step.")
    contactERP: NonNegative | None = optional("Fraction of a contact's penetration that is corrected in a step.")
    frictionERP: NonNegative | None = optional(
        "Fraction of the drift at a contact with a friction anchor that is corrected in a step."
    )
    enableConeFriction: Switch | None = optional("Whether friction limits form a cone, otherwise a pyramid.")
    deterministicOverlappingPairs: Switch | None = optional(
        "Whether overlapping pairs of bodies are sorted, so that results are reproducible."
    )
    allowedCcdPenetration: NonNegativeMetres | None = optional(
        "Penetration that continuous collision detection permits."
    )
    jointFeedbackMode: Annotated[int, JOINT_FEEDBACK_MODES] | None = optional(
        "One or more JOINT_FEEDBACK_... constants, which select the frame of a joint's reaction force and torque."
    )
    solverResidualThreshold: NonNegative | None = optional("Residual below which the solver stops.")
    contactSlop: NonNegativeMetres | None = optional("Penetration that is not corrected.")
    enableSAT: Switch | None = optional("Whether collision detection uses the separating axis test.")
    constraintSolverType: Annotated[int, SOLVER_TYPES] | None = optional(
        "Solver of constraints, a CONSTRAINT_SOLVER_LCP_... constant."
    )
    globalCFM: NonNegative | None = optional("Constraint force mixing: softness of all constraints.")
    minimumSolverIslandSize: Count | None = optional("Least number of constraints that are solved together.")
    reportSolverAnalytics: Switch | None = optional("Whether the solver reports statistics of each step.")
    warmStartingFactor: NonNegative | None = optional(
        "Fraction of the last step's solution with which the solver starts."
    )
    sparseSdfVoxelSize: PositiveMetres | None = optional(
        "Voxel size of the signed distance field for collisions of soft bodies."
    )
    numNonContactInnerIterations: Iterations | None = optional(
        "Number of iterations on joints in each iteration of the solver."
    )


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
        description="One or more COV_... constants: options that are switched on or off.",
        json_schema_extra={"default": "COV_ENABLE_GUI"},
    )
    enable: Switch = Field(False, description="Whether the options in `flag` are switched on, otherwise off.")
    lightPosition: Position | None = optional("Position of the light in the world.")
    shadowMapResolution: Annotated[Count, Unit("px")] | None = optional("Resolution of the shadows.")
    shadowMapWorldSize: Annotated[Count, Unit("m")] | None = optional("Side of the area in which shadows are drawn.")
    remoteSyncTransformInterval: Annotated[NonNegative, Unit("s")] | None = optional(
        "Time between two updates of a remote window."
    )
    shadowMapIntensity: NonNegative | None = optional("Darkness of shadows, from 0 to 1.")
    rgbBackground: Rgb | None = optional("Colour of the background: red, green and blue, each from 0 to 1.")

    def calls(self) -> list[dict[str, Any]]:
        """Returns one set of keyword arguments per flag, since PyBullet accepts only one flag in a call."""
        others = {"enable": self.enable, **self.kwargs()}
        return [{**others, "flag": flag} for flag in self.flag]


class ResetDebugVisualizerCamera(PybulletModel):
    """Camera of PyBullet's window."""

    cameraDistance: PositiveMetres = Field(1.0, description="Distance of the camera from the target point.")
    cameraYaw: Degrees = Field(0.0, description="Rotation of the camera about the world's z axis.")
    cameraPitch: Degrees = Field(1.0, description="Angle above the horizontal; a negative angle looks down.")
    cameraTargetPosition: Position = Field(
        (0.0, 0.0, 0.0), description="Target point in the world, to which the camera looks."
    )

    def kwargs(self) -> dict[str, Any]:
        """Returns all four keyword arguments, which PyBullet requires."""
        return self.model_dump()
