"""Hostile data sets: LeRobot, robomimic and rosbag2, by structure and by bytes."""
