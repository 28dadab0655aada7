"""Receives datagrams on a port and discards them."""

from __future__ import annotations

import socket
import sys


def main() -> None:
    """Receives on the port of the first argument, until it is ended."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", int(sys.argv[1])))
        print("ready", flush=True)
        while True:
            receiver.recv(65_535)


if __name__ == "__main__":
    main()
