"""Joint states of a robot."""

import math

from custom_ros_tools.errors import PhysicsError
from rpbi.samples import JointStateSample

from .sensor import SensedRobot, Sensor


class JointStateSensor(Sensor):
    """Measures positions, velocities and motor efforts of all joints of a robot."""

    sample_type = JointStateSample
    keeps_state = False
    ros_topic = "rpbi.ros.publishers.sample_topics:JOINT_STATES"

    def __init__(self, robot: SensedRobot, hz: float) -> None:
        super().__init__(robot.name, hz)
        self._robot = robot
        self._names = tuple(joint.name for joint in robot.joints)

    def read(self, tick: int) -> JointStateSample:
        """Reads all joints, including fixed joints, in the order of PyBullet's joint indices."""
        states = self._robot.pb.getJointStates(self._robot.body_id, self._robot.link_indices)
        position, velocity, _, effort = zip(*states) if states else ((), (), (), ())
        if not math.isfinite(sum(position) + sum(velocity)):
            raise PhysicsError(f"{self.name}: joint state is not finite any more at tick {tick}: {position}")
        return JointStateSample(self.name, self._names, position, velocity, self._robot.efforts(effort))
