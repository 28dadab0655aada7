"""Camera images, made in a process of their own: PyBullet would block the simulator while it renders.

`client` is the simulator's side. Everything else runs in the renderer process (`python -m rpbi.render`): it rebuilds
the world from the load log (`mirror`), draws it (`renderers`) and passes the frames to a sink (`frame`).
"""
