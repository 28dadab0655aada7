"""A simulated person hands a thing to a Panda and takes the thing back. Person and robot react to each other."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

import numpy as np

from custom_ros_tools.transforms import yaw_of
from robot_model.geometry import Pose, Vector

from .parts.arm import about_z, tilt_deg
from .parts.holding import BEFORE, Holders, PandaArm, RestDetector, above, until, upright_grasp, yaw_to
from .parts.person import SwayingPerson, together
from .scene import Scene, SceneFailedError, Watched

HALF_HEIGHTS_M = {"bottle": 0.063, "can": 0.06, "carton": 0.065}
"""Height of each thing's origin above the thing's base [m]."""
DYNAMICS = (0.25, 0.5), (0.45, 0.9)
"""Lower bounds of mass [kg] and friction of a thing, and the upper bounds."""
REST, PLACES_M = Pose((0.31, -0.24, 1.08)), ((0.37, -0.34, 1.05), (0.45, -0.16, 1.18))
"""Pose of the palm near the body, and two corners of the region in which the palm is held out [m]."""
OFF_M, OFF_RAD, PAUSES_S = 0.008, 0.1, (0.2, 1.5)
"""Largest random offset of the thing on the palm [m]; largest random angle of the thing and of the palm [rad]; range of
the person's pauses [s].
"""
BASE = Pose((1.18, -0.2, 0.6), (0.0, 0.0, 1.0, 0.0))
GRASP_M, LIFT_M, OPEN_M = 0.09, 0.1, 0.04
"""Height of the grasp above the thing's base, height of the lift above the palm, opening of each finger [m]."""
SHOWN_M, ALONE_S = (0.66, -0.2, 1.24), 1.0
"""Position at which the robot shows the thing [m], and least time for which only the robot holds the thing [s]."""
LOWEST_M, CARRIED_N = -0.05, 2.0
"""Lowest height above the palm to which the robot lowers the thing [m], and force of the palm at which the robot
releases the thing [N].
"""
WAVES, MAX_TILT_DEG, STILL_M = 3, 10.0, 0.002
"""Number of waves, largest final tilt of the thing [deg], and largest motion of a thing at rest on the palm [m]."""
HANDS = {"human", "panda"}


class Handover(Scene):
    """A simulated person waves and hands a thing to a Panda. The Panda shows the thing and puts it back on the palm."""

    world = "{rpbi_examples}/configs/handover/config.yaml"
    watch = Watched(("human", "panda"), bodies=tuple(HALF_HEIGHTS_M), contacts=("human", *HALF_HEIGHTS_M))
    others = ("human",)
    longest_s = 45.0

    def __init__(self, random: np.random.Generator) -> None:
        super().__init__(random)
        self.thing = str(random.choice(list(HALF_HEIGHTS_M)))
        self._half_m = HALF_HEIGHTS_M[self.thing]
        places = [tuple(place) for place in random.uniform(*PLACES_M, (2, 3)).tolist()]
        self._palms = [Pose(each, about_z(yaw_to(each, BASE) + random.uniform(-OFF_RAD, OFF_RAD))) for each in places]
        self._pauses_s = random.uniform(*PAUSES_S, 2).tolist()
        self._holders, self._on_palm = Holders(self, self.thing), RestDetector()
        self._force_n = self._largest_tilt_deg = 0.0

    @cached_property
    def person(self) -> SwayingPerson:
        """The simulated person. `note` creates the person in the first cycle, so that a seed determines the episode."""
        return SwayingPerson(self, self.random)

    def prepare(self) -> None:
        """Puts a thing with random mass and friction on the palm."""
        x, y, yaw = self.random.uniform(-1.0, 1.0, 3).tolist()
        self.place(self.thing, REST @ Pose((OFF_M * x, OFF_M * y, self._half_m + 1e-4), about_z(OFF_RAD * yaw)))
        mass, friction = self.random.uniform(*DYNAMICS).tolist()
        self.change(self.thing, mass=mass, lateralFriction=friction)

    def act(self) -> Iterator[None]:
        """Makes person and robot act simultaneously. The episode fails if the thing touches a third body."""
        yield from self._holders.watch(together(self._person_acts(), self._robot_acts()), HANDS)

    def beside(self) -> Iterator[None]:
        """Makes the person act. The episode fails if the thing touches a body other than person and robot."""
        yield from self._holders.watch(self._person_acts(), HANDS)

    def _person_acts(self) -> Iterator[None]:
        """Makes the person wave, and hold out the thing until only the robot touches the thing. Then makes the person
        hold out the empty palm until only the person touches the thing.
        """
        person, holders = self.person, self._holders
        yield from together(person.wave(WAVES), person.go(REST, 4.5))
        yield from person.go(self._palms[0], 1.5)
        yield from person.stay_until(lambda: holders.is_alone("panda", 0.5))
        yield from person.go(REST, 1.5 + self._pauses_s[0])
        yield from person.go(self._palms[1], 1.5)
        yield from person.stay_until(lambda: holders.is_alone("human", 0.5))
        yield from person.go(person.target, self._pauses_s[1])
        yield from person.go(REST, 2.0)
        yield from person.go(REST, 1.0)

    def _robot_acts(self) -> Iterator[None]:
        """Makes the robot take the thing from the palm, show the thing, and put it back. The robot releases the thing
        as soon as the palm carries it.
        """
        arm, holders = PandaArm(self, "panda", BASE), self._holders
        home = arm.target
        yield from until(self.person.holds_out)
        yield from arm.follow(lambda: self._grasp() @ BEFORE, 1.8)
        yield from arm.follow(self._grasp, 1.5)
        yield from arm.close_on(holders)
        yield from arm.go(Pose(above(arm.target.position, LIFT_M), arm.target.quat_xyzw), 1.2)
        yield from self.measure()
        thing = self.sensed.poses[self.thing]
        in_gripper, yaw = arm.pose().inverse() @ thing, yaw_of(thing.quat_xyzw) - yaw_to(thing.position, BASE)

        def standing(place: Vector) -> Pose:
            """Returns the gripper's pose at which the held thing is upright, with the thing's base at a place [m]."""
            return Pose(above(place, self._half_m), about_z(yaw_to(place, BASE) + yaw)) @ in_gripper.inverse()

        yield from arm.go(standing(SHOWN_M), 1.8)
        yield from self.wait(ALONE_S)
        yield from until(self.person.holds_out)
        yield from arm.follow(lambda: standing(above(self.sensed.poses["palm"].position, LIFT_M)), 2.0)
        for _ in arm.go(standing(above(self.sensed.poses["palm"].position, LOWEST_M)), 4.5):
            if holders.force("human") > CARRIED_N:
                break
            yield
        else:
            raise SceneFailedError(f"expected the palm to carry {CARRIED_N:g} N, got {holders.force('human'):.1f} N")
        yield from arm.open(OPEN_M)
        yield from arm.go(arm.target @ BEFORE, 1.2)
        yield from arm.go(home, 1.5)

    def _grasp(self) -> Pose:
        """Returns the gripper's pose for a grasp of the thing at the thing's present pose."""
        return upright_grasp(self.sensed.poses[self.thing], GRASP_M - self._half_m)

    def note(self) -> None:
        """Records the person's waves, the thing's holders, the motion of thing and palm, and forces on the person."""
        self.person.note()
        self.landmarks = {"palm": self.person.palm()}
        self._holders.note()
        self._on_palm.note((self.person.palm().inverse() @ self._where()).position)
        self._largest_tilt_deg = max(self._largest_tilt_deg, tilt_deg(self._where()))
        self._force_n = max(self._force_n, sum(touch.normal_force for touch in self.seen.contacts["human"]))

    def has_succeeded(self) -> bool:
        """Returns whether the person waved, the robot alone held the thing for `ALONE_S`, and the thing is back at rest
        on the palm.
        """
        was_handed_over = self._holders.alone_s.get("panda", 0.0) >= ALONE_S and self.person.swings >= 2 * WAVES - 1
        is_back = self._holders.is_alone("human", 0.5) and self._holders.links() == {"RightHand"}
        is_standing = self._on_palm.is_within(STILL_M) and tilt_deg(self._where()) < MAX_TILT_DEG
        return was_handed_over and is_back and is_standing and self._holders.all_names <= HANDS

    def figures(self) -> dict[str, float]:
        """Returns the largest force on the person, the time for which only the robot held the thing, and the final and
        the largest tilt of the thing.
        """
        return {
            "largest force on the person [N]": self._force_n,
            "held by the robot alone [s]": self._holders.alone_s.get("panda", 0.0),
            "tilt [deg]": tilt_deg(self._where()),
            "largest tilt [deg]": self._largest_tilt_deg,
        }

    def _where(self) -> Pose:
        return self.seen.poses[self.thing]
