"""Folders of a process go with it, or, if it was killed, when the next one starts."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

START = """from custom_ros_tools.files import temporary_folder
folder = temporary_folder('trial'); print(folder.name, flush=True)"""


def start(temporary: Path, then: str = "") -> subprocess.Popen[str]:
    environment = {**os.environ, "TMPDIR": str(temporary), "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-c", f"{START}; {then}"]
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment)


def folder_of(process: subprocess.Popen[str]) -> Path:
    assert process.stdout is not None
    return Path(process.stdout.readline().strip())


def test_only_folders_of_killed_processes_are_removed_at_start(tmp_path: Path) -> None:
    (tmp_path / "rpbi-of-somebody").mkdir()
    killed = start(tmp_path, "import os, signal; os.kill(os.getpid(), signal.SIGKILL)")
    left = folder_of(killed)
    assert killed.wait(60.0) == -signal.SIGKILL and left.is_dir()
    with start(tmp_path, "input()") as living:
        its_own = folder_of(living)
        assert not left.exists()
        with start(tmp_path) as ended:
            gone = folder_of(ended)
            ended.communicate()
        assert not gone.exists()
        assert sorted(tmp_path.iterdir()) == sorted([its_own, tmp_path / "rpbi-of-somebody"])
        living.communicate("\n")
    assert [each.name for each in tmp_path.iterdir()] == ["rpbi-of-somebody"]
