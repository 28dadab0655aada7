"""A policy as users wrote it before its base class moved."""

from episodes.farm.policy import Policy


class Push(Policy):
    """Ends with success after five ticks."""

    def act(self) -> str | None:
        return "success" if self.world.clock.tick >= 5 else None
