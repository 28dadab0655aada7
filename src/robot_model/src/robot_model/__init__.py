"""Robots as their URDFs describe them: geometry, joints, limits, frames and Jacobians, without ROS or a simulator."""
