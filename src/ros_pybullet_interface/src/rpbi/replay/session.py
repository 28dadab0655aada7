"""Replays a recorded session, and compares hashes of the simulated states with the recorded hashes."""

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
    """The recorded hash of a world's state at one time. Sorting checkpoints sorts them by time.

    Attributes:
        resets: Number of resets of the world before the checkpoint.
        tick: Tick of the world.
        commands: Number of commands since the last reset, or since the start if there was no reset.
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
        commands: Commands, indexed by the number of resets before the command, and then by the number of earlier
            commands since the last reset (or since the start of the session).
        checkpoints: The recorded hashes.
    """

    description: WorldDescription
    commands: dict[int, dict[int, RecordedCommand]] = field(default_factory=dict)
    checkpoints: set[Checkpoint] = field(default_factory=set)

    def parts(self) -> list[RecordedPart]:
        """Splits the recording into parts that can be replayed independently, sorted by time."""
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
    """A part of a recording that can be replayed independently of earlier parts.

    A part begins when the world was built or reset, or at a keyframe. The part ends at the next keyframe, or at the
    last checkpoint before the next reset.

    Attributes:
        resets: Number of resets of the world before the part.
        first: Index of the part's first command among the commands since the last reset.
        keyframe: Command that made the keyframe at which the part begins; None if the part begins with a built or reset
            world.
        checkpoints: Checkpoints of the part, sorted by time.
        end: Index of the command that made the keyframe at which the part ends; None if the part ends at a checkpoint.
    """

    resets: int
    first: int
    keyframe: RecordedCommand | None
    checkpoints: tuple[Checkpoint, ...]
    end: int | None


class Difference(NamedTuple):
    """A checkpoint at which the replayed state differs from the recorded state.

    Attributes:
        checkpoint: The checkpoint.
        state_hash: Hash of the replayed state.
        last_agreement: The last checkpoint before `checkpoint` at which both states agreed. None if the states have not
            agreed at a checkpoint since the replay last built or reset the world.
    """

    checkpoint: Checkpoint
    state_hash: str
    last_agreement: Checkpoint | None


class ReplayResult(NamedTuple):
    """Outcome of a replay.

    Attributes:
        agreed: Number of checkpoints at which the replayed state agreed with the recording.
        ticks: Number of replayed ticks.
        difference: The first difference from the recording, at which the replay ended; None without a difference.
        left_out: A message for each section of the recording that could not be replayed. The message names the start of
            the section and the reason.
    """

    agreed: int
    ticks: int
    difference: Difference | None
    left_out: tuple[str, ...]


class Replay:
    """Builds the world of a recording and replays the recorded commands in it.

    Args:
        recording: The recording to replay.
        progress: Function that is called at each checkpoint, with the number of ticks replayed since the last call.
        observe: Function that is called after every tick. It is also called after the replay has built or reset the
            world and, if the part begins with a recorded keyframe, has set the world to this keyframe. The arguments
            are the world, the number of resets so far in the recording, and the sensor samples.

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
        """Replays parts of the recording up to the first difference, and returns the result.

        At a keyframe that ends a part, the replay makes the keyframe again, and compares the new keyframe with the
        recorded one. The next part then continues from the replayed state. All other parts begin with the built or
        reset world, or with their recorded keyframe. Therefore different processes may replay different parts: if all
        parts agree, the whole recording agrees.

        Args:
            parts: Consecutive parts of the recording; all parts by default.
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
        """Replays a part from the present state of the world.

        Returns:
            The first difference, or None without a difference; and whether the next part can continue from the present
            state.
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
        """Steps the world and applies commands up to a checkpoint.

        Args:
            to: The checkpoint.
            commands: Commands since the last reset, indexed by the number of earlier commands since this reset.
            done: Number of commands already applied, which is the index of the next command.

        Returns:
            The new value of `done`.
        """
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
