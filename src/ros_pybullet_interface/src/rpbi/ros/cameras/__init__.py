"""Cameras in ROS: scenes to the renderer process, images from it."""
