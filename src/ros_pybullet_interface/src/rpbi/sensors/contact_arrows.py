"""Contact forces as arrows, for RViz."""

from rpbi.bodies.body import Body
from rpbi.config.sensors import ContactsConfig
from rpbi.geometry import plus, scaled
from rpbi.samples import ContactArrowsSample

from .contacts import ContactsSensor
from .sensor import Sensor


class ContactArrowsSensor(Sensor):
    """An arrow for each force on a body."""

    sample_type = ContactArrowsSample

    def __init__(self, contacts: ContactsSensor, hz: float, metres_per_newton: float) -> None:
        super().__init__(contacts.name, hz)
        self._contacts = contacts
        self._metres_per_newton = metres_per_newton

    def read(self, tick: int) -> ContactArrowsSample:
        """Reads the contacts and scales their forces; where there is none there is no arrow."""
        arrows = (
            (point.position, plus(point.position, scaled(self._metres_per_newton, point.force)))
            for point in self._contacts.read(tick).points
        )
        return ContactArrowsSample(self.name, tuple((start, end) for start, end in arrows if start != end))


def contact_sensors(body: Body, config: ContactsConfig | None) -> tuple[Sensor, ...]:
    """Returns the sensors of a body's contacts; none if they are not asked for."""
    if config is None:
        return ()
    contacts = ContactsSensor(body, config.hz)
    if not config.arrows_hz:
        return (contacts,)
    return (contacts, ContactArrowsSensor(contacts, config.arrows_hz, config.arrow_metres_per_newton))
