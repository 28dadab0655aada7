"""A short text that two worlds share if, and as good as only if, all in them is at the same place to the last bit."""

import hashlib
import struct
from collections.abc import Mapping

from rpbi.bodies import Body

DIGEST_BYTES = 16


def state_hash(tick: int, bodies: Mapping[str, Body]) -> str:
    """Returns the BLAKE2b hash of the positions and velocities of all bodies and joints at a tick.

    It is the same in any process, since it depends on nothing but names, in their order, and the bytes of the numbers.
    What motors are set to is no part of it; it shows as soon as something moves by it. Soft bodies are left out: their
    motion is not the same every time.

    Args:
        tick: The tick.
        bodies: The bodies by name.
    """
    digest = hashlib.blake2b(struct.pack("<Q", tick), digest_size=DIGEST_BYTES)
    for name in sorted(bodies):
        numbers = bodies[name].motion_state()
        digest.update(name.encode() + b"\0" + struct.pack(f"<{len(numbers)}d", *numbers))
    return digest.hexdigest()
