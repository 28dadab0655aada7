"""Error classes of the workspace, which all derive from `InterfaceError`.

The class of an error says who can correct the fault, such as the author of a configuration. Most errors store data,
from which they compose the message.
"""

import difflib
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path

IS_WHEEL = Path(__file__).with_name("share").is_dir()
"""Whether this code runs from the wheel, where there is no `./rpbi`."""
_SETUP = re.compile(r"\./rpbi setup(?: (\w+))?")
MAX_QUOTE_LENGTH = 60
"""Largest number of characters that a message quotes from a file, which may be confidential."""
MAX_LINE_LENGTH = 2_000
"""Largest number of characters in a line of a message."""
MAX_LINES = 100
"""Largest number of lines in a message."""


def shortened(text: str) -> str:
    """Cuts a text to at most `MAX_QUOTE_LENGTH` characters, for quotation in a message."""
    return text if len(text) <= MAX_QUOTE_LENGTH else f"{text[: MAX_QUOTE_LENGTH - 3]}..."


def bounded(text: str) -> str:
    """Cuts a message to at most 100 lines with about 2,000 characters each."""
    lines = text.split("\n")
    kept = [line if len(line) <= MAX_LINE_LENGTH else f"{line[:MAX_LINE_LENGTH]}..." for line in lines[:MAX_LINES]]
    return "\n".join([*kept, f"... and {len(lines) - MAX_LINES} lines more"] if len(lines) > MAX_LINES else kept)


def closest(name: str, known: Iterable[str]) -> str | None:
    """Returns the known name that is most similar to `name`, ignoring case; None if all names are dissimilar."""
    if len(name) > MAX_QUOTE_LENGTH:  # the search is slow for long names
        return None
    by_lower_case = {candidate.lower(): candidate for candidate in known}
    match = difflib.get_close_matches(name.lower(), by_lower_case, n=1)
    return by_lower_case[match[0]] if match else None


def hint(name: str, known: Iterable[str]) -> str:
    """Returns the end of a message about an unknown name: `"; did you mean 'x'?"`, or the list of known names."""
    names = sorted(set(known))
    match = closest(name, names)
    if match is not None:
        return f"; did you mean '{match}'?"
    return f"; known are {', '.join(names)}" if names else ""


class InterfaceError(Exception):
    """Base class of all errors that this workspace raises on purpose."""


@dataclass(frozen=True)
class Problem:
    """A fault in a configuration file.

    Attributes:
        file: Path of the YAML file as the user wrote it; `"~config"` for a configuration from the parameter server.
        key: Dotted key path with list indices, such as `intrinsics.range[1]`; empty for the whole file.
        message: Description of the fault, usually with the expected value and the given value.
    """

    file: str
    key: str
    message: str

    def __str__(self) -> str:
        text = ": ".join(part for part in (self.file, self.key, self.message) if part)
        return bounded(" ".join(text.splitlines()))  # one line, even if the user's text has several


class ConfigError(InterfaceError):
    """A configuration is invalid, and has to be changed by its author. `problems` lists all faults that were found."""

    def __init__(self, problems: Sequence[Problem]) -> None:
        self.problems = tuple(problems)
        super().__init__(self.problems)

    def __str__(self) -> str:
        return "\n".join(map(str, self.problems))


class UnknownNameError(InterfaceError):
    """The caller used an unknown name.

    Attributes:
        kind: Noun for the named object, such as `"joint"`.
        name: The unknown name.
        known: The known names.
    """

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
    """An optional library is not installed.

    Attributes:
        package: Name of the library.
        how: Instructions to install the library, such as a command to type.
    """

    package: str
    how: str

    def __str__(self) -> str:
        match = _SETUP.fullmatch(self.how) if IS_WHEEL else None
        wanted = f"'rpbi[{match[1]}]'" if match and match[1] else self.package
        return f"'{self.package}' is not installed: {f'pip install {wanted}' if match else self.how}"


@dataclass(eq=False)
class PluginError(InterfaceError):
    """A plug-in, which is a class or function of another package, failed.

    Attributes:
        plugin: Name of the plug-in, as `module:Class`.
        doing: Name of the method that failed, such as `before_step`, if necessary with the name of an object.
        cause: The error as text, with file and line.
    """

    plugin: str
    doing: str
    cause: str

    def __str__(self) -> str:
        return f"{self.plugin} failed in {self.doing}: {self.cause}"


class PhysicsError(InterfaceError):
    """PyBullet rejected a call that the configuration allows. The message contains the call and PyBullet's message."""


@contextmanager
def collecting_problems() -> Iterator[Callable[[], AbstractContextManager[None]]]:
    """Collects the problems of several parts of a configuration, so that all problems are reported together.

    Yields:
        A function that makes a context for one part: `with collecting_problems() as part`, then `with part(): ...`
        for each part.

    Raises:
        ConfigError: At the end, if at least one part raised a ConfigError. It contains the problems of all parts.
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
