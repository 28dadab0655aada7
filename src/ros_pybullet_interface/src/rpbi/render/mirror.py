"""The renderer's own copy of the world."""

from __future__ import annotations

import logging
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from ..bodies import Body
from ..client import Client
from ..load_log import LogEntry, apply
from ..samples import BodyState

log = logging.getLogger(__name__)


class Mirror:
    """A world without physics, built from the load log and posed from scenes.

    Args:
        pb: The client that it fills.
    """

    def __init__(self, pb: Client) -> None:
        self._pb = pb
        self._bodies: dict[str, Body] = {}
        self._shown: dict[str, BodyState] = {}

    def apply(self, entry: LogEntry) -> None:
        """Does what was done to the world; what cannot be done is left out of the images."""
        if entry.what == "world":
            self._bodies.clear()
        self._shown.pop(entry.name, None)
        try:
            apply(self._pb, self._bodies, entry)
        except Exception as error:
            log.warning("images lack '%s': %s", entry.name, error)

    def pose(self, state: BodyState) -> None:
        """Puts a body where it was in the simulator."""
        body = self._bodies.get(state.name)
        shown = self._shown.get(state.name)
        if body is None or shown == state:
            return
        if shown is None or shown.base != state.base:
            self._pb.resetBasePositionAndOrientation(body.body_id, state.base[:3], state.base[3:])
        before = shown.joints if shown else (None,) * len(state.joints)
        for index, (old, new) in enumerate(zip(before, state.joints)):
            if old != new:
                self._pb.resetJointState(body.body_id, index, new)
        self._shown[state.name] = state

    def to_simulator_ids(
        self, body_ids: npt.NDArray[np.int32], simulator_ids: Mapping[str, int]
    ) -> npt.NDArray[np.int32]:
        """Translates a segmentation from this client's body ids to the simulator's.

        Args:
            body_ids: Ids in this client, -1 where nothing is; any shape.
            simulator_ids: Ids in the simulator, by name.

        Returns:
            Ids in the simulator, -1 where nothing is or where the simulator has no such body; same shape.
        """
        own = {body.body_id: simulator_ids.get(name, -1) for name, body in self._bodies.items()}
        table = np.full(max(own, default=-1) + 2, -1, np.int32)
        for body_id, simulator_id in own.items():
            table[body_id] = simulator_id
        table[-1] = -1  # an id of -1 reads the last entry
        translated: npt.NDArray[np.int32] = table[body_ids]
        return translated
