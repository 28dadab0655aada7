"""Draws camera images in a process of its own, since PyBullet would block the simulator while it renders.

The module `client` runs in the simulator. The other modules run in the renderer process (`python -m rpbi.render`). That
process rebuilds the world from the load log (`mirror`), draws it (`renderers`) and passes the frames to a sink
(`frame`).
"""
