"""Simulates a recorded session again and compares the hashes of its states with the recorded hashes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from custom_ros_tools.errors import InterfaceError
from rpbi.world import World
from rpbi.world.saved.command_log import KEYFRAME, RecordedCommand, apply_command
from rpbi.world.saved.description import WorldDescription
from rpbi.world.saved.values import from_text


class Checkpoint(NamedTuple):
    """Hash of the state of a recorded world at a given time; the fields are ordered so that checkpoints sort by time.

    Attributes:
        resets: Number of resets of the world before the checkpoint.
        tick: Tick of the world.
        commands: Number of commands since the last reset, or since the start if there was none.
        state_hash: Hash of the world's state.
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
        commands: For each number of resets before them, the commands, indexed by their position since the last reset
            (or since the start).
        checkpoints: The recorded states, in any order.
    """

    description: WorldDescription
    commands: dict[int, dict[int, RecordedCommand]] = field(default_factory=dict)
    checkpoints: set[Checkpoint] = field(default_factory=set)

    def parts(self) -> list[RecordedPart]:
        """Splits the recording into parts that can be replayed independently, and returns the parts in order
        of time.
        """
        parts = []
        start = Checkpoint(0, 0, 0, self.description.start_hash)
        checkpoints = sorted({start, *self.checkpoints})
        for resets in sorted({each.resets for each in checkpoints}):
            commands = self.commands.get(resets, {})
            ends = [index for index, each in sorted(commands.items()) if each.what == KEYFRAME]
            states = [each for each in checkpoints if each.resets == resets]
            for begin, end in zip([None, *ends], [*ends, None]):
                first = 0 if begin is None else begin + 1
                own = tuple(each for each in states if first <= each.commands and (end is None or each.commands <= end))
                if own or end is not None:
                    keyframe = None if begin is None else commands[begin]
                    parts.append(RecordedPart(resets, first, keyframe, own, end))
        return parts


class RecordedPart(NamedTuple):
    """A part of a recording.

    It begins at a start of the world (when the world was built or reset) or at a keyframe, and ends at the next
    keyframe or at the last recorded state.

    Attributes:
        resets: Number of resets of the world before the part.
        first: Index of the part's first command.
        keyframe: Command of the keyframe at which the part begins; None if the part begins at a start of the world.
        checkpoints: The recorded states of the part, in order of time.
        end: Index of the command of the keyframe with which the part ends; None if it ends with the last state.
    """

    resets: int
    first: int
    keyframe: RecordedCommand | None
    checkpoints: tuple[Checkpoint, ...]
    end: int | None


class Difference(NamedTuple):
    """A state of the replay that differs from the recorded state.

    Attributes:
        checkpoint: The recorded state.
        state_hash: Hash of the state in the replay.
        last_agreement: The last earlier state that agreed; None if none has agreed since the replay last began at a
            start of the world or at a keyframe.
    """

    checkpoint: Checkpoint
    state_hash: str
    last_agreement: Checkpoint | None


class ReplayResult(NamedTuple):
    """Outcome of a replay.

    Attributes:
        agreed: Number of states that agreed with the recording.
        ticks: Number of ticks replayed.
        difference: The first state that differs from the recording, at which the replay ended; None if no state
            differs.
        left_out: For each stretch of the recording that could not be replayed, a text with where it begins and why.
    """

    agreed: int
    ticks: int
    difference: Difference | None
    left_out: tuple[str, ...]


class Replay:
    """Builds the world of a recording and replays the recorded commands in it.

    Args:
        recording: The recording to replay.
        progress: Called with the number of ticks replayed since the last call.
        observe: Called where a part begins at a start of the world or at a keyframe, and after every tick. Its
            arguments are the world, the number of resets so far in the recording, and the samples.

    Raises:
        ConfigError: If the world cannot be built on this machine.
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
        self._agreement: Checkpoint | None = None
        self._left_out: list[str] = []

    def run(self, parts: Sequence[RecordedPart] | None = None) -> ReplayResult:
        """Replays parts of the recording up to the first difference, and returns the outcome.

        Args:
            parts: Consecutive parts of the recording; all parts by default. The first part begins at its start of the
                world or at its recorded keyframe, and so does a part after a reset or after a part that could not be
                replayed. Every other part continues where the previous part ended. A part that another part follows
                before the next reset ends with a keyframe, which is compared with the recorded keyframe. Thus if all
                parts agree, even if replayed by different processes, the whole recording agrees.
        """
        difference, continues = None, False
        try:
            for turn, part in enumerate(self._recording.parts() if parts is None else parts):
                if not continues:
                    try:
                        self._begin(part, turn == 0)
                    except InterfaceError as error:
                        self._left_out.append(f"from the keyframe before command {part.first} on: {error}")
                        continue
                difference, continues = self._run_part(part)
                if difference is not None:
                    break
        finally:
            self._world.close()
        return ReplayResult(self._agreed, self._ticks, difference, tuple(self._left_out))

    def _begin(self, part: RecordedPart, is_new: bool) -> None:
        if not is_new:
            self._world.reset()
        if part.keyframe is not None:
            self._world.enter_keyframe(str(from_text(part.keyframe.data)))
        self._resets, self._agreement = part.resets, None
        self._observe(self._world, part.resets, self._world.read_rest())

    def _run_part(self, part: RecordedPart) -> tuple[Difference | None, bool]:
        """Replays a part; returns the first state that differs, if any, and whether the next part can continue from
        its end.
        """
        commands = self._recording.commands.get(part.resets, {})
        done = part.first
        ends = [] if part.end is None else [Checkpoint(part.resets, commands[part.end].tick, part.end + 1, "")]
        for checkpoint in (*part.checkpoints, *ends):
            missing = next((index for index in range(done, checkpoint.commands) if index not in commands), None)
            if missing is not None:
                self._left_out.append(
                    f"from {checkpoint} on: command {missing} is not in the recording, which has to begin before the "
                    "first command, or before a reset"
                )
                return None, False
            try:
                done = self._advance(checkpoint, commands, done)
            except Exception as error:  # a recording may contain invalid data, which fails at once or in a later step
                at = f"tick {self._world.clock.tick}"
                words = error if isinstance(error, (InterfaceError, ValueError)) else f"{type(error).__name__}: {error}"
                self._left_out.append(f"from {at} on, before {checkpoint}: {words}")
                return None, False
            if not checkpoint.state_hash:
                continue
            state_hash = self._world.state_hash()
            if state_hash != checkpoint.state_hash:
                return Difference(checkpoint, state_hash, self._agreement), False
            self._agreed += 1
            self._agreement = checkpoint
        return None, part.end is not None

    def _advance(self, to: Checkpoint, commands: Mapping[int, RecordedCommand], done: int) -> int:
        """Applies commands and steps up to a checkpoint; returns the index of the next command to be applied."""
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
