"""What YAML says of every sensor of another package."""

from __future__ import annotations

from pydantic import Field

from custom_ros_tools.schema import ConfigModel, Hz, Name, Text


class SensorConfig(ConfigModel):
    """An entry of a body's `sensors`; a sensor with more keys has a subclass of this as its `Config`."""

    type: Text = Field(description="Its class, as `module:Class`.")
    name: Name = Field(description="Its name, by which its body has no other sensor; topics are named after it.")
    hz: Hz = Field(description="How often it is read, in the world's time.")
