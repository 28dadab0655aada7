"""`dmp_server`: movement primitives by the release's services."""

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

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.lifecycle.run_node import run_node
from motion_primitives.errors import DemonstrationError
from motion_primitives.release_dmp import ReleaseDMP, learn, plan


class DMPServer:
    """Learns primitives of one dimension each, and plans with the active ones.

    An invalid request fails with an error that names the field; the active primitives stay.
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
