"""Nodes of model predictive controllers."""
