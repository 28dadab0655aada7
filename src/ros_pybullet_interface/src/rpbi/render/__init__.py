"""Draws camera images in a separate process, since PyBullet would block the simulator during rendering.

The module `client` runs in the simulator. The other modules run in the renderer process (`python -m rpbi.render`). That
process rebuilds the world from the load log (`mirror`), draws images of the world (`renderers`) and passes the images
to a sink (`frame`).
"""
