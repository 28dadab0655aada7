"""Shapes as the renderer draws them."""
