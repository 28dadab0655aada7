"""Inverse kinematics: several solvers with the same interface."""
