"""A link between two network namespaces on which packets take a while, in their order.

Arguments: the name of the interface on either side, both namespaces, the delay and the most that comes on top [s].
"""

from __future__ import annotations

import ctypes
import fcntl
import heapq
import os
import random
import select
import struct
import sys
import time

_CLONE_NEWNET = 0x40000000
_TUNSETIFF, _IFF_TUN, _IFF_NO_PI = 0x400454CA, 0x0001, 0x1000
_LONGEST_PACKET = 65_536


def main() -> None:
    """Carries packets until it is ended."""
    name, first, second, delay_s, jitter_s = sys.argv[1:]
    ends = [_open(name, each) for each in (first, second)]
    print("ready", flush=True)
    others = {ends[0]: ends[1], ends[1]: ends[0]}
    latest_s = dict.fromkeys(ends, 0.0)
    waiting: list[tuple[float, int, int, bytes]] = []
    count = 0
    while True:
        patience_s = max(0.0, waiting[0][0] - time.monotonic()) if waiting else None
        for end in select.select(ends, [], [], patience_s)[0]:
            due_s = time.monotonic() + float(delay_s) + random.uniform(0.0, float(jitter_s))
            latest_s[end] = max(due_s, latest_s[end])  # TCP takes a packet that was overtaken for lost
            count += 1
            heapq.heappush(waiting, (latest_s[end], count, others[end], os.read(end, _LONGEST_PACKET)))
        while waiting and waiting[0][0] <= time.monotonic():
            _, _, end, packet = heapq.heappop(waiting)
            try:
                os.write(end, packet)
            except OSError:  # the other side is down
                continue


def _open(name: str, namespace: str) -> int:
    """Makes an interface in a namespace, and returns the file of its packets."""
    with open(namespace) as file:
        if ctypes.CDLL(None, use_errno=True).setns(file.fileno(), _CLONE_NEWNET):
            raise OSError(ctypes.get_errno(), "setns")
    tun = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
    fcntl.ioctl(tun, _TUNSETIFF, struct.pack("16sH", name.encode(), _IFF_TUN | _IFF_NO_PI))
    return tun


if __name__ == "__main__":
    main()
