"""Makes a command of `./rpbi` from a function, with argument parser, help text and completion."""

import argparse
import inspect
import re
import sys
import textwrap
from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from typing import Annotated, Any, NamedTuple, get_args, get_origin, get_type_hints

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.foreign import printable_lines
from custom_ros_tools.program import is_output_closed

from .argument import Argument, UsageError

PROGRAM = "./rpbi"
NAME_WIDTH = 16
"""Width of the column with argument names in the help text; longer names are followed by three spaces."""
_NEGATIVE = re.compile(r"-[\d.]")
_SECTION = re.compile(r"^(Usage|Args):\n((?:    .*\n|\n)*)", re.MULTILINE)


class Parameter(NamedTuple):
    """A parameter of a command's function.

    Attributes:
        name: Name of the parameter in Python.
        argument: Metadata from the parameter's annotation.
        kind: Kind of the parameter, as in `inspect.Parameter`.
        default: Default value; `inspect.Parameter.empty` for a parameter without default.
    """

    name: str
    argument: Argument
    kind: Any
    default: Any

    @property
    def is_option(self) -> bool:
        """Whether the parameter is an option instead of a positional argument."""
        return self.kind is inspect.Parameter.KEYWORD_ONLY

    @property
    def is_switch(self) -> bool:
        """Whether the parameter is an option without a value."""
        return self.is_option and self.default is False

    @property
    def flag(self) -> str:
        """Name of the option on the command line, such as `--quick`."""
        return self.argument.flag or f"--{self.name.replace('_', '-')}"

    @property
    def label(self) -> str:
        """Text for the argument in the help text: placeholders, preceded by the name of an option."""
        return (
            " ".join(filter(None, (self.flag, *self.placeholders))) if self.is_option else " ".join(self.placeholders)
        )

    @property
    def placeholders(self) -> tuple[str, ...]:
        """Placeholders of the argument's words, without brackets and dots."""
        return tuple(self.argument.shown.strip("[]").removesuffix(" ...").split())

    @property
    def words(self) -> int | str | None:
        """Number of words that the argument takes, in the notation of `nargs` in argparse."""
        shown = self.argument.shown
        if "..." in shown:
            return "*" if shown.startswith("[") else "+"
        if not self.is_option and self.default is not inspect.Parameter.empty:
            return "?"
        count = len(shown.split())
        return count if count > 1 else None


class Command:
    """A command of `./rpbi`, made from a function.

    Each parameter of the function has an `Argument` in its annotation. The function returns the text to print, or the
    exit code. The first line of the docstring is the summary. Paragraphs and examples may follow in any order. Entries
    of the section `Args:` begin with a parameter's name, or with an argument as the user types it. The section `Usage:`
    is needed only if the usage cannot be derived from the signature.

    Args:
        function: The function.

    Attributes:
        name: Name of the command, which is the name of the function.
        summary: First line of the docstring.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function
        self.name = function.__name__
        doc = f"{inspect.getdoc(function)}\n"
        sections = {match[1]: match[2] for match in _SECTION.finditer(doc)}
        self._usage, self._args = (textwrap.dedent(sections.get(name, "")).strip() for name in ("Usage", "Args"))
        self.summary, _, text = _SECTION.sub("", doc).partition("\n")
        self._text = text.strip("\n")

    @cached_property
    def parameters(self) -> list[Parameter]:
        """The parameters of the command's function."""
        hints = get_type_hints(self._function, include_extras=True)
        found = []
        for name, each in inspect.signature(self._function).parameters.items():
            if get_origin(hints[name]) is not Annotated:
                raise TypeError(f"{self.name}: {name}: expected Annotated[..., Argument(...)], got {hints[name]}")
            argument = next(one for one in get_args(hints[name]) if isinstance(one, Argument))
            found.append(Parameter(name, argument, each.kind, each.default))
        return found

    @property
    def section(self) -> str:
        """The help text, which is also the command's section in docs/commands.md, without the heading."""
        usage = self._usage or " ".join((PROGRAM, self.name, *self._usage_words()))
        blocks = [_indented(usage), self.summary, _indented("\n".join(self._rows())), self._text]
        return "\n\n".join(filter(None, blocks)) + "\n"

    def completions(self) -> Iterator[str]:
        """Yields lines of the completion file, each with the command, an argument, and the argument's source of values.

        A positional argument is given by its number, the last one by `*`, and an option by its name.
        """
        places = [each for each in self.parameters if not each.is_option]
        for each in self.parameters:
            argument = each.argument
            where = each.flag if each.is_option else "*" if each is places[-1] else str(places.index(each) + 1)
            if argument.choices is not None:
                yield f"{self.name} {where} words {' '.join(argument.choices())}"
            if argument.offers:
                yield f"{self.name} {where} {argument.offers}"
            if argument.files:
                yield f"{self.name} {where} files {argument.files}"

    def run(self, words: Sequence[str]) -> int:
        """Runs the command with the words of the command line, and prints the text that the function returns.

        Unsafe characters in the text are escaped. If the function raises an error, the message is printed to stderr.

        Returns:
            The exit code: 1 after an error, the integer that the function returns, or 0.

        Raises:
            BrokenPipeError: If the reader of the standard output has closed the pipe, see `run_command`.
        """
        if {"-h", "--help"} & set(words):
            print(self.section, end="")
            return 0
        try:
            result = self._function(*words) if self._is_raw else self._call(words)
        except (InterfaceError, OSError) as error:
            if isinstance(error, BrokenPipeError) and is_output_closed():
                raise
            message = printable_lines(str(error))
            if isinstance(error, UsageError):
                self._parser().error(message)
            print(f"{self.name}: {message}", file=sys.stderr)
            return 1
        if isinstance(result, str):
            print(printable_lines(result))
        return result if isinstance(result, int) else 0

    @property
    def _is_raw(self) -> bool:
        return any(each.argument.is_raw for each in self.parameters)

    def _call(self, words: Sequence[str]) -> Any:
        # Leaves out ROS arguments such as __name:=x. The leading space keeps argparse from reading -1 as an option.
        ours = [f" {word}" if _NEGATIVE.match(word) else word for word in words if not word.startswith("__")]
        parsed = vars(self._parser().parse_args(ours))
        arguments: list[Any] = []
        for each in self.parameters:
            if not each.is_option:
                value = parsed.pop(each.name)
                arguments += value if each.kind is inspect.Parameter.VAR_POSITIONAL else [value]
        return self._function(*arguments, **parsed)

    def _parser(self) -> argparse.ArgumentParser:
        parser = argparse.ArgumentParser(prog=f"{PROGRAM} {self.name}", description=self.summary)
        groups: dict[str, Any] = {"": parser}
        for each in self.parameters:
            argument = each.argument
            group = groups.setdefault(argument.excludes, None) or parser.add_mutually_exclusive_group()
            groups[argument.excludes] = group
            if each.is_switch:
                group.add_argument(each.flag, dest=each.name, action="store_true")
                continue
            given: dict[str, Any] = {"nargs": each.words, "type": _parse(argument)}
            given["metavar"] = each.placeholders if isinstance(each.words, int) else each.placeholders[0]
            if each.is_option:
                group.add_argument(each.flag, dest=each.name, default=each.default, **given)
            else:
                default = [] if each.words == "*" else None if each.words in (None, "+") else each.default
                group.add_argument(each.name, default=default, **given)
        return parser

    def _usage_words(self) -> Iterator[str]:
        for each in self.parameters:
            shown = each.argument.shown
            if each.is_option:
                yield f"[{' '.join(filter(None, (each.flag, shown)))}]"
            else:
                yield f"[{shown}]" if each.words == "?" else shown

    def _rows(self) -> Iterator[str]:
        """Yields each entry of the section `Args:`, formatted for the help text."""
        by_name = {each.name: each for each in self.parameters}
        for entry in re.split(r"\n(?! )", self._args) if self._args else ():
            name, _, text = entry.partition(": ")
            each = by_name.get(name)
            label = each.label if each else name
            if each and each.argument.choices is not None:
                *some, last = each.argument.choices()
                text = text.replace("{choices}", f"{', '.join(some)} or {last}")
            gap = " " if len(label) <= NAME_WIDTH else "   "
            lines = [line.strip() for line in text.splitlines()]
            yield f"{label:<{NAME_WIDTH}}{gap}" + f"\n{'':<{NAME_WIDTH}} ".join(lines)


def _parse(argument: Argument) -> Callable[[str], Any]:
    """Returns the function that argparse calls for each word, to parse the word or check it against the choices."""
    choices = argument.choices
    if choices is None or argument.is_open:
        return argument.parse

    def choose(word: str) -> str:
        known = list(choices())
        if word in known:
            return word
        raise argparse.ArgumentTypeError(f"invalid choice: {word!r} (choose from {', '.join(map(repr, known))})")

    return choose


def _indented(text: str) -> str:
    return "\n".join(f"    {line}" for line in text.splitlines())
