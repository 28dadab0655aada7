"""Robot models read from URDFs: geometry, joints, limits, frames and Jacobians, without ROS or a simulator."""
