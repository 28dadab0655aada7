"""Calibration of force-torque sensors: their zero, and the weight of their payload."""
