"""Runs a recorded session again and compares the hashes of its states."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from custom_ros_tools.errors import InterfaceError
from rpbi.world import World
from rpbi.world.saved.command_log import RecordedCommand
from rpbi.world.saved.commands import apply_command
from rpbi.world.saved.description import WorldDescription


class Checkpoint(NamedTuple):
    """A recorded state; checkpoints sort by time.

    Attributes:
        resets: Number of resets of the world before.
        tick: The world's tick.
        commands: Number of commands since the reset.
        state_hash: The hash.
    """

    resets: int
    tick: int
    commands: int
    state_hash: str

    def __str__(self) -> str:
        return f"tick {self.tick}" + (f" after reset {self.resets}" if self.resets else "")


@dataclass
class Recording:
    """A recorded session.

    Attributes:
        description: Description of the world.
        commands: By number of resets and index the commands.
        checkpoints: The states, in any order.
    """

    description: WorldDescription
    commands: dict[int, dict[int, RecordedCommand]] = field(default_factory=dict)
    checkpoints: set[Checkpoint] = field(default_factory=set)


class Difference(NamedTuple):
    """A state that differs from the recorded one.

    Attributes:
        checkpoint: The recorded state.
        state_hash: Its hash in the replay.
        last_agreement: The last state that agreed, None if there was none since the world was built or reset.
    """

    checkpoint: Checkpoint
    state_hash: str
    last_agreement: Checkpoint | None


class ReplayResult(NamedTuple):
    """Outcome of a replay.

    Attributes:
        agreed: Number of states that agreed.
        ticks: Number of ticks replayed.
        difference: The first state that differs, if one does; the replay ends there.
        left_out: Commands that could not be replayed, with reasons.
    """

    agreed: int
    ticks: int
    difference: Difference | None
    left_out: tuple[str, ...]


class Replay:
    """Builds the world of a recording and runs it through its commands.

    Args:
        recording: The recording.
        progress: Called with the number of ticks since the last call.
        observe: Called with the world, the number of resets before in the recording, and the samples, at every start
            and after every tick.

    Raises:
        ConfigError: If the world cannot be built here.
    """

    def __init__(
        self,
        recording: Recording,
        progress: Callable[[int], Any] = lambda _: None,
        observe: Callable[[World, int, list[Any]], Any] = lambda *_: None,
    ) -> None:
        self._recording, self._progress, self._observe = recording, progress, observe
        self._resets = 0
        self._world = World.from_description(recording.description)
        self._agreed = self._ticks = 0
        self._left_out: list[str] = []

    def run(self) -> ReplayResult:
        """Replays all that can be, each reset being a new start, up to the first difference."""
        difference = None
        lives: dict[int, set[Checkpoint]] = {}
        for checkpoint in {Checkpoint(0, 0, 0, self._recording.description.start_hash), *self._recording.checkpoints}:
            lives.setdefault(checkpoint.resets, set()).add(checkpoint)
        try:
            for turn, resets in enumerate(sorted(lives)):
                if turn:
                    self._world.reset()
                self._resets = resets
                self._observe(self._world, resets, self._world.read_rest())
                difference = self._live(sorted(lives[resets]), self._recording.commands.get(resets, {}))
                if difference is not None:
                    break
        finally:
            self._world.close()
        return ReplayResult(self._agreed, self._ticks, difference, tuple(self._left_out))

    def _live(self, checkpoints: list[Checkpoint], commands: Mapping[int, RecordedCommand]) -> Difference | None:
        """Runs from a start of the world to its last recorded state; returns the first that differs."""
        done = 0
        agreement: Checkpoint | None = None
        for checkpoint in checkpoints:
            missing = next((index for index in range(done, checkpoint.commands) if index not in commands), None)
            if missing is not None:
                self._left_out.append(
                    f"from {checkpoint} on: command {missing} is not in the recording, which has to begin before the "
                    "first command, or before a reset"
                )
                return None
            try:
                done = self._advance(checkpoint, commands, done)
            except (InterfaceError, ValueError) as error:
                at = f"tick {self._world.clock.tick}"
                self._left_out.append(f"from {at} on, before {checkpoint}: {error}")
                return None
            state_hash = self._world.state_hash()
            if state_hash != checkpoint.state_hash:
                return Difference(checkpoint, state_hash, agreement)
            self._agreed += 1
            agreement = checkpoint
        return None

    def _advance(self, to: Checkpoint, commands: Mapping[int, RecordedCommand], done: int) -> int:
        """Applies commands and steps up to a checkpoint; returns how many commands were applied since the start."""
        world, start = self._world, self._world.clock.tick
        while True:
            tick = world.clock.tick
            while done < to.commands and commands[done].tick <= tick:
                apply_command(world, commands[done])
                done += 1
            if tick >= to.tick:
                break
            self._observe(world, self._resets, world.step())
        self._ticks += to.tick - start
        self._progress(to.tick - start)
        return done
