"""The node `dmp_server` and its client, with the services of the original package `dmp`."""

from collections.abc import Sequence

import numpy as np
import rospy
from dmp.msg import DMPData, DMPPoint, DMPTraj
from dmp.srv import (
    GetDMPPlan,
    GetDMPPlanRequest,
    GetDMPPlanResponse,
    LearnDMPFromDemo,
    LearnDMPFromDemoRequest,
    LearnDMPFromDemoResponse,
    SetActiveDMP,
    SetActiveDMPRequest,
    SetActiveDMPResponse,
)
from numpy.typing import ArrayLike

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.services import get_srv_handler
from custom_ros_tools.transforms import Array
from motion_primitives.errors import DemonstrationError
from motion_primitives.release_dmp import ReleaseDMP, learn, plan

Gains = float | Sequence[float]
"""One gain for each dimension, or one gain for all dimensions."""


class DMPServer:
    """Learns one primitive for each dimension, and plans motions with the active primitives.

    If a request is invalid, the active primitives do not change, and the service call fails with a message that names
    the field. `set_active_dmp` does not fail: it logs the message and responds with `success=False`.
    """

    def __init__(self) -> None:
        self._active: list[ReleaseDMP] = []
        rospy.Service("learn_dmp_from_demo", LearnDMPFromDemo, self._learn)
        rospy.Service("set_active_dmp", SetActiveDMP, self._set_active)
        rospy.Service("get_dmp_plan", GetDMPPlan, self._plan)

    def _learn(self, request: LearnDMPFromDemoRequest) -> LearnDMPFromDemoResponse:
        demo = request.demo
        try:
            sizes = {len(point.positions) for point in demo.points}
            if len(sizes) > 1:
                raise DemonstrationError("positions", "as many in each point", f"{sorted(sizes)}")
            positions = [point.positions for point in demo.points]
            found, tau = learn(demo.times, positions, request.k_gains, request.d_gains, request.num_bases)
        except InterfaceError as error:
            raise rospy.ServiceException(str(error)) from None
        messages = [DMPData(one.k_gain, one.d_gain, one.weights, one.f_domain, one.f_targets) for one in found]
        return LearnDMPFromDemoResponse(messages, tau)

    def _set_active(self, request: SetActiveDMPRequest) -> SetActiveDMPResponse:
        try:
            self._active = [
                ReleaseDMP(one.k_gain, one.d_gain, tuple(one.weights), tuple(one.f_domain), tuple(one.f_targets))
                for one in request.dmp_list
            ]
        except InterfaceError as error:
            rospy.logwarn("set_active_dmp: %s; the primitives before stay active", error)
            return SetActiveDMPResponse(False)
        return SetActiveDMPResponse(True)

    def _plan(self, request: GetDMPPlanRequest) -> GetDMPPlanResponse:
        try:
            found = plan(
                self._active,
                request.x_0,
                request.x_dot_0,
                request.t_0,
                request.goal,
                request.goal_thresh,
                request.seg_length,
                request.tau,
                request.dt,
                request.integrate_iter,
            )
        except InterfaceError as error:
            raise rospy.ServiceException(str(error)) from None
        points = [DMPPoint(*each) for each in zip(found.positions.tolist(), found.velocities.tolist())]
        return GetDMPPlanResponse(DMPTraj(points, found.times.tolist()), int(found.is_at_goal))


def main() -> None:
    """Runs the node."""
    run_node("dmp_server", DMPServer)


class DMPProcessor:
    """Client of the node `dmp_server`. The constructor waits until the services are available."""

    def __init__(self) -> None:
        self._learn = get_srv_handler("learn_dmp_from_demo", LearnDMPFromDemo)
        self._set_active = get_srv_handler("set_active_dmp", SetActiveDMP)
        self._plan = get_srv_handler("get_dmp_plan", GetDMPPlan)

    def learn_dmp(
        self, t: ArrayLike, traj: ArrayLike, k: Gains, d: Gains, num_bases: int
    ) -> LearnDMPFromDemoResponse | None:
        """Learns a primitive for each dimension with the service `learn_dmp_from_demo`.

        Args:
            t: N times [s].
            traj: Positions, shape (dims, N).
            k: Stiffness, see `ReleaseDMP`.
            d: Damping, see `ReleaseDMP`.
            num_bases: Number of Gaussians to fit, see `release_dmp.learn`.

        Returns:
            The response of the service; None if the service refused the request, which is logged.
        """
        samples = np.asarray(traj, dtype=float).T
        points = [DMPPoint(positions=row) for row in samples.tolist()]
        demo, count = DMPTraj(points, np.asarray(t, dtype=float).tolist()), samples.shape[-1]
        try:
            return self._learn(demo, _gains(k, count), _gains(d, count), num_bases)
        except rospy.ServiceException as error:
            rospy.logerr("learn_dmp_from_demo: %s", error)
            return None

    def generate_plan(
        self,
        dmp: LearnDMPFromDemoResponse,
        pos0: ArrayLike,
        vel0: ArrayLike,
        t0: float,
        goal: ArrayLike,
        goal_thresh: ArrayLike,
        seg_length: float,
        tau: float,
        dt: float,
        integrate_iter: int,
    ) -> tuple[bool, Array | None, Array | None, Array | None]:
        """Makes learned primitives active, and plans a motion with these primitives.

        For the other arguments, see `release_dmp.plan`.

        Args:
            dmp: Response of `learn_dmp`.

        Returns:
            Whether the plan ends at the goal, N times [s], positions of shape (dims, N), and velocities of shape
            (dims, N). If a service refused the request, False, None, None and None.
        """
        lists = (np.asarray(each, dtype=float).tolist() for each in (pos0, vel0, goal, goal_thresh))
        x_0, x_dot_0, end, near = lists
        try:
            if not self._set_active(dmp.dmp_list).success:
                rospy.logerr("set_active_dmp: refused; the log of dmp_server has the reason")
                return False, None, None, None
            answer = self._plan(x_0, x_dot_0, t0, end, near, seg_length, tau, dt, integrate_iter)
        except rospy.ServiceException as error:
            rospy.logerr("get_dmp_plan: %s", error)
            return False, None, None, None
        positions = np.array([point.positions for point in answer.plan.points]).T
        velocities = np.array([point.velocities for point in answer.plan.points]).T
        return bool(answer.at_goal), np.array(answer.plan.times), positions, velocities


def _gains(gains: Gains, count: int) -> list[float]:
    array = np.asarray(gains, dtype=float)
    return np.full(count, array).tolist() if array.ndim == 0 else array.tolist()
