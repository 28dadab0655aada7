"""Inverse kinematics with exchangeable solvers behind one interface."""
