"""The command `docs`, and functions that generate docs/commands.md and the completion file for bash."""

import os
import pkgutil
import subprocess
import sys
from collections.abc import Iterable
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

from .argument import Argument
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

```shell
source ~/rpbi/dev/tools/completion.bash
```

`{PROGRAM} shell` has it already. It works for every checkout, called as `{PROGRAM}`, `rpbi` or by its path.

<!-- run by tests/test_completion.py -->
```console
$ {PROGRAM} lau<Tab> bas<Tab>_ku<Tab> real<Tab>0.5
$ {PROGRAM} launch basic_example_kuka_lwr real_time_factor:=0.5
```
"""
WRITERS = (
    "ik_ros.node_configs:schema_files",
    "motion_primitives.node_configs:schema_files",
    "rpbi_mpc.node_configs:schema_files",
    "rpbi_planning.node_configs:schema_files",
    "rpbi_reality.identification.fit_config:schema_files",
    "rpbi_utils.schemas:schema_files",
    "safe_robot.schemas:schema_files",
    "rpbi.gym.schemas:schema_files",
    "rpbi.reference.config_page:config_files",
    "rpbi.ros.interface_page:interface_files",
    "custom_ros_tools.console.docs:console_files",
    "rpbi_examples.plugins_page:plugin_files",
    "custom_ros_tools.console.release:version_files",
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


def docs(
    *, serve: Annotated[bool, Argument("")] = False, port: Annotated[int, Argument("NUMBER", parse=int)] = 8000
) -> int:
    """Generates the schemas for editors and the reference pages from the code, and builds the web site of all pages.

    The site is built into out/site if the extra `site` is installed. It needs no network, neither to be built nor to be
    read. Dead links, missing headings and pages without a place in the navigation make the build fail.

    Args:
        serve: show the site at http://localhost:8000 until Ctrl-C, and again after each change of a page
        port: port for --serve; 8000 by default
    """
    root = workspace()
    for path, text in files(root).items():
        path.parent.mkdir(exist_ok=True)
        is_new = not path.exists() or path.read_text(encoding="utf-8") != text
        if is_new:  # a package.xml with a new time would be built again
            path.write_text(text, encoding="utf-8")
        print(f"{'written' if is_new else 'unchanged'}: {path.relative_to(root)}")
    if find_spec("mkdocs") is None:
        print(f"no site: {PROGRAM} setup site installs the tools for it", file=sys.stderr)
        return 1 if serve else 0
    if serve:
        return run_mkdocs(root, "serve", "--no-strict", "--dev-addr", f"127.0.0.1:{port}")
    code = run_mkdocs(root, "build")  # without --quiet, which hides warnings and lets them pass
    print("no site" if code else "built: out/site/index.html")
    return code


def run_mkdocs(root: Path, *words: str) -> int:
    """Runs a command of MkDocs for the site of a workspace, and returns its exit code."""
    command = (sys.executable, "-m", "mkdocs", *words, "--config-file", str(root / "dev/site/mkdocs.yml"))
    return subprocess.run(command, env=os.environ | {"NO_MKDOCS_2_WARNING": "1"}).returncode
