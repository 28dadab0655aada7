"""Services that change at once how a robot is controlled and where its joints are."""

from __future__ import annotations

from std_srvs.srv import TriggerRequest, TriggerResponse

from custom_ros_tools.srv import SetStringRequest, SetStringResponse
from ros_pybullet_interface.srv import SetJointStateRequest, SetJointStateResponse
from rpbi.config.pybullet_args import CONTROL_MODES
from rpbi.control.motors import MODE_NAMES
from rpbi.ros.services.body_context import BodyContext
from rpbi.urdf.joints import JointTarget


def set_control_mode(context: BodyContext, request: SetStringRequest) -> SetStringResponse:
    """Switches between POSITION_CONTROL, VELOCITY_CONTROL and TORQUE_CONTROL.

    Raises:
        ValueError: If the text is none of these.
    """
    mode = CONTROL_MODES.parse(request.data)
    before = MODE_NAMES[context.body.motors.mode]
    context.act("switch_mode", mode)
    return SetStringResponse(success=True, message=f"{MODE_NAMES[mode]}, was {before}")


def stop_motion(context: BodyContext, _: TriggerRequest) -> TriggerResponse:
    """Ends the motion that runs; its joints hold where they are."""
    was_moving = context.act("stop_motion", "it was stopped")
    return TriggerResponse(success=was_moving, message="stopped" if was_moving else "no motion is running")


def set_joint_state(context: BodyContext, request: SetJointStateRequest) -> SetJointStateResponse:
    """Puts joints somewhere at once.

    Raises:
        UnknownNameError: If the robot lacks one of the joints.
        ValueError: If a number is missing, not finite or outside the joint's limits.
    """
    state = request.joint_state
    if not state.name:
        raise ValueError("expected one joint or more, got none")
    target = JointTarget(state.name, state.position, state.velocity)
    context.act("set_joint_state", target)
    return SetJointStateResponse(success=True, message=f"{', '.join(state.name)} put there")
