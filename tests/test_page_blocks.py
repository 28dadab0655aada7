"""Every fenced block of the pages runs in a test, or says why not; its commands exist with their options."""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml
from page_blocks import COMMANDS, LANGUAGES, ROOT, Block, all_blocks, blocks_in, simple_commands
from page_runs import Printed, agree, run_blocks, wrong_outputs

BLOCKS = all_blocks()
SECTIONS = dict(
    re.findall(r"^## ([a-z_]+)\n\n(.*?)\n(?=^## )", (ROOT / "docs/commands.md").read_text(), re.DOTALL | re.MULTILINE)
)
"""Help texts of the commands, indexed by name."""
EXAMPLES = {path.stem: path for path in ROOT.glob("src/rpbi_examples/launch/*.launch")}
COMMON_WORDS = {"rpbi", "launch", "rosservice", "call", "rosrun", "true", "false"}
OF_ROSLAUNCH = {"--screen", "--ns", "--replace", "-p", "--ros-args"}
RUN_HERE = sorted({block.page for block in BLOCKS if block.language == "python" and not block.marks})
"""Pages whose Python blocks no other test runs."""


def faults(blocks: Iterable[Block]) -> list[str]:
    """Returns the blocks whose language or mark is wrong, with the fault."""
    found = []
    for block in blocks:
        if block.language not in LANGUAGES:
            found.append(f"{block}: expected a language of {sorted(LANGUAGES)}, got '{block.language}'")
        if block.unknown_marks:
            found.append(f"{block}: unknown mark '{block.mark}'")
        for check in (missing_in_test, missing_in_file, unknown_imports, unreadable):
            found += [f"{block}: {each}" for each in check(block)]
    return found


def missing_in_test(block: Block) -> Iterator[str]:
    """Yields the faults of the mark `run by`: the test's file must name the page, or something of each command."""
    if "run by" not in block.marks:
        return
    files = block.marks["run by"].split(", ")
    if lost := [file for file in files if not file.startswith("tests/") or not (ROOT / file).is_file()]:
        yield f"there is no test '{lost[0]}'"
        return
    text = "".join((ROOT / file).read_text() for file in files)
    if Path(block.page).name in text:
        return
    if block.language == "python":
        yield f"{files[0]} does not name {Path(block.page).name}"
    for command, _ in block.commands:
        for words in simple_commands(command):
            names = {part for word in words for part in re.findall(r"\w{3,}", word)} - COMMON_WORDS
            if names and words[1:2] != ["setup"] and not any(name in text for name in names):
                yield f"{files[0]} has nothing of '{' '.join(words)}'"


def missing_in_file(block: Block) -> Iterator[str]:
    """Yields the lines of an excerpt that its file does not have. `...` ends a line of which the file has more."""
    if "part of" not in block.marks:
        return
    file = ROOT / block.marks["part of"]
    text = " ".join(file.read_text().split()) if file.exists() else ""
    for line in block.text.splitlines():
        code = " ".join(re.sub(r"(  # .*|\.\.\.\)?)$", "", line).split())
        if code not in text and not code.startswith("# src/"):
            yield f"{block.marks['part of']} does not have '{code}'"


def unknown_imports(block: Block) -> Iterator[str]:
    """Yields the imports of a Python block from modules of this workspace that do not have the names."""
    if block.language != "python":
        return
    for module, names in re.findall(r"^\s*from ([\w.]+) import ([\w, ]+)", block.text, re.MULTILINE):
        place = f"src/*/src/{module.replace('.', '/')}"
        files = [*ROOT.glob(f"{place}.py"), *ROOT.glob(f"{place}/__init__.py")]
        known = any(ROOT.glob(f"src/*/src/{module.split('.')[0]}"))
        text = "".join(file.read_text() for file in files)
        for name in re.findall(r"\w+", names) if known and not module.endswith((".msg", ".srv")) else ():
            if not re.search(rf"\b{name}\b", text) and not list(ROOT.glob(f"{place}/{name}.py")):
                yield f"{module} does not have '{name}'"


def unreadable(block: Block) -> Iterator[str]:
    """Yields the error of a block of data or Python that cannot be parsed."""
    try:
        if block.language == "yaml":
            yaml.safe_load(block.text)
        elif block.language == "json":
            json.loads(block.text)
        elif block.language == "xml":
            ElementTree.fromstring(f"<launch>{block.text}</launch>")
        elif block.language == "python" and "part of" not in block.marks:
            ast.parse(block.text)
    except (yaml.YAMLError, ValueError, ElementTree.ParseError, SyntaxError) as error:
        yield str(error).splitlines()[0]


@cache
def arguments_of(file: Path) -> set[str]:
    """Returns the names of the arguments of a launch file."""
    return set(re.findall(r'<arg\s+name="(\w+)"', file.read_text()))


def wrong_words(words: list[str]) -> Iterator[str]:
    """Yields the faults of a simple command: names, options and arguments that do not exist."""
    program, *rest = words
    if Path(program).name == "rpbi" and rest:
        name, *given = rest
        if name not in SECTIONS:
            yield f"there is no command '{name}'"
        elif name == "launch":
            yield from wrong_launch(given)
        elif name != "shell":
            options = {each.split("=")[0] for each in given if each.startswith("--")}
            known = set(re.findall(r"--[\w-]+", SECTIONS[name]))
            yield from (f"'{name}' has no option {each}" for each in sorted(options - known))
    elif program == "rosrun":
        package, name, *_ = rest
        if (ROOT / "src" / package).exists() and not re.search(rf"\b{Path(name).stem}\b", programs_of(package)):
            yield f"{package} has no program '{name}'"
    elif program == "python3" and rest[0].startswith("dev/"):
        text = (ROOT / rest[0]).read_text() if (ROOT / rest[0]).exists() else ""
        yield from (f"{rest[0]} has no {each}" for each in rest if each.startswith("--") and f'"{each}"' not in text)
        if not text:
            yield f"there is no file {rest[0]}"
    elif "-m" in rest:
        module = rest[rest.index("-m") + 1].replace(".", "/")
        if module.startswith("rpbi") and not list(ROOT.glob(f"src/*/src/{module}.py")):
            yield f"there is no module {module}"


def wrong_launch(given: list[str]) -> Iterator[str]:
    """Yields the faults of the words after `./rpbi launch`."""
    if not given or given[0].endswith((".yaml", ".launch")):
        name = "world"
    else:
        name = given[0]
    if name not in EXAMPLES:
        yield f"there is no example '{name}'"
        return
    known = arguments_of(EXAMPLES[name])
    for word in given[1:]:
        argument, is_given, _ = word.partition(":=")
        if (is_given and argument not in known) or (word.startswith("-") and word not in OF_ROSLAUNCH):
            yield f"example '{name}' has no argument '{argument}'"


@cache
def programs_of(package: str) -> str:
    """Returns the texts that name the programs of a package."""
    files = ROOT.glob(f"src/{package}/**/*")
    return "\n".join([path.name for path in files] + [(ROOT / f"src/{package}/CMakeLists.txt").read_text()])


def wrong_commands(blocks: Iterable[Block]) -> list[str]:
    """Returns the commands of blocks that cannot be right, with the fault."""
    return [
        f"{block}: {fault}"
        for block in blocks
        if block.language in COMMANDS
        for command, _ in block.commands
        if "<Tab>" not in command
        for words in simple_commands(command)
        for fault in wrong_words(words)
    ]


def test_every_block_has_a_language_and_its_mark_is_true():
    assert len(BLOCKS) > 400
    assert faults(BLOCKS) == []


def test_commands_of_all_blocks_exist_with_their_options():
    assert sum(len(block.commands) for block in BLOCKS if block.language in COMMANDS) > 200
    assert wrong_commands(BLOCKS) == []


@pytest.mark.parametrize("page", RUN_HERE)
def test_python_blocks_print_the_shown_output(page, tmp_path):
    blocks = [block for block in BLOCKS if block.page == page and block.language == "python" and not block.marks]
    run_blocks(blocks, tmp_path)


FAULTY = """\
```
no language
```
<!-- not run: -->
```python
x = 1
```
<!-- run sometimes -->
```python
x = 1
```
<!-- run by tests/test_lost.py -->
```python
x = 1
```
<!-- run by tests/test_links.py -->
```python
x = 1
```
<!-- run by tests/test_links.py -->
```shell
./rpbi launch dual_arm
```
<!-- part of docs/templates/my_robot_lab/setup.py -->
```python
lost_line()
```
<!-- not run: needs a robot -->
```python
from rpbi.world import World, Wordl
```
```yaml
a: [1
```
```xml
<node>
```
"""


def test_faulty_blocks_are_named():
    assert [re.sub(" of .*, got", " ..., got", each) for each in faults(blocks_in(FAULTY, "a.md"))] == [
        "a.md:2: expected a language ..., got ''",
        "a.md:6: unknown mark 'not run:'",
        "a.md:10: unknown mark 'run sometimes'",
        "a.md:14: there is no test 'tests/test_lost.py'",
        "a.md:18: tests/test_links.py does not name a.md",
        "a.md:22: tests/test_links.py has nothing of './rpbi launch dual_arm'",
        "a.md:26: docs/templates/my_robot_lab/setup.py does not have 'lost_line()'",
        "a.md:30: rpbi.world does not have 'Wordl'",
        "a.md:33: while parsing a flow sequence",
        "a.md:36: mismatched tag: line 2, column 2",
    ]


def test_wrong_commands_are_named():
    text = """\
./rpbi lauch dual_arm
./rpbi launch dual_arms
./rpbi launch dual_arm headles:=true   # a comment
./rpbi test --quik
rosrun rpbi_utils lost_node.py
./rpbi shell -c 'python3 dev/robustness/bags.py --number 3'
./rpbi shell -c 'python -m rpbi_examples.lost'
./rpbi launch dual_arm headless:=true && ./rpbi test --quick
"""
    assert wrong_commands(blocks_in(f"```shell\n{text}```\n", "a.md")) == [
        "a.md:2: there is no command 'lauch'",
        "a.md:2: there is no example 'dual_arms'",
        "a.md:2: example 'dual_arm' has no argument 'headles'",
        "a.md:2: 'test' has no option --quik",
        "a.md:2: rpbi_utils has no program 'lost_node.py'",
        "a.md:2: dev/robustness/bags.py has no --number",
        "a.md:2: there is no module rpbi_examples/lost",
    ]


def test_other_output_than_the_page_shows_is_named():
    text = "print(1 + 1)  # 3\nprint(2)  # 2\nprint(3)  # a remark\nif False:\n    print(4)  # 4\n"
    (block,) = blocks_in(f"```python\n{text}```\n", "a.md")
    printed = [Printed(0, line, f"{line}\n") for line in (2, 3, 4)]
    assert wrong_outputs([block], printed) == [
        "a.md:2 shows '3', prints '2'",
        "a.md:3 shows '2', prints '3'",
        "a.md:6 shows '4', prints 'nothing'",
    ]


def test_blocks_that_fail_or_print_something_else_fail(tmp_path):
    for text in ("print(2)  # 3\n", "1 / 0\n"):
        with pytest.raises(AssertionError, match=r"index.md:2 shows '3', prints '2'|ZeroDivisionError"):
            run_blocks(blocks_in(f"```python\n{text}```\n", "docs/index.md"), tmp_path)


@pytest.mark.parametrize(
    ("shown", "printed", "varies", "expected"),
    [
        ("12 states agree", "12 states agree\n", False, True),
        ("12 states agree", "13 states agree\n", False, False),
        ("12 states agree", "1300 states agree\n", True, True),
        ("12 states agree", "1300 states differ\n", True, False),
        ("1  9.05 kB", "22     180 kB\n", True, True),
        ("a\n...\nd", "a\nb\nc\nd\n", False, True),
        ("a\n...\nd", "a\nb\nc\n", False, False),
    ],
)
def test_outputs_agree_by_text_or_by_shape(shown, printed, varies, expected):
    assert agree(shown, printed, varies) is expected
