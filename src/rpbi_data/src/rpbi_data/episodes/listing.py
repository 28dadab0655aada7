"""Formats episodes as text."""

from collections.abc import Iterable

from .folder import SET_BACK, Episode

_HEADER = ("episode", "label", "seconds", "simulated", "messages", "joint states", "longest gap", "state")


def table_of(episodes: Iterable[Episode]) -> str:
    """Returns a table with one line per episode."""
    rows = [_HEADER, *map(_row, episodes)]
    widths = [max(len(row[column]) for row in rows) for column in range(len(_HEADER))]
    return "\n".join(
        "  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip() for row in rows
    )


def _row(episode: Episode) -> tuple[str, ...]:
    rhythm = episode.joint_rhythm()
    rate, gap = ("-", "-") if rhythm is None else (f"{rhythm[0]:.5g} Hz", f"{1e3 * rhythm[1]:.3g} ms")
    lost = sum(episode.lost.values())
    state = episode.state + (f", {lost} messages lost" if lost else "") + clock_note(episode.set_back_s)
    state += f": {episode.note}" if episode.note else ""
    return (
        str(episode.number),
        episode.label or "-",
        f"{episode.seconds:.1f}",
        _simulated(episode),
        str(episode.messages),
        rate,
        gap,
        state,
    )


def _simulated(episode: Episode) -> str:
    """Returns the simulated duration of an episode as text [s], or `-` if unknown."""
    return "-" if episode.simulated_s is None else f"{episode.simulated_s:.1f}"


def clock_note(set_back_s: float) -> str:
    """Returns a text, to append to a message, about a clock that was set back by `set_back_s` [s]; empty for 0."""
    return f", a clock was set back by {set_back_s:.3g} s" if set_back_s else ""


def details_of(episode: Episode) -> str:
    """Returns a text with all stored data of an episode, except for the list of the world's files."""
    lines = [f"{episode.name}: {episode.state}{f', {episode.note}' if episode.note else ''}"]
    lines += [
        f"label    {episode.label or '-'}",
        f"started  {episode.started}, {episode.seconds:.1f} s, {_simulated(episode)} s simulated",
    ]
    lines += [f"seeds    {episode.seeds or '-'}", f"git      {episode.git or '-'}"]
    lines += ["versions " + ", ".join(f"{name} {text}" for name, text in episode.versions.items())]
    lines += [f"files    {len(episode.files)}"]
    for topic, each in episode.topics.items():
        lost = f", {episode.lost[topic]} lost" if topic in episode.lost else ""
        rhythm = f"{each['rate_hz']:.5g} Hz, longest gap {1e3 * each['max_gap_s']:.3g} ms"
        lines.append(f"{topic}: {each['messages']} messages{lost}, {rhythm}{clock_note(each.get(SET_BACK, 0.0))}")
    return "\n".join(lines)
