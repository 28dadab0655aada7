"""Planar pushing: a point or round pusher moves a slider along a path on a table."""
