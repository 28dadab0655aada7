"""Momentum, mass and contact forces of all links below a joint."""

from typing import Any, NamedTuple

from robot_model.geometry import Quaternion, Vector, cross, minus, plus, scaled
from rpbi.engine.client import Client
from rpbi.geometry import rotated, rotated_back

LinkStates = tuple[Any, ...]
"""Result of PyBullet's `getLinkStates` with velocities, for the links of a subtree."""


class Momentum(NamedTuple):
    """Momentum of a subtree, in world axes.

    Attributes:
        origin: Position [m] of the origin of the first link's URDF frame, in the world frame.
        quat_xyzw: Orientation of the first link's URDF frame in the world frame.
        origin_velocity: Velocity of `origin` [m/s].
        linear: Linear momentum [kg m/s].
        angular: Angular momentum about `origin` [kg m^2/s].
        mass_moment: Mass times the vector from `origin` to the centre of mass [kg m].
    """

    origin: Vector
    quat_xyzw: Quaternion
    origin_velocity: Vector
    linear: Vector
    angular: Vector
    mass_moment: Vector


class Subtree:
    """A link of an articulated body, and all links below this link in the kinematic tree.

    Args:
        pb: Client of the body.
        body_id: PyBullet's id of the body.
        first_link: PyBullet's index of the first link, which is also the index of the joint above it.

    Attributes:
        links: PyBullet's indices of the subtree's links.
        mass_kg: Mass of the subtree [kg].
    """

    def __init__(self, pb: Client, body_id: int, first_link: int) -> None:
        self._pb, self._body_id = pb, body_id
        links = [first_link]
        for index in range(first_link + 1, pb.getNumJoints(body_id)):  # parents come before their children
            if pb.getJointInfo(body_id, index)[16] in links:
                links.append(index)
        self.links = tuple(links)
        self.update_dynamics()

    def update_dynamics(self) -> None:
        """Reads the present masses and inertias of the links from PyBullet."""
        infos = [self._pb.getDynamicsInfo(self._body_id, link) for link in self.links]
        self._inertias = tuple((float(info[0]), info[2]) for info in infos)
        self.mass_kg = sum(mass for mass, _ in self._inertias)

    def states(self) -> LinkStates:
        """Reads the present poses and velocities of the links from PyBullet."""
        states: LinkStates = self._pb.getLinkStates(
            self._body_id, self.links, computeLinkVelocity=1, computeForwardKinematics=1
        )
        return states

    def momentum(self, states: LinkStates) -> Momentum:
        """Returns the momentum of the subtree, computed from the links' poses and velocities in `states`."""
        origin, quat = states[0][4], states[0][5]
        linear = angular = mass_moment = (0.0, 0.0, 0.0)
        for (mass, inertia), (centre, inertial_quat, _, _, _, _, velocity, turning) in zip(self._inertias, states):
            x, y, z = rotated_back(inertial_quat, turning)
            spin = rotated(inertial_quat, (inertia[0] * x, inertia[1] * y, inertia[2] * z))
            moment = scaled(mass, minus(centre, origin))
            linear = plus(linear, scaled(mass, velocity))
            angular = plus(angular, plus(cross(moment, velocity), spin))
            mass_moment = plus(mass_moment, moment)
        velocity, turning = states[0][6], states[0][7]
        origin_velocity = plus(velocity, cross(turning, minus(origin, states[0][0])))
        return Momentum(origin, quat, origin_velocity, linear, angular, mass_moment)

    def contact_wrench(self, origin: Vector) -> tuple[Vector, Vector]:
        """Returns the total force [N] and moment [N m] that contacts exert on the subtree, in world axes.

        Sums the normal and sliding friction forces of the last step's contacts with other bodies, and with links of the
        same body outside the subtree. PyBullet does not report rolling and spinning friction, nor contacts with soft
        bodies.

        Args:
            origin: Reference point of the moment, in the world frame [m].
        """
        force = moment = (0.0, 0.0, 0.0)
        body_id, links = self._body_id, self.links
        touching = self._pb.getContactPoints(body_id)
        if not any(touch[3] in links or (touch[2] == body_id and touch[4] in links) for touch in touching):
            return force, moment
        # If asked for the contacts of one body, PyBullet turns normals towards this body, but not friction directions.
        # If asked for the contacts of all bodies, PyBullet turns neither.
        for touch in self._pb.getContactPoints():
            first = touch[1] == body_id and touch[3] in links
            second = touch[2] == body_id and touch[4] in links
            if first == second:
                continue
            pushed = plus(scaled(touch[9], touch[7]), plus(scaled(touch[10], touch[11]), scaled(touch[12], touch[13])))
            pushed = pushed if first else scaled(-1.0, pushed)
            force = plus(force, pushed)
            moment = plus(moment, cross(minus(touch[5] if first else touch[6], origin), pushed))
        return force, moment
