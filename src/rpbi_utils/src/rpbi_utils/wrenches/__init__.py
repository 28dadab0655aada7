"""Calibration of force-torque sensors: their zero, and the weight of what they carry."""
