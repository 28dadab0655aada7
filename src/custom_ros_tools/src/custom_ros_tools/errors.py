"""Errors, grouped by whose fault they are; every one of them is an `InterfaceError`.

Each holds data and composes its own message, so that the wording lives in one place.
"""

import difflib
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass

MAX_QUOTE_LENGTH = 60
"""Largest number of characters of a file that a message quotes; the file may be confidential."""
MAX_LINE_LENGTH = 2_000
"""Largest length of a line of a message."""
MAX_LINES = 100
"""Largest number of lines of a message."""


def shortened(text: str) -> str:
    """Returns a text for quotation, shortened if it is long."""
    return text if len(text) <= MAX_QUOTE_LENGTH else f"{text[: MAX_QUOTE_LENGTH - 3]}..."


def bounded(text: str) -> str:
    """Returns a message with at most 100 lines of at most 2,000 characters, whatever input of the caller it quotes."""
    lines = text.split("\n")
    kept = [line if len(line) <= MAX_LINE_LENGTH else f"{line[:MAX_LINE_LENGTH]}..." for line in lines[:MAX_LINES]]
    return "\n".join([*kept, f"... and {len(lines) - MAX_LINES} lines more"] if len(lines) > MAX_LINES else kept)


def closest(name: str, known: Iterable[str]) -> str | None:
    """Returns the known name most similar to `name`, or None if none is similar (case is ignored)."""
    if len(name) > MAX_QUOTE_LENGTH:  # the search is slow for long names
        return None
    by_lower_case = {candidate.lower(): candidate for candidate in known}
    match = difflib.get_close_matches(name.lower(), by_lower_case, n=1)
    return by_lower_case[match[0]] if match else None


def hint(name: str, known: Iterable[str]) -> str:
    """Returns `"; did you mean 'x'?"`, or the list of known names, to be put after "unknown ..."."""
    names = sorted(set(known))
    match = closest(name, names)
    if match is not None:
        return f"; did you mean '{match}'?"
    return f"; known are {', '.join(names)}" if names else ""


class InterfaceError(Exception):
    """Base of every error this workspace raises on purpose."""


@dataclass(frozen=True)
class Problem:
    """One fault in one configuration file.

    Attributes:
        file: Path of the YAML file as the user wrote it; `"~config"` when it came from the parameter server.
        key: Dotted key path with list indices, such as `intrinsics.range[1]`; empty for the file as a whole.
        message: The expected value, the value found, and what to write instead.
    """

    file: str
    key: str
    message: str

    def __str__(self) -> str:
        text = ": ".join(part for part in (self.file, self.key, self.message) if part)
        return bounded(" ".join(text.splitlines()))  # one line each, whatever the user's text holds


class ConfigError(InterfaceError):
    """The author of the configuration has to change something; has all problems, in the order of the files."""

    def __init__(self, problems: Sequence[Problem]) -> None:
        self.problems = tuple(problems)
        super().__init__(self.problems)

    def __str__(self) -> str:
        return "\n".join(map(str, self.problems))


class UnknownNameError(InterfaceError):
    """The caller used an unknown name; `kind` is the kind of object, such as `"joint"`."""

    def __init__(self, kind: str, name: str, known: Iterable[str]) -> None:
        self.kind, self.name, self.known = kind, name, tuple(known)
        super().__init__(kind, name, self.known)

    def __str__(self) -> str:
        known = f"known are {', '.join(self.known)}" if self.known else "there is none"
        match = closest(self.name, self.known)
        question = f"; did you mean '{match}'?" if match else ""
        return f"unknown {self.kind} '{shortened(self.name)}': {known}{question}"


@dataclass(eq=False)
class MissingDependency(InterfaceError):  # noqa: N818 (the name says what is the matter)
    """An optional library is not installed; `how` is a remedy, such as a command to type."""

    package: str
    how: str

    def __str__(self) -> str:
        return f"'{self.package}' is not installed: {self.how}"


@dataclass(eq=False)
class PluginError(InterfaceError):
    """A class or function of another package failed.

    Attributes:
        plugin: Its name, as `module:Class`.
        doing: The call that failed, such as `before_step`, if necessary with its object.
        cause: The error, with file and line.
    """

    plugin: str
    doing: str
    cause: str

    def __str__(self) -> str:
        return f"{self.plugin} failed in {self.doing}: {self.cause}"


class PhysicsError(InterfaceError):
    """PyBullet rejected a call that the configuration allows; has the request and PyBullet's message."""


@contextmanager
def collecting_problems() -> Iterator[Callable[[], AbstractContextManager[None]]]:
    """Collects the problems of several parts of a configuration, so that all of them are reported at once.

    Yields:
        A factory of contexts for the parts: `with collecting_problems() as part`, then `with part(): ...` for each.

    Raises:
        ConfigError: At the end, if a part raised one; has the problems of all.
    """
    problems: list[Problem] = []

    @contextmanager
    def part() -> Iterator[None]:
        try:
            yield
        except ConfigError as error:
            problems.extend(error.problems)

    yield part
    if problems:
        raise ConfigError(problems)
