"""An interactive bash in a terminal, to type into as a user does."""

from __future__ import annotations

import os
import pty
import select
import subprocess
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
PROMPT = "ready> "
INPUTRC = (
    "set enable-bracketed-paste off\nset show-all-if-ambiguous on\nset page-completions off\nset bell-style none\n"
    "set completion-query-items 0\n"
)


class Terminal:
    """An interactive bash that has sourced the completion of `./rpbi`.

    Args:
        folder: Where it is; its home, too.
        environment: Further environment variables.
    """

    def __init__(self, folder: Path, **environment: str) -> None:
        (folder / "inputrc").write_text(INPUTRC)
        environment |= {"PATH": "/usr/bin:/bin", "TERM": "dumb", "HOME": str(folder), "PS1": PROMPT, "COLUMNS": "1000"}
        environment["INPUTRC"] = str(folder / "inputrc")
        self._us, them = pty.openpty()
        self._bash = subprocess.Popen(
            ["bash", "--norc", "-i"], cwd=folder, env=environment, stdin=them, stdout=them, stderr=them,
            start_new_session=True,
        )  # fmt: skip
        os.close(them)
        self.read_until(PROMPT)
        self.send(f"source {ROOT}/dev/tools/completion.bash; ln -sf {ROOT}/rpbi rpbi\n")
        self.read_until(f"\n{PROMPT}")

    def send(self, text: str) -> None:
        os.write(self._us, text.encode())

    def read_until(self, end: str) -> str:
        """Returns what bash writes up to some text."""
        seen = ""
        give_up_s = time.monotonic() + 60.0
        while not seen.endswith(end):
            ready, _, _ = select.select([self._us], [], [], max(0.0, give_up_s - time.monotonic()))
            assert ready, f"expected {end!r} at the end of {seen!r}"
            seen += os.read(self._us, 4096).decode(errors="replace").replace("\r", "")
        return seen

    def completed(self, line: str) -> str:
        """Types a line that ends with a tab, and returns the line that bash makes of it."""
        return self.shown(line).splitlines()[-3]

    def shown(self, line: str) -> str:
        """Types a line that ends with a tab, has it printed, and returns all that bash writes meanwhile."""
        self.send(f"{line}\x01echo \x05;echo end\n")  # to the line's start, and to its end
        return self.read_until(f"\nend\n{PROMPT}")

    def offered(self, line: str) -> set[str]:
        """Types a line that ends with a tab, and returns what bash offers."""
        self.send(f"{line}\x15echo end\n")  # the line is dropped
        seen = self.read_until(f"\nend\n{PROMPT}")
        return set(seen.partition("\n")[2].partition(PROMPT)[0].split())

    def close(self) -> None:
        self.send("exit\n")
        self._bash.wait(30.0)
        os.close(self._us)
