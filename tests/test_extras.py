"""The extras: what `./rpbi setup EXTRA` installs."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
FILES = sorted(ROOT.glob("requirements*.txt"))


def pins(file: Path) -> dict[str, str]:
    """Returns what a file asks for, by package."""
    lines = [line.split("#")[0].strip() for line in file.read_text().splitlines()]
    return dict(re.fullmatch(r"([\w.-]+)(.*)", line).groups() for line in lines if line)


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_packages_are_pinned(file):
    loose = {name: pin for name, pin in pins(file).items() if not re.fullmatch(r"==[\w.]+", pin)}
    assert loose in ({}, {"numpy": "<2"})


def test_extras_go_together():
    wanted: dict[str, str] = {}
    for file in FILES:
        for name, pin in pins(file).items():
            assert pin == "<2" or wanted.setdefault(name, pin) == pin, f"{file.name}: {name}"
    assert wanted["numpy"].startswith("==1."), "Debian's packages are built for NumPy 1"


def test_an_unknown_extra_is_refused_with_the_known_ones():
    answer = subprocess.run([str(ROOT / "rpbi"), "setup", "ikk"], capture_output=True, text=True, timeout=60.0)
    assert answer.returncode == 2
    assert "There is no extra 'ikk'; there are: assets ik mpc." in answer.stderr
