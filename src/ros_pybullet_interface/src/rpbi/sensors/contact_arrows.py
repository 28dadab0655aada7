"""Contact forces as arrows, for RViz."""

from __future__ import annotations

from ..samples import ContactArrowsSample
from ..vectors import plus, scaled
from .contacts import ContactsSensor
from .sensor import Sensor


class ContactArrowsSensor(Sensor):
    """An arrow for each force on a body.

    Args:
        contacts: The sensor of the body's contacts.
        hz: Rate [Hz].
        metres_per_newton: Length of an arrow by the force.
    """

    sample_type = ContactArrowsSample

    def __init__(self, contacts: ContactsSensor, hz: float, metres_per_newton: float) -> None:
        super().__init__(contacts.name, hz)
        self._contacts = contacts
        self._metres_per_newton = metres_per_newton

    def read(self, tick: int) -> ContactArrowsSample:
        """Reads the contacts and scales their forces; where there is none there is no arrow."""
        arrows = (
            (point.position, plus(point.position, scaled(self._metres_per_newton, point.force)))
            for point in self._contacts.points(tick)
        )
        return ContactArrowsSample(self.name, tuple((start, end) for start, end in arrows if start != end))
