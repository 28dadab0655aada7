"""The command `docs`, and functions that generate docs/commands.md and the completion file for bash."""

import pkgutil
from collections.abc import Iterable
from pathlib import Path

from .command import PROGRAM, Command
from .modules import commands, workspace

FIRST = (
    *("demo", "launch", "check", "list", "spawn", "remove", "move", "send", "attach", "detach", "gravity"),
    *("save", "restore", "replay", "test", "docs", "bench", "shell", "setup"),
)
"""Commands at the beginning of docs/commands.md, in the order of the page; other commands follow, sorted by name."""
_HEAD = f"""\
<!-- Written by `{PROGRAM} docs` from the code: change it there, not here. -->

# Commands

`{PROGRAM} COMMAND --help` prints the section of that command, `{PROGRAM}` alone the list of all commands. Each command
first [sets up](installation.md) what is missing. Ctrl-C ends every command at any time.

[Completion](#completion) in bash knows commands, options, examples, their arguments, files, and what is in the running
world.
"""
_TAIL = f"""\
## Completion

In `~/.bashrc`, with the path of your checkout:

```
source ~/rpbi/dev/tools/completion.bash
```

`{PROGRAM} shell` has it already. It works for every checkout, called as `{PROGRAM}`, `rpbi` or by its path.

```
$ {PROGRAM} lau<Tab> bas<Tab>_ku<Tab> real<Tab>0.5
$ {PROGRAM} launch basic_example_kuka_lwr real_time_factor:=0.5
```
"""
WRITERS = (
    "ik_ros.node_configs:schema_files",
    "motion_primitives.node_configs:schema_files",
    "rpbi_mpc.node_configs:schema_files",
    "rpbi_utils.schemas:schema_files",
    "safe_robot.schemas:schema_files",
    "rpbi.gym.schemas:schema_files",
    "rpbi.reference.config_page:config_files",
    "rpbi.ros.interface_page:interface_files",
    "custom_ros_tools.console.docs:console_files",
    "rpbi_examples.plugins_page:plugin_files",
)
"""Functions that take the folder of the workspace, and return the texts of generated files, indexed by path."""


def page(listed: Iterable[Command]) -> str:
    """Returns the text of docs/commands.md for the given commands."""
    return "\n".join([_HEAD, *(f"## {each.name}\n\n{each.section}" for each in listed), _TAIL])


def console_files(root: Path) -> dict[Path, str]:
    """Returns the texts of docs/commands.md and of the completion file for a workspace, indexed by path."""
    order = {name: place for place, name in enumerate(FIRST)}
    listed = sorted(commands(root), key=lambda each: order.get(each.name, len(order)))
    lines = [line for each in listed for line in each.completions()]
    return {root / "docs/commands.md": page(listed), root / "dev/tools/completion.txt": "\n".join(lines) + "\n"}


def files(root: Path) -> dict[Path, str]:
    """Returns the texts of all files that are generated from a workspace's code, indexed by path."""
    return {path: text for writer in WRITERS for path, text in pkgutil.resolve_name(writer)(root).items()}


def docs() -> None:
    """Generates the JSON Schemas and the reference pages in docs/ from the code, and writes them to files."""
    root = workspace()
    for path, text in files(root).items():
        path.parent.mkdir(exist_ok=True)
        is_new = not path.exists() or path.read_text(encoding="utf-8") != text
        path.write_text(text, encoding="utf-8")
        print(f"{'written' if is_new else 'unchanged'}: {path.relative_to(root)}")
