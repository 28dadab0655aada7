"""Whole-body control of a robot on two feet by a quadratic program at the rate of the tick."""
