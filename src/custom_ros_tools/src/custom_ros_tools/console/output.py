"""The standard output of commands."""

import select


def is_output_closed() -> bool:
    """Returns whether the standard output is a pipe that nobody reads any more."""
    output = select.poll()
    output.register(1, 0)
    return any(event & select.POLLERR for _, event in output.poll(0))
