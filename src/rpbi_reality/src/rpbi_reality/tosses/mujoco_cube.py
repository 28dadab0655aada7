"""The tossed cube in MuJoCo, as an oracle in the same process; needs the extra `mujoco`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from custom_ros_tools.errors import MissingDependency

from .toss_data import Start

try:
    import mujoco
except ModuleNotFoundError:
    raise MissingDependency("mujoco", "./rpbi setup mujoco") from None


class MujocoSettings(NamedTuple):
    """Settings of the cube in MuJoCo.

    Attributes:
        side: Side of the cube [m].
        gravity: Gravity [m/s^2].
        friction: Friction coefficient.
        time_constant: Time constant of contacts [s], the first number of `solref`.
        damping_ratio: Damping ratio of contacts, the second number of `solref`.
        mass: Mass [kg].
        inertia: Moment of inertia about each axis [kg m^2].
        centre: Centre of mass [m] in the cube's frame.
        impedance: Impedance of contacts without penetration, the first number of `solimp`.
        width: Penetration [m] at which the impedance reaches 0.95, the third number of `solimp`.
        table_height: Height of the table [m].
    """

    side: float = 0.1048
    gravity: float = 9.81
    friction: float = 0.18
    time_constant: float = 0.004
    damping_ratio: float = 1.0
    mass: float = 0.37
    inertia: tuple[float, float, float] = (0.00081, 0.00081, 0.00081)
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
    impedance: float = 0.9
    width: float = 0.001
    table_height: float = 0.0


PUBLISHED = MujocoSettings()
MEASURED = MujocoSettings(
    side=0.10248, gravity=9.605, time_constant=0.01, inertia=(0.000775, 0.000775, 0.000775), centre=(0.0, 0.0, 0.0057)
)
IDENTIFIED = MujocoSettings(
    side=0.10248,
    gravity=9.605,
    friction=0.17899,
    time_constant=0.006519,
    damping_ratio=0.6308,
    impedance=0.9047,
    table_height=0.000778,
    inertia=(0.00125, 0.00125, 0.00125),
    centre=(0.0, 0.0, 0.005777),
)
"""Found by the search of configs/tosses/fit_mujoco.yaml."""
SETTINGS = {
    "MuJoCo, the same search": IDENTIFIED,
    "MuJoCo, published facts": PUBLISHED,
    "MuJoCo, measured lengths, gravity and centre of mass": MEASURED,
}
"""Settings of each row of the table."""


class MujocoCube:
    """Simulates tosses in MuJoCo with elliptic friction cones.

    Args:
        settings: Settings of the cube.
        frame_rate: Rate [Hz] of the frames.
        ticks: Number of MuJoCo's steps per frame.
    """

    def __init__(self, settings: MujocoSettings, frame_rate: float, ticks: int = 7) -> None:
        half, contact = settings.side / 2.0, f'friction="{settings.friction} 0 0" condim="3"'
        contact += f' solref="{settings.time_constant} {settings.damping_ratio}"'
        contact += f' solimp="{settings.impedance} 0.95 {settings.width} 0.5 2"'
        self._ticks = ticks
        self._model = mujoco.MjModel.from_xml_string(
            f"""<mujoco>
            <option timestep="{1.0 / frame_rate / ticks}" gravity="0 0 {-settings.gravity}"
              cone="elliptic" impratio="10"/>
            <worldbody>
              <geom type="plane" pos="0 0 {settings.table_height}" size="5 5 0.1" {contact}/>
              <body>
                <freejoint/>
                <inertial pos="{_words(settings.centre)}" mass="{settings.mass}"
                  diaginertia="{_words(settings.inertia)}"/>
                <geom type="box" size="{half} {half} {half}" {contact}/>
              </body>
            </worldbody>
            </mujoco>"""
        )
        self._state = mujoco.MjData(self._model)

    def __call__(self, start: Start, frames: int) -> tuple[np.ndarray, np.ndarray]:
        """Simulates a toss, see `toss_world.Simulate`."""
        mujoco.mj_resetData(self._model, self._state)
        self._state.qpos[:] = [*start.position, start.quaternion[3], *start.quaternion[:3]]
        self._state.qvel[:] = [*start.linear_velocity, *start.angular_velocity]
        rows = np.empty((frames, 7))
        for frame in range(frames):
            rows[frame] = self._state.qpos
            mujoco.mj_step(self._model, self._state, self._ticks)
        return rows[:, :3], rows[:, [4, 5, 6, 3]]


def _words(numbers: tuple[float, ...]) -> str:
    return " ".join(map(str, numbers))
