"""The renderer process's own copy of the world, in a PyBullet client without physics."""

import logging
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from robot_model.geometry import Vector
from rpbi.bodies import Body
from rpbi.engine.client import Client
from rpbi.samples import BodyState
from rpbi.world.load_log import LogEntry, apply

from .camera import depth_in_metres
from .channel import DrawnScene
from .frame import Camera, Frame
from .renderers import Renderer, Transparency, TransparentShape
from .tessellation import FineShapes

log = logging.getLogger(__name__)

SHORTEST_STEP_S = 1e-9
"""Length of a time step [s] so short that bodies practically do not move."""


class SoftShapes:
    """Sets the shapes of soft bodies in a client without physics.

    PyBullet draws a soft body in the shape that the body had after the last simulation step. A new shape therefore
    needs a step, whose length is so short that bodies practically do not move.

    Args:
        pb: The client, right after its world was set up.
    """

    def __init__(self, pb: Client) -> None:
        self._pb = pb
        if pb.is_deformable:
            pb.setGravity(0.0, 0.0, 0.0)
            pb.setTimeStep(SHORTEST_STEP_S)

    def disable_physics(self, body: Body) -> None:
        """Disables the collisions and removes the anchors of a new body, if the world has soft bodies."""
        if self._pb.is_deformable:
            body.detach()
            for link in (-1, *body.joint_indices):
                self._pb.setCollisionFilterGroupMask(body.body_id, link, 0, 0)

    def show(self, nodes: Sequence[tuple[Body, Sequence[Vector]]]) -> None:
        """Moves the nodes of soft bodies; the caller must set the poses of rigid bodies afterwards.

        Args:
            nodes: For each soft body, the body and the positions [m] of all its simulated nodes in the world frame.
        """
        for body, places in nodes:
            self._pb.resetMeshData(body.body_id, places)
        self._pb.stepSimulation()


class Mirror:
    """A copy of the simulator's world without physics.

    The bodies are built from the load log, and their poses are set from scenes.
    """

    def __init__(self, pb: Client) -> None:
        self._pb = pb
        self._bodies: dict[str, Body] = {}
        self._shown: dict[str, BodyState] = {}
        self._fine_shapes = FineShapes()
        self._transparency = Transparency(pb)
        self._soft_shapes = SoftShapes(pb)

    @property
    def transparent(self) -> tuple[TransparentShape, ...]:
        """All transparent shapes of the world."""
        return self._transparency.shapes

    def apply(self, entry: LogEntry) -> None:
        """Applies an entry of the load log; after a failure, logs a warning, and images may lack the entry's body."""
        if entry.what == "physics":
            return  # no physics here
        if entry.what == "world":
            self._bodies.clear()
            self._shown.clear()
        self._shown.pop(entry.name, None)
        try:
            apply(self._pb, self._bodies, self._as_drawn(entry))
            if entry.what == "world":
                self._soft_shapes = SoftShapes(self._pb)
                self._transparency = Transparency(self._pb)  # PyBullet has forgotten all earlier shapes
            elif entry.what == "add":
                self._soft_shapes.disable_physics(self._bodies[entry.name])
        except Exception as error:
            log.warning("cannot render '%s': %s", entry.name, error)
        self._transparency.update({body.body_id for body in self._bodies.values()})

    def close(self) -> None:
        """Deletes the mesh files that were written for simple shapes."""
        self._fine_shapes.close()

    def _as_drawn(self, entry: LogEntry) -> LogEntry:
        """Returns an entry in which the mesh to draw replaces the visual shape of an added body; see `FineShapes`."""
        if entry.what != "add":
            return entry
        kind, config = entry.arguments
        shape = getattr(config, "createVisualShape", None)
        if shape is None:
            return entry
        drawn = config.model_copy(update={"createVisualShape": self._fine_shapes.of(shape)})
        return entry._replace(arguments=(kind, drawn))

    def show(self, states: Iterable[BodyState]) -> None:
        """Sets bodies to `states`, states of the simulator's bodies with the same names."""
        states = tuple(states)
        soft = [state for state in states if state.nodes and state.name in self._bodies]
        if any(self._shown.get(state.name) != state for state in soft):
            self._soft_shapes.show([(self._bodies[state.name], state.nodes) for state in soft])
            self._shown = {state.name: state for state in soft}  # the step may have moved all other bodies
        for state in states:
            if not state.nodes:
                self.pose(state)

    def frame(self, renderer: Renderer, scene: DrawnScene, camera: Camera, streams: Collection[str]) -> Frame:
        """Sets the bodies to the states of a scene, and returns the images that a camera sees.

        Args:
            renderer: Renderer of this world's client.
            scene: States of all bodies, and pose of the camera.
            camera: The camera.
            streams: Streams to draw, see `Demand`; for `info` alone, no images are drawn.
        """
        sample, intrinsics = scene.sample, camera.intrinsics
        frame = Frame(camera, sample.tick, sample.stamp_ns)
        if set(streams) == {"info"}:
            return frame
        assert sample.camera is not None
        self.show(sample.bodies)
        drawing = renderer.draw(intrinsics, sample.camera, "segmentation" in streams, self.transparent)
        images: dict[str, Any] = {}
        if {"colour", "jpeg", "points"}.intersection(streams):
            images["colour"] = _without_alpha(drawing.rgba)
        if {"depth", "points"}.intersection(streams):
            images["depth"] = depth_in_metres(drawing.depth_buffer, intrinsics)
            if camera.noise is not None:
                camera.noise.add_to(images["depth"], sample.tick, intrinsics.near_m, intrinsics.far_m)
        if "segmentation" in streams:
            images["segmentation"] = self.to_simulator_ids(drawing.body_ids, scene.body_ids)
        return frame._replace(**images)

    def pose(self, state: BodyState) -> None:
        """Sets a rigid body to `state`, a state of the same body in the simulator."""
        body = self._bodies.get(state.name)
        shown = self._shown.get(state.name)
        if body is None or shown == state:
            return
        if shown is None or shown.base != state.base:
            self._pb.resetBasePositionAndOrientation(body.body_id, state.base[:3], state.base[3:])
        before = shown.joints if shown else (None,) * len(state.joints)
        for index, (old, new) in enumerate(zip(before, state.joints)):
            if old != new and isinstance(new, tuple):
                self._pb.resetJointStateMultiDof(body.body_id, index, new)
            elif old != new:
                self._pb.resetJointState(body.body_id, index, new)
        self._shown[state.name] = state

    def to_simulator_ids(
        self, body_ids: npt.NDArray[np.int32], simulator_ids: Mapping[str, int]
    ) -> npt.NDArray[np.int32]:
        """Translates a segmentation image from this client's body ids to the simulator's.

        Args:
            body_ids: Body ids in this client, -1 for background; any shape.
            simulator_ids: Body ids in the simulator, indexed by name.

        Returns:
            Body ids in the simulator, same shape; -1 for background and for bodies that the simulator lacks.
        """
        own = {body.body_id: simulator_ids.get(name, -1) for name, body in self._bodies.items()}
        table = np.full(max(own, default=-1) + 2, -1, np.int32)
        for body_id, simulator_id in own.items():
            table[body_id] = simulator_id
        table[-1] = -1  # an id of -1 reads the last entry
        translated: npt.NDArray[np.int32] = table[body_ids]
        return translated


def _without_alpha(rgba: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    rgb = np.empty((*rgba.shape[:2], 3), np.uint8)
    for channel in range(3):  # four times as fast as copying pixel by pixel
        rgb[..., channel] = rgba[..., channel]
    return rgb
