"""The version is in one file; all others, the list of changes and the citation agree with it."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
import yaml

from custom_ros_tools.console.release import SOURCE, version, version_files

ROOT = Path(__file__).resolve().parents[1]
AUTHORS = "Mower Stouraitis Moura Rauch Yan Behabadi Gienger Vercauteren Bergeles Vijayakumar"
"""Last words of the names of the paper's authors, in their order."""


def disagreeing(root: Path) -> list[str]:
    """Returns the files of a workspace that state another version than its source, or none."""
    wrong = [path for path, text in version_files(root).items() if path.read_text() != text]
    silent = [path for path, text in version_files(root).items() if version(root) not in text]
    newest = re.findall(r"^## (\S+)", (root / "docs/changelog.md").read_text(), re.MULTILINE)[0]
    changes = [] if newest == version(root) else [root / "docs/changelog.md"]
    return sorted(str(path.relative_to(root)) for path in {*wrong, *silent, *changes})


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """The files of the workspace that state a version."""
    for path in (*version_files(ROOT), ROOT / "docs/changelog.md"):
        target = tmp_path / path.relative_to(ROOT)
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, target)
    return tmp_path


def test_all_files_have_the_version():
    assert len(version_files(ROOT)) > 20
    assert disagreeing(ROOT) == []


@pytest.mark.parametrize("file", ["CITATION.cff", "src/rpbi_mpc/package.xml", "docs/changelog.md"])
def test_file_of_another_version_is_named(copy, file):
    path = copy / file
    path.write_text(path.read_text().replace(version(copy), "0.9.0", 1))
    assert disagreeing(copy) == [file]


def test_change_of_the_source_reaches_all_files(copy):
    source = copy / SOURCE
    source.write_text(source.read_text().replace(f"<version>{version(copy)}<", "<version>2.3.4<"))
    for path, text in version_files(copy).items():
        assert "2.3.4" in text and ('<?xml version="1.0"?>' in text) == (path.suffix == ".xml")
        path.write_text(text)
    assert disagreeing(copy) == ["docs/changelog.md"]


def test_citation_has_the_fields_of_its_format():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert citation.keys() >= {"cff-version", "message", "title", "authors"} and citation["cff-version"] == "1.2.0"
    known = "cff-version message type title abstract version license authors preferred-citation date-released".split()
    assert citation.keys() <= set(known)
    paper = citation["preferred-citation"]
    assert paper["type"] == "conference-paper" and paper.keys() >= {"title", "authors", "year", "conference"}
    assert [each["family-names"].split()[-1] for each in paper["authors"]] == AUTHORS.split()
    assert paper["title"] in (ROOT / "README.md").read_text().replace("\n", " ")
