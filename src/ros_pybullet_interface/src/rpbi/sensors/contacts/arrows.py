"""Contact forces as arrows, for RViz."""

from robot_model.geometry import plus, scaled
from rpbi.config.sensors import ContactsConfig
from rpbi.samples import ContactArrowsSample
from rpbi.sensors.sensor import SensedBody, SensedWorld, Sensor

from .contacts import ContactReader, ContactsSensor
from .mean import MeanContactsSensor


class ContactArrowsSensor(Sensor):
    """Reports the contact forces that acted on a body in the last tick, as arrows.

    Args:
        metres_per_newton: Length [m/N] of the arrow for a force of 1 N.
    """

    sample_type = ContactArrowsSample
    ros_topic = "rpbi.ros.publishers.sample_topics:CONTACT_ARROWS"

    def __init__(self, body: SensedBody, hz: float, metres_per_newton: float) -> None:
        super().__init__(body.name, hz)
        self._body = body
        self._reader: ContactReader | None = None
        self._metres_per_newton = metres_per_newton

    def enter(self, world: SensedWorld) -> None:
        """Stores the world's contact reader."""
        self._reader = world.contacts

    def read(self, tick: int) -> ContactArrowsSample:
        """Returns an arrow, proportional to the force, for each contact point whose force is not zero."""
        assert self._reader is not None  # ensured by the world
        arrows = (
            (point.position, plus(point.position, scaled(self._metres_per_newton, point.force)))
            for point in self._reader.sample(self._body, tick).points
        )
        return ContactArrowsSample(self.name, tuple((start, end) for start, end in arrows if start != end))


def contact_sensors(body: SensedBody, config: ContactsConfig | None) -> tuple[Sensor, ...]:
    """Creates the contact sensors of a body; returns an empty tuple without a configuration."""
    if config is None:
        return ()
    contacts = (MeanContactsSensor if config.average else ContactsSensor)(body, config.hz)
    if not config.arrows_hz:
        return (contacts,)
    return (contacts, ContactArrowsSensor(body, config.arrows_hz, config.arrow_metres_per_newton))
