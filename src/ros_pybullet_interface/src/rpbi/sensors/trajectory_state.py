"""State of a robot's trajectory follower."""

from rpbi.control.joint_drive import JointDrive
from rpbi.control.trajectories.follower import TrajectoryFollower
from rpbi.control.trajectories.trajectory import TrajectoryStateSample

from .sensor import Sensor


class TrajectoryStateSensor(Sensor):
    """Reports desired and measured states of the joints that a robot's trajectory follower drives."""

    sample_type = TrajectoryStateSample
    ros_topic = "rpbi.ros.publishers.sample_topics:TRAJECTORY_STATE"

    def __init__(self, drive: JointDrive, follower: TrajectoryFollower) -> None:
        super().__init__(drive.name, follower.config.state_publish_rate)
        self._dt_s = drive.dt_s
        self._follower = follower

    def read(self, tick: int) -> TrajectoryStateSample:
        """Reads the desired and measured states of the follower's joints."""
        return self._follower.state(tick * self._dt_s)
