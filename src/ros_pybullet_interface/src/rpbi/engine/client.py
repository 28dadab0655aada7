"""One connection to PyBullet."""

from functools import partial
from typing import Any

import pybullet

from custom_ros_tools.errors import PhysicsError
from rpbi.geometry import Vector


class Client:
    """PyBullet's functions and constants as attributes, bound to one connection.

    The binding is made once per function: at a thousand ticks a second, making it at every call would show.

    Args:
        mode: PyBullet's connection mode, such as `pybullet.DIRECT`.
        options: Further arguments of `pybullet.connect`, for other modes than DIRECT, which takes none.

    Raises:
        PhysicsError: If PyBullet does not connect.
    """

    def __init__(self, mode: int = pybullet.DIRECT, **options: Any) -> None:
        try:
            self.client_id: int = pybullet.connect(mode, **(options if mode != pybullet.DIRECT else {}))
        except pybullet.error as error:
            raise PhysicsError(f"PyBullet did not connect: {error}") from error
        self.has_window = mode != pybullet.DIRECT
        self.is_deformable = False
        """Whether soft bodies can be in its world, as told when that was set up."""
        self.gravity: Vector = (0.0, 0.0, 0.0)
        """Gravity of its world [m/s^2], as told when that was set."""
        self.sub_steps = 0
        """Parts that each step of its world is divided into, as told when that was set; 0 is one."""
        if self.client_id < 0:
            raise PhysicsError("PyBullet did not connect (GUI mode needs a screen: is DISPLAY set?)")

    def __getattr__(self, name: str) -> Any:
        value = getattr(pybullet, name)
        if callable(value):
            value = partial(value, physicsClientId=self.client_id)
        setattr(self, name, value)
        return value
