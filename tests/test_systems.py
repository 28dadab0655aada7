"""Systems other than Debian 12 are refused by `./rpbi` before anything is installed there."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
REFUSAL = "The workspace needs Debian 12 (bookworm), for instance in a container (debian:12); here is "


def check(release: Path) -> subprocess.CompletedProcess[str]:
    """Runs the check of `./rpbi` for a file in the format of os-release(5)."""
    script = (ROOT / "rpbi").read_text()
    function = script[script.index("check_system() {") : script.index("check_may_install() {")]
    functions = f'say() {{ printf "%s\\n" "$*" >&2; }}\n{function}'
    command = ["bash", "-c", f"{functions}\ncheck_system {release}"]
    return subprocess.run(command, capture_output=True, text=True, timeout=300.0)


@pytest.mark.parametrize(
    ("release", "name"),
    [
        ('PRETTY_NAME="Debian GNU/Linux 13 (trixie)"\nVERSION_CODENAME=trixie', "Debian GNU/Linux 13 (trixie)."),
        ('PRETTY_NAME="Ubuntu 24.04 LTS"\nVERSION_CODENAME=noble\nID=ubuntu', "Ubuntu 24.04 LTS."),
        ("ID=void", "this system."),
    ],
)
def test_other_system_is_refused_by_its_name(tmp_path, release, name):
    (tmp_path / "os-release").write_text(release)
    done = check(tmp_path / "os-release")
    assert done.returncode == 1
    assert done.stderr.splitlines()[0] == REFUSAL + name


def test_missing_release_file_is_refused(tmp_path):
    assert check(tmp_path / "none").stderr.startswith(f"{REFUSAL}this system.")


def test_debian_12_and_systems_from_it_pass(tmp_path):
    (tmp_path / "os-release").write_text('PRETTY_NAME="Raspberry Pi OS"\nVERSION_CODENAME=bookworm')
    done = check(tmp_path / "os-release")
    assert (done.returncode, done.stderr) == (0, "")
