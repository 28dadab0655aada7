"""The service `rpbi/predict`, which predicts motion in other processes while the world continues."""

from __future__ import annotations

import os
import threading
from typing import Any

import genpy
from geometry_msgs.msg import Point, Quaternion
from geometry_msgs.msg import Pose as PoseMessage

from custom_ros_tools.errors import InterfaceError, UnknownNameError
from custom_ros_tools.plugins import check_trusted
from ros_pybullet_interface.msg import PlannedInput as PlannedInputMessage
from ros_pybullet_interface.msg import PredictedBody
from ros_pybullet_interface.msg import Prediction as PredictionMessage
from ros_pybullet_interface.srv import PredictRequest
from rpbi.bodies.robots.jointed import JointedBody
from rpbi.ros.endpoints import Answer
from rpbi.ros.headers import to_ros_time
from rpbi.ros.requests import Requests
from rpbi.ros.simulation import Simulation
from rpbi.world.forks.prediction import Candidate, PlannedInput, Prediction, PredictionJob
from rpbi.world.forks.shadow import Shadow
from rpbi.world.saved.command_log import RecordedCommand

MAX_TICKS = 1_000_000
"""Default of the largest number of ticks in a request, summed over all candidates."""
MAX_ROWS = 100_000
"""Largest number of rows of motion in an answer, summed over all bodies and candidates."""
EVERY = 10
"""Ticks between two rows of motion by default."""
POSE_NAMES = ("x", "y", "z", "qx", "qy", "qz", "qw")
"""Names of the values of a pose input (a pose in the world)."""
NICENESS = 5
"""Niceness of the predicting processes, so that they do not slow down the running world."""


class Predictor:
    """Predicts motion from the present state of a running world.

    A second process, the shadow, repeats the simulation of the world up to the present tick and predicts from there.
    The first prediction simulates all ticks since the world was built or reset, or since its last keyframe. Later
    predictions simulate only the ticks since the previous prediction. A request contains one or more candidates, which
    are alternative sequences of inputs; each candidate is simulated separately.

    Args:
        simulation: The loop that runs the world.
        ask: Makes the simulation thread call a function.
        max_ticks: Maximum number of ticks in a request, summed over all candidates of the request.
    """

    def __init__(self, simulation: Simulation, ask: Requests, max_ticks: int = MAX_TICKS) -> None:
        self._simulation, self._ask = simulation, ask
        self.max_ticks = max_ticks
        """Largest number of ticks of all candidates of a request."""
        self._lock = threading.Lock()
        self._shadow: Shadow | None = None
        self._resets = 0
        self._cancels = 0
        """Number of calls of `cancel`."""

    def predict(self, candidates: list[Candidate], job: PredictionJob) -> tuple[int, int, list[Prediction]]:
        """Predicts the motion for each candidate, and waits for the results.

        Args:
            candidates: Alternative sequences of inputs, each of which is simulated from the present state.
            job: Length of the predictions and the values to return.

        Returns:
            Tick and stamp [ns] at which all predictions start, and a prediction for each candidate.

        Raises:
            InterfaceError: If the prediction is cancelled, the world cannot be saved, or the shadow does not reach the
                same state as the world.
        """
        cancels = self._cancels
        with self._lock:
            try:
                shadow, tick, stamp_ns = self._follow(cancels)
                return tick, stamp_ns, shadow.predict(candidates, job, os.cpu_count() or 1)
            except InterfaceError:
                self._end()
                self._refuse_cancelled(cancels)
                raise

    def cancel(self) -> bool:
        """Ends the running prediction and all waiting predictions; any thread may call this method.

        The next prediction starts a new process, and takes as long as the first prediction.

        Returns:
            False if no prediction is running.
        """
        if not self._lock.locked():
            return False
        self._cancels += 1
        if (shadow := self._shadow) is not None:
            shadow.kill()
        return True

    def _refuse_cancelled(self, cancels: int) -> None:
        if self._cancels != cancels:
            raise InterfaceError("the prediction was cancelled")

    def _follow(self, cancels: int) -> tuple[Shadow, int, int]:
        """Makes the shadow simulate up to the world's present state.

        Args:
            cancels: Number of calls of `cancel` before the prediction was requested. If `cancel` has been called since,
                the prediction ends.

        Returns:
            The shadow, and the tick and stamp [ns] that it has reached.
        """
        world = self._simulation.world
        if self._shadow is None or self._resets != world.resets:
            self._end()
            state, commands, self._resets = self._ask(lambda: (world.save(), world.commands.count, world.resets))
            self._shadow = Shadow.started(state, commands, NICENESS)
        self._refuse_cancelled(cancels)
        shadow = self._shadow

        def news() -> tuple[bool, list[RecordedCommand], int, str, int]:
            world.apply_inputs()  # received inputs act before the next step
            follows = world.resets == self._resets and world.commands.first <= shadow.commands
            new = list(world.commands.records(shadow.commands)) if follows else []
            return follows, new, world.clock.tick, world.state_hash(), world.clock.stamp_ns

        follows, new, tick, state_hash, stamp_ns = self._ask(news)
        if not follows:  # the world was reset, or has made a keyframe
            self._restore(shadow)
            return self._follow(cancels)
        shadow.follow(new, tick, state_hash)
        return shadow, tick, stamp_ns

    def _restore(self, shadow: Shadow) -> None:
        """Restores the world's last keyframe in the shadow; if the world was reset, ends the shadow instead."""
        world = self._simulation.world
        state, commands, resets = self._ask(lambda: (world.save(), world.commands.count, world.resets))
        if resets == self._resets:
            shadow.restore(state, commands)
        else:
            self._end()

    def _end(self) -> None:
        if self._shadow is not None:
            self._shadow.close()
            self._shadow = None


def predict(node: Any, request: PredictRequest) -> tuple[bool, str, int, genpy.Time, list[PredictionMessage]]:
    """Predicts the motion from the present state for several candidates (sequences of inputs); the world continues."""
    job = _job(node, request)
    candidates = [[planned_input(each) for each in candidate.inputs] for candidate in request.candidates]
    tick, stamp_ns, predictions = node.predictor.predict(candidates, job)
    joints = {name: _joint_names(node.simulation.world.bodies.get(name)) for name in job.watch}
    messages = [_message(each, joints) for each in predictions]
    good = sum(not each.fault for each in predictions)
    return True, f"{good} of {len(messages)} predicted from tick {tick} on", tick, to_ros_time(stamp_ns), messages


def cancel_prediction(node: Any, _: Any) -> Answer:
    """Ends the running and waiting predictions; `success` is false if no prediction is running."""
    has_cancelled = node.predictor.cancel()
    return Answer(has_cancelled, "cancelled" if has_cancelled else "no prediction is under way")


def _job(node: Any, request: PredictRequest) -> PredictionJob:
    count, every = len(request.candidates), request.every or EVERY
    if not request.ticks or not count:
        raise InterfaceError(f"ticks and candidates: expected at least 1 of each, got {request.ticks} and {count}")
    most = node.predictor.max_ticks
    if request.ticks * count > most:
        asked = f"{request.ticks * count}, those of {count} candidates"
        raise InterfaceError(f"ticks: expected at most {most} of all candidates, got {asked} (~max_predicted_ticks)")
    rows = request.ticks // every * count * len(request.watch)
    if rows > MAX_ROWS:
        raise InterfaceError(f"every: expected at most {MAX_ROWS} rows of motion, got {rows}; name a larger number")
    if request.cost:
        check_trusted(request.cost)
    bodies = node.simulation.world.bodies
    for name in request.watch:
        if name not in bodies:
            raise UnknownNameError("object", name, list(bodies))
    return PredictionJob(request.ticks, tuple(request.watch), every, request.cost or None)


def planned_input(message: PlannedInputMessage) -> PlannedInput:
    """Converts a message to a planned input of a world.

    Raises:
        InterfaceError: If the numbers of names and values differ.
    """
    names, values = message.names, tuple(message.values)
    if names and len(names) != len(values):
        raise InterfaceError(f"{message.input}: expected a value for each of {len(names)} names, got {len(values)}")
    if tuple(names) == POSE_NAMES:
        x, y, z, *quat = values
        return PlannedInput(message.tick, message.input, {"position": (x, y, z), "quat_xyzw": tuple(quat)})
    return PlannedInput(message.tick, message.input, dict(zip(names, values, strict=True)) if names else values)


def _joint_names(body: Any) -> list[str]:
    return [joint.name for joint in body.model.moving] if isinstance(body, JointedBody) else []


def _message(prediction: Prediction, joints: dict[str, list[str]]) -> PredictionMessage:
    bodies = [
        PredictedBody(
            name=name,
            poses=[PoseMessage(Point(*row[:3]), Quaternion(*row[3:])) for row in poses.tolist()],
            joint_names=joints.get(name, []),
            joints=prediction.joints[name].ravel().tolist() if name in prediction.joints else [],
            contacts=prediction.contacts[name].tolist(),
        )
        for name, poses in prediction.poses.items()
    ]
    return PredictionMessage(
        cost=prediction.cost,
        fault=prediction.fault,
        state_hash=prediction.state_hash,
        ticks=prediction.ticks.tolist(),
        bodies=bodies,
    )
