"""What YAML may say of a body's contacts."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from pydantic import Field

from custom_ros_tools.schema import ConfigModel, Hz, HzOrOff, Positive, Unit

from .contact_arrows import ContactArrowsSensor
from .contacts import ContactsSensor
from .sensor import Sensor

if TYPE_CHECKING:
    from ..bodies.body import Body


class ContactsConfig(ConfigModel):
    """How a body's contacts are told."""

    hz: Hz = Field(50.0, description="Rate of `rpbi/NAME/contacts`.")
    arrows_hz: HzOrOff = Field(20.0, description="Rate of the arrows for RViz; 0 is off.")
    arrow_metres_per_newton: Annotated[Positive, Unit("m/N")] = Field(
        0.01, description="Length of an arrow by the force that it stands for."
    )


def contact_sensors(body: Body, config: ContactsConfig | None) -> tuple[Sensor, ...]:
    """Returns the sensors of a body's contacts; none if they are not asked for."""
    if config is None:
        return ()
    contacts = ContactsSensor(body, config.hz)
    if not config.arrows_hz:
        return (contacts,)
    return (contacts, ContactArrowsSensor(contacts, config.arrows_hz, config.arrow_metres_per_newton))
