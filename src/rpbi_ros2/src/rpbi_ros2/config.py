"""Parameters of the bridge, and the topics that it connects."""

from __future__ import annotations

import os
from collections.abc import Mapping
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Annotated

from pydantic import Field

from custom_ros_tools.errors import InterfaceError, hint
from custom_ros_tools.schema import ConfigModel, Text, optional

MAX_DOMAIN = 232
"""Largest number of a domain; larger ones have no ports."""
DOMAIN_VARIABLE = "ROS_DOMAIN_ID"
LOOPBACK = "lo"
"""Interface that only this computer reaches."""
INTERFACES = Path("/sys/class/net")
NEVER_OUT = frozenset({"/rosout", "/rosout_agg", "/statistics"})
"""Topics of ROS itself, which ROS 2 has in its own form."""
NEVER_IN = NEVER_OUT | {"/clock", "/tf", "/tf_static", "/diagnostics"}
"""Topics whose messages from ROS 2 would contradict those of the world."""


class BridgeConfig(ConfigModel):
    """Private parameters of the bridge."""

    domain_id: Annotated[int, Field(ge=0, le=MAX_DOMAIN)] | None = optional(
        f"Domain of ROS 2. By default, that of the variable {DOMAIN_VARIABLE}, or 0."
    )
    prefix: str = Field("", description="Namespace of all topics in ROS 2, for several simulators in one domain.")
    interface: Text = Field(
        LOOPBACK, description="Network interface, such as `eth0`. By default `lo`, which only this computer reaches."
    )
    topics: Text = Field(
        "*", description="Topics of ROS 1 that are connected, separated by spaces; `*` stands for any characters."
    )
    packages: str = Field(
        "", description="Further packages of messages that ROS 2 has with equal definitions, separated by spaces."
    )

    def domain(self, environment: Mapping[str, str] = os.environ) -> int:
        """Returns the domain of ROS 2.

        Raises:
            InterfaceError: If the variable has no valid number.
        """
        if self.domain_id is not None:
            return self.domain_id
        text = environment.get(DOMAIN_VARIABLE) or "0"
        if not text.isdecimal() or int(text) > MAX_DOMAIN:
            raise InterfaceError(f"{DOMAIN_VARIABLE}: expected a number from 0 to {MAX_DOMAIN}, got '{text[:20]}'")
        return int(text)

    def check_interface(self) -> None:
        """Checks that this computer has the network interface.

        Raises:
            InterfaceError: If it has not.
        """
        known = sorted(path.name for path in INTERFACES.iterdir()) if INTERFACES.is_dir() else []
        if self.interface not in known:
            raise InterfaceError(f"interface: no network interface '{self.interface}'{hint(self.interface, known)}")

    def connects(self, topic: str) -> bool:
        """Returns whether the bridge connects a topic of ROS 1, given by its full name."""
        patterns = (pattern if pattern[0] in "*/" else f"/{pattern}" for pattern in self.topics.split())
        return any(fnmatchcase(topic, pattern) for pattern in patterns)

    def ros2_name(self, topic: str) -> str:
        """Returns the full name in ROS 2 of a topic of ROS 1."""
        prefix = self.prefix.strip("/")
        return f"/{prefix}{topic}" if prefix else topic
